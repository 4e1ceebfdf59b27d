"""The real vehicles and their twins: statistics against cases worked out by hand, halves, occlusion."""

import numpy as np
import pytest

from sensors import find
from studies.calibration.statistics import (
    BLOCK,
    DATA,
    NAMES,
    Vehicles,
    groups,
    halves,
    read_real,
    simulate,
    statistics,
    sums,
)

needs_data = pytest.mark.skipif(
    not (DATA / "objects.npz").exists(), reason="the real detections are not part of this project and not beside it"
)


def cars(pose, size=(4.0, 2.0), xy=((0.0, 0.0),), row=(0,), frame=None):
    pose = np.array(pose, float)
    n = len(pose)
    frame = np.zeros(n, int) if frame is None else np.array(frame)
    return Vehicles(pose, np.tile(size, (n, 1)), np.full(n, "car"), frame, np.array(xy), np.array(row))


def test_statistics_of_four_detections_are_those_counted_by_hand():
    # Car of 4 x 2 m ahead, its rear towards the radar: long = x - 20, lat = y.
    xy = [[18.0, 0.0], [17.7, 0.0], [20.5, 0.0], [21.0, 0.7], [30.0, 0.0]]
    got = statistics(sums(cars([[20.0, 0.0, 0.0]], xy=xy, row=[0] * 5)))
    where = {"facing": 0.5, "near": 0.25, "far": 0.75, "deep": 0.25, "outside": 0.25}
    spread = {"u": np.sqrt((1 + 1.15**2 + 0.25**2 + 0.5**2) / 4), "v": np.sqrt(0.49 / 4)}
    assert dict(zip(NAMES, got, strict=True)) == pytest.approx(where | spread | {"median": 4, "mean": 4, "std": 0})


def test_cars_are_sorted_by_range_and_by_the_side_they_show():
    known = cars([[10.0, 0.0, 0.0], [20.0, 0.0, np.pi], [40.0, 0.0, np.pi / 2], [60.0, 0.0, 0.8]])
    rows = {name: np.flatnonzero(chosen).tolist() for name, chosen in groups(known).items()}
    assert (rows["rear"], rows["front"], rows["side"], rows["diagonal rear"]) == ([0], [1], [2], [3])
    assert (rows["0-15 m"], rows["15-30 m"], rows["30-50 m"], rows["50-80 m"]) == ([0], [1], [2], [3])
    assert not rows["truck"]


def test_the_halves_are_blocks_of_frames_and_keep_the_detections_of_their_vehicles():
    known = cars(
        [[10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [30.0, 0.0, 0.0]], xy=[[10.0, 0.0], [20.0, 0.0], [21.0, 0.0], [30.0, 0.0]],
        row=[0, 1, 1, 2], frame=[BLOCK - 1, BLOCK, 2 * BLOCK],
    )  # fmt: skip
    fit, held_out = halves(known)
    assert fit.pose[:, 0].tolist() == [10.0, 30.0]
    assert held_out.pose[:, 0].tolist() == [20.0]
    assert (fit.xy[:, 0].tolist(), fit.row.tolist()) == ([10.0, 30.0], [0, 1])
    assert (held_out.xy[:, 0].tolist(), held_out.row.tolist()) == ([20.0, 21.0], [0, 0])


def test_a_car_is_hidden_by_those_of_its_own_frame_only():
    pose = [[15.0, 0.0, 0.0], [25.0, 0.0, 0.0]]
    together, apart = (
        simulate(find("imaging"), cars(pose, frame=frame), np.random.default_rng(0), 20) for frame in ([0, 0], [0, 1])
    )
    count = [sums(twins)[:, 0].reshape(20, 2).mean(0) for twins in (together, apart)]
    assert count[0][1] < 0.7 * count[1][1]
    assert count[0][0] == pytest.approx(count[1][0], rel=0.5)  # negative binomial counts: 16 % standard error each


def test_absent_data_are_reported_in_one_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"no real detections, no objects.npz in .*; give the folder"):
        read_real(tmp_path)


@needs_data
def test_the_published_shares_of_the_real_cars_are_reproduced():
    real = read_real()
    passenger = np.isin(real.kind, ["car"]) | ((real.kind == "van") & (real.size[:, 0] > 0))
    table, every = sums(real), groups(real)
    assert every["all"].sum() + every["van"].sum() == 2941 + 2  # tall ones and two of other classes
    got = dict(zip(NAMES, statistics(table[passenger]), strict=True))
    assert [round(got[name], 2) for name in ("facing", "near", "far", "deep", "outside")] == [
        0.84,
        0.51,
        0.79,
        0.20,
        0.24,
    ]


@needs_data
def test_a_radar_that_sees_only_contours_is_told_apart_from_the_real_one():
    real = read_real()
    few = real.part(real.frame % 20 == 1)
    twins = simulate(find("ideal"), few, np.random.default_rng(0))
    a, b = (dict(zip(NAMES, statistics(sums(part)), strict=True)) for part in (few, twins))
    assert b["near"] > a["near"] + 0.2
    assert b["deep"] < a["deep"] - 0.1

"""The imaging radar against real cars; the statistics against cases worked out by hand."""

import numpy as np
import pytest

from sensors import find
from testbed.learn.calibration import ASPECTS, BANDS, DATA, NAMES, Cars, groups, read_real, report, simulate, statistics

needs_data = pytest.mark.skipif(
    not (DATA / "objects.npz").exists(), reason="the real detections are not part of this project and not beside it"
)
EVERY = 2  # every second car is simulated: the mean count of a band of 400 cars then has a standard error of 4 %


@pytest.fixture(scope="module")
def both():
    real = read_real()
    return real, simulate(find("imaging"), real, np.random.default_rng(11), EVERY)


def test_statistics_of_four_detections_are_those_counted_by_hand():
    # Car of 4 x 2 m ahead, its rear towards the radar: long = x - 20, lat = y.
    xy = np.array([[18.0, 0.0], [17.7, 0.0], [20.5, 0.0], [21.0, 0.7], [30.0, 0.0]])
    cars = Cars(np.array([[20.0, 0.0, 0.0]]), np.array([[4.0, 2.0]]), xy, np.zeros(5, int))
    got = statistics(cars, np.ones(1, bool))
    where = {"facing": 0.5, "near": 0.25, "far": 0.75, "deep": 0.25, "outside": 0.25}
    spread = {"u": np.sqrt((1 + 1.15**2 + 0.25**2 + 0.5**2) / 4), "v": np.sqrt(0.49 / 4)}
    assert got == pytest.approx(where | spread | {"median": 4.0, "mean": 4.0, "std": 0.0})


def test_cars_are_sorted_by_range_and_by_the_side_they_show():
    pose = np.array([[10.0, 0.0, 0.0], [20.0, 0.0, np.pi], [40.0, 0.0, np.pi / 2], [60.0, 0.0, 0.8]])
    cars = Cars(pose, np.tile([4.0, 2.0], (4, 1)), np.zeros((0, 2)), np.zeros(0, int))
    rows = {name: np.flatnonzero(chosen).tolist() for name, chosen in groups(cars).items()}
    assert (rows["rear"], rows["front"], rows["side"], rows["diagonal rear"]) == ([0], [1], [2], [3])
    assert (rows["0-15 m"], rows["15-30 m"], rows["30-50 m"], rows["50-80 m"]) == ([0], [1], [2], [3])


def test_absent_data_are_reported_in_one_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"no real detections, no objects.npz in .*; give the folder"):
        read_real(tmp_path)


@needs_data
def test_the_published_shares_of_the_real_cars_are_reproduced(both):
    real, _ = both
    got = statistics(real, np.ones(len(real.pose), bool))
    shares = [round(got[name], 2) for name in ("facing", "near", "far", "deep", "outside")]
    assert shares == [0.84, 0.51, 0.79, 0.20, 0.24]
    medians = [statistics(real, chosen)["median"] for name, chosen in groups(real).items() if name.endswith(" m")]
    assert medians == [54, 47, 26, 18, 14]


@needs_data
def test_simulated_cars_return_from_where_real_cars_do(both):
    a, b = (statistics(cars, np.ones(len(cars.pose), bool)) for cars in both)
    for name in NAMES[:7]:
        assert b[name] == pytest.approx(a[name], abs=0.05), name


@needs_data
@pytest.mark.parametrize("band", ["0-15 m", "15-30 m", "30-50 m", "50-80 m", "80-120 m"])
def test_simulated_cars_return_as_often_as_real_cars_in_each_range_band(both, band):
    a, b = (statistics(cars, groups(cars)[band]) for cars in both)
    scatter = 1.25 * a["std"] / np.sqrt(groups(both[1])[band].sum())  # standard error of the median of normal counts
    assert b["median"] == pytest.approx(a["median"], rel=0.25, abs=3 * scatter)  # the larger of both: few cars are far
    assert b["mean"] == pytest.approx(a["mean"], rel=0.2)
    assert b["std"] == pytest.approx(a["std"], rel=0.4)
    for name in NAMES[:7]:
        assert b[name] == pytest.approx(a[name], abs=0.13), name


@needs_data
def test_a_radar_that_sees_only_contours_is_told_apart_from_the_real_one(both):
    real, _ = both
    ideal = simulate(find("ideal"), real, np.random.default_rng(0), 20)
    a, b = (statistics(cars, np.ones(len(cars.pose), bool)) for cars in (real, ideal))
    assert b["near"] > a["near"] + 0.2
    assert b["deep"] < a["deep"] - 0.1


@needs_data
def test_the_report_has_a_column_for_every_group():
    by_range, by_aspect = report(every=40)
    assert [column.header for column in by_range.columns] == ["", "all", *(f"{a:.0f}-{b:.0f} m" for a, b in BANDS)]
    assert [column.header for column in by_aspect.columns] == ["", *ASPECTS]
    assert by_range.row_count == by_aspect.row_count == 1 + len(NAMES)

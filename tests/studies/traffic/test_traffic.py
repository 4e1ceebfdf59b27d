"""The page of traffic: rows counted from recordings and drives made by hand, and the committed results."""

from pathlib import Path

import numpy as np
import pytest

from scenarios import SCENARIOS
from sensors.scene import boxes_scene
from studies.traffic import driven, page, recorded
from studies.traffic.distributions import SHOWN, distributions, table_of
from studies.traffic.rows import Row
from tests.studies.committed_pages import assert_committed

DOCS = Path(__file__).parents[3] / "docs"
CSV = "time,id,x,y,length,width,class"


def recording(folder, vehicles):
    """Files of both sources: vehicles (id, x at 0 s, speed, y, length) on a straight road, 4 s at 10 Hz."""
    lines = [CSV]
    for name, x, speed, y, length in vehicles:
        lines += [f"{t / 10},{name},{x + speed * t / 10:.3f},{y},{length},1.8,car" for t in range(41)]
    path = folder / "recording.csv"
    path.write_text("\n".join(lines))
    return path


def test_gaps_of_a_recording_are_from_bumper_to_bumper_in_the_same_lane(tmp_path, monkeypatch):
    path = recording(tmp_path, [("a", 0, 10, 0, 4), ("b", 30, 10, 0.5, 6), ("c", 15, 10, 3.6, 4), ("d", 170, 10, 0, 4)])
    monkeypatch.setattr(recorded, "FILES", {"here": (path.name,)})
    rows, inside = recorded.recorded("here", tmp_path)
    assert inside == 0.0
    assert len(rows) == 4 * 5
    found = {name: [r for r in rows if r.vehicle == name] for name in "abcd"}
    np.testing.assert_allclose([r.gap for r in found["a"]], 30 - (4 + 6) / 2, atol=1e-6)
    assert np.isnan([r.gap for name in "bcd" for r in found[name]]).all()  # 135 m ahead, or nobody
    np.testing.assert_allclose([r.speed for r in rows], 10.0, atol=1e-6)
    assert [r.time for r in found["a"]] == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_recording_whose_vehicles_are_inside_of_each_other_has_no_gaps(tmp_path, monkeypatch):
    path = recording(tmp_path, [("a", 0, 10, 0, 4), ("b", 2, 10, 0.5, 4), ("c", 30, 10, 0, 4), ("d", 60, 10, 0, 4)])
    monkeypatch.setattr(recorded, "FILES", {"here": (path.name,)})
    rows, inside = recorded.recorded("here", tmp_path)
    assert inside == 0.5
    assert np.isnan([r.gap for r in rows]).all()


def test_gaps_of_a_scene_are_along_the_lane_and_the_ego_is_a_leader():
    """A bend of three lanes: places along the middle lane, 4 m aside on the next one."""
    network = SCENARIOS["lane-change"].build(np.random.default_rng(0)).road.network
    middle, aside = network.get_lane(("a", "b", 1)), network.get_lane(("a", "b", 0))
    places = [(middle, 400.0), (middle, 450.0), (aside, 425.0), (aside, 600.0)]
    pose = np.array([[*lane.position(s, 0.0), lane.heading_at(s)] for lane, s in places])
    size = np.array([[4.0, 1.8], [10.0, 2.5], [4.0, 1.8], [4.0, 1.8]])
    scene = boxes_scene(pose, size)
    own = np.array([*middle.position(350.0, 0.0), middle.heading_at(350.0)])
    scene = scene._replace(ego=scene.ego._replace(pose=own))
    np.testing.assert_allclose(driven.gaps(scene, network), [50 - 7, np.nan, np.nan, np.nan], atol=0.05)
    behind = np.array([*middle.position(320.0, 0.0), middle.heading_at(320.0)])
    scene = boxes_scene(np.vstack([pose, behind]), np.vstack([size, [4.0, 1.8]]))
    scene = scene._replace(ego=scene.ego._replace(pose=own))
    assert driven.gaps(scene, network)[-1] == pytest.approx(30 - (4 + 4.7) / 2, abs=0.05)


def test_a_drive_has_its_first_frame_and_every_second_and_other_seeds_have_the_first_alone(monkeypatch):
    rows = driven.driven("catalogue", "tunnel", driven.DRIVEN["catalogue"])
    assert len(rows) == SCENARIOS["tunnel"].vehicles
    assert {row.time for row in rows} == {0.0}
    monkeypatch.setitem(driven.DRIVEN, "catalogue", 1)
    rows = driven.driven("catalogue", "tunnel", 0)
    assert sorted({row.time for row in rows}) == [float(t) for t in range(20)]
    assert {row.kind for row in rows} == {"car", "van", "truck"}


def made():
    """A queue of ten recorded vehicles, gaps 1 to 10 m at 0.5 m/s and 2 to 20 m at 2 m/s, and one simulated car."""
    rows = [Row("here", "file", 0, str(k), "car", t, 4 + k / 10, 1.8, v, g * (k + 1))
            for k in range(10) for t, v, g in ((0.0, 0.5, 1.0), (1.0, 2.0, 2.0))]  # fmt: skip
    return [*rows, Row("catalogue", "cut-in", 0, "1", "van", 0.0, 5.0, 2.0, 20.0)]


def test_sizes_count_once_a_vehicle_and_time_gaps_from_a_walking_pace_on():
    found = {(d.source, d.quantity, d.group): d for d in distributions(table_of(made()))}
    length = found["here", "length", "car or van"]
    assert (length.vehicles, length.values) == (10, 10)
    np.testing.assert_allclose(length.quantiles, np.percentile(4 + np.arange(10) / 10, SHOWN), atol=1e-3)
    assert length.low[2] < length.quantiles[2] < length.high[2]
    gap = found["here", "time_gap", "all"]
    assert gap.values == 10
    assert gap.quantiles[2] == pytest.approx(5.5)  # 2 m to 20 m at 2 m/s
    assert found["here", "gap", "0 to 2"].values == found["here", "gap", "2 to 10"].values == 10
    assert ("catalogue", "length", "car or van") not in found  # one vehicle is no group
    assert ("catalogue", "gap", "all") not in found
    assert not [d for d in found.values() if d.curve]  # ten vehicles are no curve


def test_the_committed_page_shows_the_committed_results(tmp_path):
    study = page.read(DOCS / "results" / page.RESULTS)
    assert_committed("traffic", page.render(study))
    page.write(study, tmp_path / "again.json")
    assert page.read(tmp_path / "again.json") == study
    names = {one.group for one in study.found if one.by == "scenario"}
    assert names == set(driven.SCENES)


def test_the_figure_is_drawn_from_the_committed_results_alone(tmp_path):
    page.main(data=None, docs=copied(tmp_path))
    assert (tmp_path / "pictures" / "traffic.png").stat().st_size > 10_000


def copied(folder):
    """A folder with the committed results."""
    (folder / "results").mkdir()
    (folder / "results" / page.RESULTS).write_bytes((DOCS / "results" / page.RESULTS).read_bytes())
    return folder

"""Scores of runs that can be counted by hand: cars in a row, tracks put where the case wants them."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors.origin import CLUTTER, CONTOUR, DOUBLE, MIRROR, STATIC, Origin
from sensors.scene import boxes_scene
from testbed.evaluation.metrics import gospa, gwd
from testbed.evaluation.pair_errors import pair_distances
from testbed.evaluation.tracking import ERRORS, Evaluator, jsonable
from trackers.estimate import prior
from trackers.geometry import box_corners
from trackers.multi.tracks import Tracks

CAR = np.array([4.6, 1.8])
DT = 0.5


def road(x, size=CAR, ids=None, kinds=None, crashed=None, **changes):
    """A scene of cars at (x, 0)."""
    x = np.asarray(x, float)
    pose = np.stack([x, 0 * x, 0 * x], -1)
    scene = boxes_scene(pose, np.broadcast_to(size, (len(x), 2)), **changes)
    objects = scene.objects._replace(
        id=np.arange(1, len(x) + 1) if ids is None else np.array(ids),
        kind=scene.objects.kind if kinds is None else kinds,
        crashed=scene.objects.crashed if crashed is None else np.array(crashed),
    )
    return scene._replace(objects=objects)


def seen(scene, expected=9.0, visible=1.0):
    N = len(scene.objects.id)
    return Origin.empty(N)._replace(expected=np.full(N, expected), visible=np.full(N, visible))


def tracks_at(x, ids, existence=0.9, **belief):
    x = np.asarray(x, float).reshape(-1)
    estimate = prior(np.stack([x, 0 * x, 0 * x], -1), **{"size": CAR, **belief})
    T = len(x)
    return Tracks(
        np.array(ids, int), np.full(T, existence), np.full(T, 9), np.ones(T), np.ones(T, bool), None, estimate, 99
    )


def run(held, expected=None, visible=1.0, phases=(), settle=0.0):
    """One car, scan by scan: '.' without a track, a digit for the id of the track on it."""
    evaluator, scene = Evaluator("case", phases, settle), road([20.0])
    for k, name in enumerate(held):
        ids = [] if name == "." else [int(name)]
        count = 9.0 if expected is None else expected[k]
        evaluator.step(DT * k, scene, seen(scene, count, visible), tracks_at([20.0] * len(ids), ids))
    return evaluator


def step_once(scene, origin, tracks):
    return Evaluator("case").step(0.0, scene, origin, tracks)


# One frame


def test_perfect_tracks_have_no_error():
    scene = road([10, 30, 50])
    score = step_once(scene, seen(scene), tracks_at([10, 30, 50], [7, 8, 9]))
    assert score.pairs == {1: 7, 2: 8, 3: 9}
    assert score.counted == (1, 2, 3)
    assert score.mean["gospa"] == pytest.approx(0.0, abs=1e-6)  # root of the rounding of extents
    for error in score.errors.values():
        assert error.keys() == set(ERRORS)
        shares = {name: error[name] for name in ("box_iou", "contour_iou")}
        assert shares == pytest.approx({"box_iou": 1.0, "contour_iou": 1.0})
        assert {error[name] for name in ("position", "velocity", "heading_deg", "length", "width")} == {0.0}


def test_no_tracks_of_four_cars_cost_sqrt_50():
    scene = road([10, 30, 50, 70])
    score = step_once(scene, seen(scene), tracks_at([], []))
    assert score.mean["gospa"] == pytest.approx(np.sqrt(50))
    assert (score.mean["objects"], score.mean["unassigned"], score.mean["tracks"]) == (4, 4, 0)
    assert score.pairs == score.errors == {}
    assert np.isnan(score.mean["gwd"])


def test_every_error_of_a_pair_is_the_one_computed_by_hand():
    scene = boxes_scene([[20.0, 5.0, np.radians(179)]], [[4.0, 2.0]], [[10.0, 0.0]])
    belief = prior(
        [[20.3, 5.4, np.radians(-179)]], velocity=[[13.0, -4.0]], size=[[5.0, 1.8]], position_std=0.5, velocity_std=2.0
    )
    tracks = tracks_at([0.0], [4])._replace(estimate=belief)
    error = step_once(scene, seen(scene), tracks).errors[0]
    distance = gwd(belief.pose[0], belief.size[0], scene.objects.pose[0], scene.objects.size[0])
    by_hand = {"position": 0.5, "velocity": 5.0, "heading_deg": 2.0, "length": 1.0, "width": -0.2}
    by_hand |= {"nees_position": 0.25 / 0.25, "nees_velocity": 25.0 / 4.0, "gwd": distance, "gwd2": distance**2}
    assert {name: error[name] for name in by_hand} == pytest.approx(by_hand)
    assert error["box_iou"] == error["contour_iou"] < 1


def test_half_overlapping_boxes_share_a_third_in_the_table():
    scene = road([20.0])
    error = step_once(scene, seen(scene), tracks_at([22.3], [4])).errors[1]
    assert error["box_iou"] == pytest.approx(1 / 3)


def test_the_contour_is_compared_with_all_bodies_of_the_object():
    # An object of two 2 m cubes, 4 m apart: its 6 x 2 box has 12 m^2, its bodies 8.
    scene = road([20.0], size=[6.0, 2.0])
    cubes = box_corners(np.array([[18.0, 0.0, 0.0], [22.0, 0.0, 0.0]]), np.full((2, 2), 2.0))
    bodies = scene.bodies._replace(owner=np.array([0, 0]), outline=tuple(cubes))
    scene = scene._replace(bodies=bodies)
    tracks = tracks_at([20.0], [4], size=[6.0, 2.0])
    error = step_once(scene, seen(scene), tracks).errors[1]
    assert error["box_iou"] == pytest.approx(1.0)
    assert error["contour_iou"] == pytest.approx(8 / 12)
    outlined = tracks._replace(estimate=tracks.estimate._replace(contour=cubes[:1]))
    assert step_once(scene, seen(scene), outlined).errors[1]["contour_iou"] == pytest.approx(4 / 8)


def test_a_hidden_object_counts_for_one_more_second():
    evaluator, scene = Evaluator("case"), road([20.0])
    counts = [
        evaluator.step(k * 0.25, scene, seen(scene, expected), tracks_at([], [])).counted
        for k, expected in enumerate([0.5, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0])
    ]
    assert counts == [(), (1,), (1,), (1,), (1,), (1,), ()]


@pytest.mark.parametrize("reason", ["hidden", "crashed", "obstacle"])
def test_a_track_on_an_uncounted_object_is_neither_good_nor_false(reason):
    kinds = ("obstacle" if reason == "obstacle" else "car", "car")
    scene = road([20, 40], kinds=kinds, crashed=[reason == "crashed", False])
    origin = seen(scene)._replace(expected=np.array([0.0 if reason == "hidden" else 9.0, 9.0]))
    evaluator = Evaluator("case")
    score = evaluator.step(0.0, scene, origin, tracks_at([21, 40], [3, 4]))
    assert score.pairs == {1: 3, 2: 4}
    assert score.counted == (2,)
    assert score.mean["gospa"] == pytest.approx(0.0, abs=1e-6)
    assert evaluator.summary()["rmse_position"] == 0.0
    assert evaluator.step(1.5, scene, origin, tracks_at([40], [4])).mean["missed"] == 0.0


def test_tracks_that_are_not_reported_do_not_exist():
    scene = road([20.0])
    score = step_once(scene, seen(scene), tracks_at([20, 70], [3, 4], existence=0.5))
    assert (score.mean["unassigned"], score.mean["ghosts"], score.pairs) == (1, 0, {})


@given(st.integers(0, 2**32 - 1))
def test_far_pairs_may_be_told_apart_by_their_centres(seed):
    rng = np.random.default_rng(seed)
    scene = boxes_scene(rng.uniform(-9, 9, (6, 3)), rng.uniform([3, 1.5], [16, 2.6], (6, 2)))
    belief = prior(rng.uniform(-9, 9, (5, 3)), size=rng.uniform([3, 1.5], [16, 2.6], (5, 2)))
    objects = scene.objects
    full = gwd(objects.pose[:, None], objects.size[:, None], belief.pose, belief.size)
    assert gospa(pair_distances(objects, belief)).total == pytest.approx(gospa(full).total)


@given(st.integers(0, 2**32 - 1))
def test_order_of_tracks_and_objects_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    x, at = rng.uniform(0, 60, 6), rng.uniform(0, 60, 5)
    rows, columns = rng.permutation(6), rng.permutation(5)
    scene, other = road(x), road(x[rows], ids=1 + rows)
    tracks = tracks_at(at, np.arange(5))
    score = step_once(scene, seen(scene), tracks)
    shuffled = step_once(other, seen(other), tracks.rows(columns))
    assert shuffled.pairs == score.pairs
    assert shuffled.mean == pytest.approx(score.mean, nan_ok=True)


# A run


def test_a_run_is_counted_by_hand():
    summary = run("..11.222").summary()
    expected = {"scans": 8, "switches": 1, "jumps": 0, "lost": 0, "never": 0, "birth_delay": 1.0, "pairs": 5}
    expected |= {"missed_percent": 37.5, "false_per_scan": 0.0, "objects_per_scan": 1.0, "tracks_per_scan": 5 / 8}
    expected |= {"objects_visible": 1, "objects_confirmed": 1, "tracks_reported": 2, "tracks_orphan": 0}
    expected |= {"missed": 12.5 * 3 / 8, "plain_view_gap": 1.0}
    assert {name: summary[name] for name in expected} == pytest.approx(expected)
    assert summary["gospa"] == pytest.approx(np.sqrt(12.5) * 3 / 8, abs=1e-6)
    assert summary["tracker"] == "case"


def test_a_lost_and_a_never_tracked_car_are_told_apart():
    assert [run("11...1").summary()[name] for name in ("lost", "never")] == [1, 0]
    assert [run("......").summary()[name] for name in ("lost", "never")] == [0, 1]
    assert np.isnan(run("......").summary()["birth_delay"])


def test_a_track_that_goes_over_to_another_car_jumps():
    evaluator, scene = Evaluator("case"), road([20, 40])
    for k, places in enumerate([[20, 40], [20, 40], [40, 20], [40, 20]]):
        evaluator.step(DT * k, scene, seen(scene), tracks_at(places, [1, 2]))
    assert [evaluator.summary()[name] for name in ("jumps", "switches")] == [2, 2]


def test_a_ghost_and_a_fragment_are_orphans_that_differ_by_their_place():
    truck = np.array([15.0, 2.5])
    evaluator, scene = Evaluator("case"), road([20.0], size=truck)
    for k in range(4):
        score = evaluator.step(DT * k, scene, seen(scene), tracks_at([20, 60], [1, 2]))  # 1: a car's size in the truck
        assert score.pairs == {}
        assert score.mean["ghosts"] == 2
    rows = {row["track"]: row for row in evaluator.orphan_rows()}
    assert {track: row["inside"] for track, row in rows.items()} == {1: 1.0, 2: 0.0}
    assert rows[2] == {
        "tracker": "case", "track": 2, "first": 0.0, "last": 1.5, "scans": 4, "duration": 1.5, "inside": 0.0,
        "real": pytest.approx(np.nan, nan_ok=True),
    }  # fmt: skip
    summary = evaluator.summary()
    assert [summary[name] for name in ("plain_view_gap", "uncovered_gap", "orphan_duration")] == [1.5, 0.0, 1.5]
    assert summary["tracks_orphan"] == 2


def test_a_track_that_lives_on_nothing_is_a_track_of_clutter():
    evaluator, scene = Evaluator("case"), road([20.0])
    clutter = seen(scene)._replace(object=np.array([0, 0, -1, -1, -1]), kind=np.full(5, CLUTTER))
    for k in range(3):
        evaluator.step(DT * k, scene, clutter, tracks_at([20, 60], [1, 2]), owner=np.array([1, 1, 1, 2, 2]))
    summary = evaluator.summary()
    assert [summary[name] for name in ("tracks_clutter", "tracks_ghost")] == [1, 0]
    assert [row["real"] for row in evaluator.orphan_rows()] == [0.0]


def test_tracks_of_ghosts_are_counted_apart_from_those_of_clutter():
    evaluator, scene = Evaluator("case"), road([20.0])
    kind = np.array([CONTOUR, MIRROR, MIRROR, DOUBLE, STATIC, CLUTTER, MIRROR])
    origin = seen(scene)._replace(object=np.array([0, *[-1] * 6]), kind=kind)
    for k in range(3):
        owner = np.array([1, -1, 2, 2, 2, 3, 3])  # track 3: as much clutter as ghost
        evaluator.step(DT * k, scene, origin, tracks_at([20, 60, 90], [1, 2, 3]), owner=owner)
    summary = evaluator.summary()
    assert [summary[name] for name in ("tracks_clutter", "tracks_ghost")] == [1, 1]


def test_a_track_that_drifts_to_a_hidden_object_has_not_jumped():
    evaluator, scene = Evaluator("case"), road([20.0, 40.0])
    for k, place in enumerate([20, 20, 40, 40]):
        evaluator.step(2 * k, scene, seen(scene)._replace(expected=np.array([9.0, 0.0])), tracks_at([place], [1]))
    assert evaluator.summary()["jumps"] == 0


@pytest.mark.parametrize(("expected", "visible", "gap"), [(9.0, 1.0, 2.5), (3.0, 1.0, 0.0), (9.0, 0.5, 0.0)])
def test_plain_view_needs_more_than_three_detections_and_half_the_outline(expected, visible, gap):
    evaluator = run("......", expected=[expected] * 6, visible=visible)
    assert {row["object"]: row["plain_view_gap"] for row in evaluator.object_rows()} == {1: gap}
    assert evaluator.summary()["plain_view_gap"] == gap


def test_phases_split_scans_and_events():
    rows = run("..11222.", phases=[("before", 0.0, 2.0), ("after", 2.0, 9.0), ("over", 9.0, 10.0)]).phase_rows()
    picked = [[row[name] for name in ("phase", "scans", "switches", "pairs", "objects_confirmed")] for row in rows]
    assert picked == [["before", 4, 0, 2, 1], ["after", 4, 1, 3, 1], ["over", 0, 0, 0, 0]]
    assert [row["missed_percent"] for row in rows[:2]] == [50.0, 25.0]
    assert rows[0]["birth_delay"] == 1.0
    unheld = run("..11", phases=[("before", 0.0, 1.0)]).phase_rows()[0]
    assert [unheld[name] for name in ("objects_visible", "objects_confirmed")] == [1, 0]
    assert np.isnan([rows[1]["birth_delay"], rows[2]["gospa"], rows[2]["missed_percent"]]).all()


def test_means_leave_out_the_time_to_settle_and_births_do_not():
    whole, later = (run("..11.1", phases=[("before", 0.0, 1.0), ("on", 1.0, 9.0)], settle=s) for s in (0.0, 1.0))
    first, second = whole.summary(), later.summary()
    assert [first[name] for name in ("scans", "missed_percent", "pairs")] == [6, 50.0, 3]
    assert [second[name] for name in ("scans", "missed_percent", "pairs")] == [4, 25.0, 3]
    assert first["gospa"] > second["gospa"] > 0
    for row in (first, second):
        assert [row[name] for name in ("birth_delay", "switches", "objects_visible")] == [1.0, 0, 1]
        assert row["unborn_percent"] == pytest.approx(100 * 2 / 6)  # the scan that is missed later is after its birth
    before, on = later.phase_rows()
    assert (before["scans"], on["scans"]) == (0, 4)
    assert np.isnan(before["gospa"])
    assert (before["birth_delay"], before["unborn_percent"], on["unborn_percent"]) == (1.0, 100.0, 0.0)


def test_each_object_has_a_row_of_its_own():
    evaluator = Evaluator("case")
    for k, (cars, places) in enumerate([([20, 40], [20.5]), ([20, 40], [20.5]), ([20], [20.5])]):
        scene = road(cars)
        evaluator.step(DT * k, scene, seen(scene), tracks_at(places, [5]))
    first, second = evaluator.object_rows()
    assert [first[name] for name in ("object", "scans_counted", "scans_missed", "pairs")] == [1, 3, 0, 3]
    assert first["rmse_position"] == pytest.approx(0.5)
    assert [second[name] for name in ("object", "scans_counted", "scans_missed", "pairs")] == [2, 2, 2, 0]
    assert np.isnan(second["gwd"])


def test_rmse_and_mean_absolute_sizes_are_taken_over_all_pairs():
    evaluator, scene = Evaluator("case"), road([20.0])
    for k, length in enumerate([4.6 + 3, 4.6 - 1]):
        evaluator.step(DT * k, scene, seen(scene), tracks_at([20], [1], size=[[length, 1.8]]))
    summary = evaluator.summary()
    assert [summary["rmse_length"], summary["abs_length"]] == pytest.approx([np.sqrt(5), 2.0])
    assert summary["nees_low"] < 2 < summary["nees_high"]


@pytest.mark.parametrize("places", [[], [20.0, 40.0]])
def test_on_an_empty_road_every_track_is_false(places):
    scene = road([])
    score = step_once(scene, seen(scene), tracks_at(places, np.arange(len(places))))
    assert score.mean["gospa"] == pytest.approx(np.sqrt(12.5 * len(places)))
    assert score.counted == ()


def test_an_estimate_that_is_not_a_number_is_refused():
    scene = road([20.0])
    with pytest.raises(ValueError, match="distance must be finite"):
        step_once(scene, seen(scene), tracks_at([np.nan], [1]))


def test_an_empty_run_has_a_summary():
    summary = Evaluator("case").summary()
    assert summary["scans"] == summary["switches"] == 0
    assert np.isnan(summary["gospa"])


def test_rows_become_strict_json():
    evaluator = run("...")
    text = json.dumps([jsonable(evaluator.summary()), *map(jsonable, evaluator.object_rows())], allow_nan=False)
    assert json.loads(text)[0]["birth_delay"] is None
    assert json.loads(text)[0]["missed_percent"] == 100.0


# Doors


def test_a_source_of_another_scene_is_refused():
    with pytest.raises(ValueError, match=r"origin\.expected must be"):
        step_once(road([20, 40]), seen(road([20])), tracks_at([], []))


def test_time_that_stands_still_is_refused():
    evaluator, scene = run("11"), road([20.0])
    with pytest.raises(ValueError, match="time must grow"):
        evaluator.step(DT, scene, seen(scene), tracks_at([], []))


def test_a_phase_that_ends_before_it_starts_is_refused():
    with pytest.raises(ValueError, match="phase 'cut' must end after"):
        Evaluator("case", [("cut", 3.0, 2.0)])


def test_scans_that_are_kept_end_in_the_tables_of_scans_that_are_scored():
    """More scans than wait together, contours that come, change their length and go, uncounted pairs, empty scans."""
    rng, judges = np.random.default_rng(2), [Evaluator("case", [("early", 0.0, 20.0)]) for _ in range(2)]
    for k in range(150):
        x = 10.0 + 15.0 * np.arange(k % 4)
        scene, belief = road(x), tracks_at(x + rng.normal(0, 0.4, len(x)), range(len(x)))
        belief = belief._replace(estimate=belief.estimate._replace(size=CAR + rng.uniform(0, 1, (len(x), 2))))
        corners = box_corners(belief.estimate.pose, belief.estimate.size)
        contour = None if k % 50 < 20 else corners if k % 50 < 35 else corners[:, :3]
        belief = belief._replace(estimate=belief.estimate._replace(contour=contour))
        origin = seen(scene, expected=9.0 if k % 7 else 0.0)
        arguments = DT * k, scene, origin, belief, np.array([0, 1, -1])[: len(origin.object)]
        judges[0].step(*arguments)
        (judges[1].step if k in (40, 41, 110) else judges[1].keep)(*arguments)  # the two may take turns
    scored, kept = ([j.summary(), j.phase_rows(), j.object_rows(), j.orphan_rows()] for j in judges)
    assert scored[0]["pairs"] > 100
    np.testing.assert_equal(kept, scored)


def test_nees_of_a_scan_is_over_the_tracks_with_a_covariance():
    scene = road([20.0, 40.0])
    tracks = tracks_at([21.0, 41.0], [1, 2], position_std=1.0)
    tracks.estimate.cov[1] = np.nan
    score = Evaluator("case").step(0.0, scene, seen(scene), tracks)
    assert score.mean["nees_position"] == pytest.approx(1.0)
    assert np.isnan(score.errors[2]["nees_position"])
    assert score.mean["position"] == pytest.approx(1.0)

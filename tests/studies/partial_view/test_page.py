"""Partial views: what the radar sees in each, errors against hand-made ones, what the offset of a frame changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sensors
from scenarios.contours import CONTOURS
from studies.partial_view.encounters import (
    STEP,
    BodyErrors,
    Encounter,
    EncounterRuns,
    Motion,
    circle,
    encounters,
    errors,
    follow,
    measure,
    over_runs,
    simulate,
    straight,
)
from studies.partial_view.figure import draw_learned, draw_tracked
from studies.partial_view.page import (
    COLUMNS,
    COURSES,
    KINDS,
    MEASURES,
    SIDES,
    Sided,
    Study,
    drawn_length,
    overall,
    overlap,
    panels,
    render,
    rows,
)
from studies.plus_minus import PlusMinus
from testbed.learn.detections import TrainingDetections
from trackers import find
from trackers.estimate import prior
from trackers.geometry import rotation, to_frame
from trackers.pmht.model import SplineModel
from trackers.pmht.model import find as find_model
from trackers.pmht.offline import LearnedContour

RADAR = sensors.find("surround")
BY_VIEW = {encounter.view: encounter for encounter in encounters()}


def first_frames(view, count):
    """The first frames of an encounter."""
    whole = BY_VIEW[view]
    vehicle, *egos = (Motion(*(leaf[:count] for leaf in motion)) for motion in (whole.vehicle, *whole.egos))
    return Encounter(view, vehicle, tuple(egos))


@pytest.mark.parametrize("motion", [straight((3.0, 1.0, 0.7), 12.0, 50), circle((5.0, -2.0), 8.0, 6.0, 50)])
def test_vehicles_move_as_their_velocities_say(motion):
    step = np.diff(motion.pose[:, :2], axis=0) / STEP
    middle = (motion.velocity[1:] + motion.velocity[:-1]) / 2
    np.testing.assert_allclose(step, middle, atol=0.01)
    np.testing.assert_allclose(np.diff(motion.pose[:, 2]) / STEP, motion.yaw_rate[1:], atol=1e-9)


def seen_ends(view, frames):
    """Bounds (2, 2) along and across of what is detected, in lengths and widths of the vehicle."""
    got = simulate(first_frames(view, frames), RADAR, "car", 3, np.random.default_rng(2))
    z = []
    for k, scan in enumerate(got.scans):
        pose = np.broadcast_to(got.vehicle.pose[k], (3, 3))
        z.append((to_frame(pose, scan.xy) / got.size[:, None])[scan.mask])
    return np.quantile(np.concatenate(z), [0.05, 0.95], axis=0)


def test_from_behind_no_front_is_seen_and_all_around_every_side_is():
    low, high = seen_ends("behind", 20)
    assert low[0] < -0.4
    assert high[0] < 0.2
    low, high = seen_ends("all around", 4)
    assert (low < -0.4).all()
    assert (high > 0.4).all()


def test_the_same_generator_gives_the_same_detections():
    a, b = (simulate(first_frames("behind", 3), RADAR, "truck", 2, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(a.scans[2].polar, b.scans[2].polar)
    np.testing.assert_array_equal(a.start.pose, b.start.pose)


@given(st.floats(-3, 3), st.floats(-2, 2), st.floats(-2, 2))
def test_errors_are_along_and_across_the_body(heading, along, across):
    vehicle = straight((4.0, -3.0, heading), 5.0, 1)
    body = CONTOURS["box"]
    pose = vehicle.pose[0] + np.concatenate([rotation(heading) @ [along, across], [0.0]])
    found = prior(pose[None], size=body.size + np.array([0.3, 0.0]), position_std=2.0)
    got = EncounterRuns(vehicle, body.size[None], body.points[None], (), found)
    e = BodyErrors(*(x[:, None] for x in errors(found, got, 0)))
    assert e.along[0, 0] == pytest.approx(along, abs=1e-9)
    assert e.across[0, 0] == pytest.approx(across, abs=1e-9)
    assert e.length[0, 0] == pytest.approx(0.3)
    assert e.nees[0, 0] == pytest.approx((along**2 + across**2) / 4.0)
    assert 0 <= e.iou[0, 0] <= 4.7 / 5.0 + 1e-9


def test_an_interval_of_few_runs_is_student_s():
    found = over_runs(np.array([1.0, 2.0, 3.0, 4.0]))
    assert found.value == 2.5
    assert found.half == pytest.approx(3.1824463 * np.sqrt(5 / 3) / 2)  # quantile of 3 degrees of freedom, by table
    assert found.text(2) == "2.50 ± 2.05"


def test_measures_take_the_root_of_mean_squares_and_leave_the_first_frames_out():
    late = np.array([[9.0, 3.0, -3.0], [9.0, 3.0, -3.0]])
    found = measure(BodyErrors(late, late, late, late, late), 1)
    assert found["length"].value == 0.0
    assert found["length rms"] == PlusMinus(3.0, 0.0)


def test_with_visibility_a_vehicle_seen_from_behind_keeps_its_place():
    """Equal weights take the rear for ellipses of all sides, and the centre falls back behind it."""
    got = simulate(first_frames("behind", 40), RADAR, "car", 4, np.random.default_rng(3))
    found = {v: measure(follow(find("pmht-spline", visibility=v), got), 20) for v in ("rays", "none")}
    assert abs(found["rays"]["along"].value) < 0.5 * abs(found["none"]["along"].value)
    assert found["rays"]["iou"].value > found["none"]["iou"].value


@given(st.integers(0, 2**32 - 1))
def test_positions_tell_neither_direction_of_the_offset_and_nothing_else_is_hidden(seed):
    """Places of ellipses as linear functions of centre and offset: rank 2 of 4, whatever part of them is seen."""
    rng = np.random.default_rng(seed)
    A = rotation(rng.uniform(-3, 3)) * (5.0, 2.0)
    seen = rng.integers(1, 24)
    J = np.concatenate([np.concatenate([np.eye(2), A], 1)] * seen)  # d (c + A (mu_l + o)) / d (c, o)
    assert np.linalg.matrix_rank(J) == 2
    o = rng.standard_normal(2)
    np.testing.assert_allclose(J @ np.concatenate([-A @ o, o]), 0.0, atol=1e-12)


def test_with_one_end_seen_centre_and_length_change_together_unseen():
    """The rear of a vehicle stays where it is when it grows by d and its centre moves ahead by d / 2."""
    d, rear = 0.4, np.array([-0.5, 0.1])
    before = rotation(0.3) @ (np.array([5.0, 2.0]) * rear)
    after = rotation(0.3) @ (np.array([d / 2, 0.0]) + np.array([5.0 + d, 2.0]) * rear)
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_every_choice_of_sides_is_of_the_aspects_it_says():
    aspect = np.array([0.0, 3.1, -1.0, 1.0])
    assert [chosen(aspect).tolist() for chosen in SIDES.values()] == [
        [True] * 4,
        [True, False, False, True],
        [True, False, False, False],
    ]
    detections = TrainingDetections(np.eye(4)[:, :2], aspect, None, np.arange(4), "made", None)
    part = rows(detections, np.array([2, 0]))
    np.testing.assert_array_equal(part.aspect, [-1.0, 0.0])
    assert part.noise is None


def made_study(model: SplineModel) -> Study:
    """A study with figures made up."""
    learned = LearnedContour(None, 0.1, np.zeros(1), np.ones(24))
    figures = dict.fromkeys(MEASURES, PlusMinus(-0.25, 0.05))
    sided = [Sided("rear only", v, model, learned, np.zeros((5, 2))) for v in ("rays", "none")]
    single = {(kind, view, v): figures for kind in KINDS for view in ("behind", "passing") for v in ("rays", "none")}
    whole = {(name, "pmht-spline"): [dict.fromkeys(COLUMNS, 1.25)] for name in COURSES}
    return Study(sided, single, whole, 2, 1, 60.0)


def test_the_page_and_its_figures_show_everything(tmp_path):
    model, body = find_model("surround-car"), CONTOURS["car"].points
    made = made_study(model)
    text = render(made)
    for word in (*KINDS, *COURSES, "behind", "rear only", "-0.25 ± 0.05"):
        assert word in text
    shown = overall(made.tracked)
    assert shown["rays"]["along"]["behind"] == pytest.approx((0.25, 0.05 / np.sqrt(3)))
    draw_tracked(shown, {"along": "bias"}, tmp_path / "a.png")
    draw_learned(panels(made.sided, body), body, tmp_path / "b.png")
    assert {p.name for p in tmp_path.iterdir()} == {"a.png", "b.png"}


def test_the_shipped_car_covers_the_outline_of_a_car():
    model = find_model("surround-car")
    assert overlap(model, CONTOURS["car"].points) > 0.85
    assert drawn_length(model) == pytest.approx(1.0, abs=0.1)

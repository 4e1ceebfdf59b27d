"""Size posteriors: deterministic cases, the laws of every filter they go with, statistics with a negative twin."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.check import laws
from tests.parameters import rest_slow
from tests.trackers.size.bodies import DT, NEAR, WHOLE, behind_rear, beside, rear_start, scan_of, seen, sized
from trackers import TRACKERS, Scan, SensorModel, find, prior
from trackers.batch import stack
from trackers.composed import composed
from trackers.geometry import perpendicular, rotation, to_frame, unit, wrap_angle
from trackers.size.evidence import evidence
from trackers.size.fleet import Fleet, VehicleClass
from trackers.size.hits import Boxes, hits_of
from trackers.size.posterior import SizePosterior

FILTERS = tuple(TRACKERS)
CAR, TRUCK = (4.6, 1.86), (12.0, 2.5)


def with_size(name):
    """An entry of the catalogue with a size posterior; with motion modes too where it has them."""
    return find(name, size="ends")


# -- cases --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("length", "width", "start", "within", "std"),
    [(9.0, 2.5, CAR, 0.6, 0.8), (4.4, 1.8, TRUCK, 0.3, 0.4), (2.2, 0.8, CAR, 0.3, 0.4), (12.2, 2.55, CAR, 1.0, 1.2)],
)
def test_detections_from_inside_give_the_length_of_a_body_seen_from_behind(length, width, start, within, std, seed):
    f, state = seen(lambda rng: behind_rear(rng, 6, length, width), 45, rear_start(start[0]), start, seed)
    e = f.estimate(state)
    assert abs(e.size[0] - length) < within
    assert e.size_std[0] < std
    assert abs(e.size[1] - width) < 0.15
    assert abs(e.pose[0] - e.size[0] / 2 - NEAR) < 0.3  # htg-map has its box 0.2 m nearer


@pytest.mark.parametrize("seed", range(3))
def test_the_near_end_of_a_bus_stays_in_its_place_with_the_filter_of_the_default_tracker(seed):
    filter = sized(find("pmht-spline"), fleet=WHOLE)
    f, state = seen(lambda rng: behind_rear(rng, 6, 12.2, 2.55), 45, rear_start(CAR[0]), CAR, seed, filter)
    e = f.estimate(state)
    assert abs(e.pose[0] - e.size[0] / 2 - NEAR) < 0.15


def edge_runs(runs=40):
    """Errors (R,) [m] of the rear of vehicles from behind, and the standard deviations (R, 4) of their edges."""

    def draw(rng):  # as the default profile has it
        depth = np.where(rng.random(3) < 0.2, rng.random(3) * 6.0, rng.normal(0.15, 0.105, 3))
        return np.stack([NEAR + depth, 2.0 * (rng.random(3) - 0.5)], -1) + rng.normal(0, 0.1, (3, 2))

    ends, stds, apart = [], [], []
    for seed in range(runs):
        f, state = seen(draw, 20, rear_start(4.6), CAR, 100 + seed)
        e = f.estimate(state)
        ends.append(e.pose[0] - e.size[0] / 2 - NEAR)
        stds.append(e.edges)
        apart.append(e._replace(edge_std=None).edges[1])
    return np.array(ends), np.array(stds), np.array(apart)


def test_the_end_that_was_hit_is_known_and_the_other_one_is_not():
    """NEES of the near end; as if centre and length were independent it is far below, the twin."""
    error, std, apart = edge_runs()
    assert 0.5 < np.mean((error / std[:, 1]) ** 2) < 3.0
    assert np.mean((error / apart) ** 2) < 0.15
    assert (std[:, 0] > 2 * std[:, 1]).all()


def test_the_edge_that_faces_the_sensor_is_the_one_by_the_anchor():
    """The same body turned round shows its front, and moved to the other side its right side."""
    f, state = seen(lambda rng: behind_rear(rng, 3, 6.0, 2.0), 20, (NEAR + 2.3, 0.0, np.pi), CAR)
    front, rear, *_ = f.estimate(state).edges
    assert front < rear / 2
    _, state = seen(lambda rng: beside(rng, 8, 4.5, 1.8), 10, (0.0, 11.0, 0.0), CAR)
    *_, left, right = f.estimate(state).edges
    assert right < left


def test_a_hidden_object_loses_its_near_edge_with_its_place():
    f, state = seen(lambda rng: behind_rear(rng, 3, 6.0, 2.0), 20, rear_start(4.6), CAR)
    after = f.estimate(f.predict(state, 4.0))
    assert after.edges[1] > 2 * f.estimate(state).edges[1]
    assert after.edges[1] > 0.7 * np.sqrt(after.cov[0, 0] - after.size_std[0] ** 2 / 4)


def test_ends_of_a_class_with_an_inset_lie_further_out_than_its_detections():
    plain, inset = (
        seen(lambda rng: behind_rear(rng, 6, 2.2, 0.8), 30, rear_start(2.2), (2.2, 0.8), filter=sized(fleet=fleet))
        for fleet in (Fleet(tuple(replace(c, inset=(0.0, 0.0)) for c in Fleet().classes)), Fleet())
    )
    one, other = plain[0].estimate(plain[1]), inset[0].estimate(inset[1])
    np.testing.assert_allclose(one.pose[0] - other.pose[0], 0.28, atol=0.02)
    np.testing.assert_array_equal(one.size, other.size)
    assert other.edges[1] ** 2 - one.edges[1] ** 2 > 0.1**2


@pytest.mark.parametrize(("turn", "side"), [(0.3, 2), (-0.3, 3)])
def test_the_front_of_a_vehicle_with_a_hinge_stands_out_to_the_side_to_which_it_turns(turn, side):
    """(ENDS.40), (ENDS.41) against a drawing; the other side stays where it was, and as well known."""
    hinged = SizePosterior(
        fleet=Fleet((VehicleClass("articulated", 1.0, (16.2, 1.1), (2.55, 0.04), hinge=(7.7, 4.5)),))
    )
    straight, bent = (
        hinged.estimate(hinged.born(()), prior((3.0, 1.0, 0.5), 5.5 * unit(0.5), rate, yaw_rate_std=0.0))
        for rate in (0.0, turn)
    )
    angle = np.arcsin(7.7 * 0.3 / 5.5)
    out = 4.5 * np.sin(angle) - straight.size[1] / 2 * (1 - np.cos(angle))
    assert bent.size[1] - straight.size[1] == pytest.approx(out)
    moved = (bent.pose - straight.pose)[:2]
    np.testing.assert_allclose(moved, np.sign(turn) * out / 2 * perpendicular(unit(0.5)), atol=1e-12)
    more = np.delete(bent.edges - straight.edges, side)
    np.testing.assert_allclose(more, 0.0, atol=1e-12)
    assert bent.edges[side] ** 2 - straight.edges[side] ** 2 == pytest.approx((out / 2) ** 2)
    assert bent.size_std[1] ** 2 - straight.size_std[1] ** 2 == pytest.approx((out / 2) ** 2)


@pytest.mark.parametrize(
    ("draw", "pose", "often"),
    [(beside, (0.0, 11.25, 0.0), (6.0, 1.0)), (behind_rear, (NEAR + 6.0, 0.0, 0.0), (1.0, 6.0))],
)
def test_detections_beside_an_end_count_more_often_for_the_offset_than_those_on_it(draw, pose, often):
    """(ENDS.39) with 36 detections, of which (ENDS.9) counts one in twelve, and of those not on an end one in two."""
    f, scan = sized().size, scan_of(draw(np.random.default_rng(0), 36, 12.0, 2.5))
    rows, box = np.zeros(36, int), Boxes(np.array([pose]), np.array([[12.0, 2.5]]), -np.ones((1, 2)))
    hits = hits_of(scan, (np.arange(36),), rows, box.pose, f.profiles, f.sigma)
    said = evidence(f.grids, hits, box, rows[:1], np.ones(1, bool), 0.04, 6, 0.3, f.offset_share, None)
    np.testing.assert_allclose(said.sharper, [often])


@pytest.mark.parametrize(("fov", "unseen"), [(28.0, 1.0), (90.0, 0.0)])
def test_the_near_end_is_out_of_view_where_the_field_of_view_ends_before_it(fov, unseen):
    f = replace(sized().size, sensors=(SensorModel(max_range=200.0, fov=np.radians(fov)),))
    scan = scan_of(np.stack([np.linspace(21.0, 26.5, 8), np.full(8, 5.1)], -1))  # the rear is at 15 m and 18 degrees
    rows, box = np.zeros(8, int), Boxes(np.array([[21.0, 6.25, 0.0]]), np.array([[12.0, 2.5]]), -np.ones((1, 2)))
    hits = hits_of(scan, (np.arange(8),), rows, box.pose, f.profiles, f.sigma)
    said = evidence(f.grids, hits, box, rows[:1], np.ones(1, bool), 0.04, 6, 0.3, f.offset_share, None)
    np.testing.assert_allclose(said.unseen, unseen)


@pytest.mark.parametrize("seed", range(3))
def test_a_side_in_full_view_gives_the_length(seed):
    f, state = seen(lambda rng: beside(rng, 8, 12.0, 2.5), 30, (0.0, 11.25, 0.0), TRUCK, seed)
    e = f.estimate(state)
    assert abs(e.size[0] - 12.0) < 0.5
    assert abs(e.pose[0]) < 0.4


def beyond_range(start, sensors, seed=0):
    """A body of 9 m, of which the sensors see the first 4 m."""
    draw = lambda rng: behind_rear(rng, 6, 9.0, 2.5, upto=NEAR + 4.0)  # noqa: E731
    f, state = seen(draw, 45, rear_start(start[0]), start, seed, sized(sensors=sensors, fleet=WHOLE))
    return f.estimate(state)


@pytest.mark.parametrize("start", [CAR, TRUCK])
def test_no_detection_beyond_the_range_of_the_sensor_says_nothing(start):
    near = SensorModel(max_range=NEAR + 4.0, fov=2 * np.pi)
    assert beyond_range(start, (near,)).size_std[0] > 2.0


def test_a_sensor_that_would_have_seen_more_says_that_the_body_is_short():
    far = SensorModel(max_range=100.0, fov=2 * np.pi)
    e = beyond_range(CAR, (far,))
    assert e.size[0] < 5.0
    assert e.size_std[0] < 1.0


def test_of_a_body_that_stands_few_detections_of_a_scan_count():
    """It shows the same places again; the same detections of a body that drives say more."""

    def length_std(speed, standing=6):
        f, rng = sized(fleet=WHOLE, standing=standing), np.random.default_rng(0)
        state = f.init(prior(rear_start(4.6), size=CAR, velocity=(speed, 0.0), velocity_std=0.01))
        for _ in range(15):
            state = f.update(state, scan_of(behind_rear(rng, 6, 4.6, 1.86)))[0]
        return f.estimate(state).size_std[0]

    few = SizePosterior().standing
    assert length_std(0.0, standing=few) > 1.2 * length_std(20.0, standing=few)
    assert length_std(0.0) == pytest.approx(length_std(20.0), rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_one_scan_leaves_the_length_open_and_the_centre_with_it(seed):
    f, state = seen(lambda rng: behind_rear(rng, 2, 9.0, 2.5), 1, rear_start(4.6), CAR, seed)
    e = f.estimate(state)
    assert e.size_std[0] > 2.0
    assert e.cov[0, 0] > (e.size_std[0] / 2) ** 2


@pytest.mark.parametrize(("length", "width"), [(2.2, 0.8), (4.4, 1.8), (9.0, 2.5), (16.0, 2.55)])
def test_twice_the_evidence_is_not_less_certain(length, width):
    f, state = seen(lambda rng: behind_rear(rng, 6, length, width), 15, rear_start(4.6), CAR)
    likelihoods = (np.exp(2 * (A - A.max())) for A in (state.size.length, state.size.width))
    twice = f.size.belief(*likelihoods, state.size.behind, state.size.bent)
    assert (twice.size_var <= state.size.belief.size_var).all()


def test_a_part_of_the_width_bounds_it_from_below_only():
    """The left half of a rear of 2.5 m."""

    def half(rng):
        xy = behind_rear(rng, 6, 9.0, 1.2)
        return xy + np.array([0.0, 0.6])

    def width(whole):
        f, rng = sized(fleet=WHOLE), np.random.default_rng(0)
        state = f.init(prior((NEAR + 4.5, 0.0, 0.0), size=(9.0, 2.5)))
        for _ in range(30):
            state = f.learn_where(f.predict(state, DT), np.asarray(whole))
            state = f.update(state, scan_of(half(rng)))[0]
        return f.estimate(state).size[1]

    assert width(True) < 1.6
    assert width(False) > 1.7


def test_the_first_scan_chooses_the_anchor_and_the_other_end_takes_over_when_the_sensor_has_passed():
    f = sized(fleet=WHOLE)
    state = f.init(prior((10.0, 5.0, 0.0), size=CAR))
    np.testing.assert_array_equal(state.size.anchor, 0.0)
    anchors = []
    for x in (10.0, 4.0, 1.0, -1.0, -4.0, -10.0):
        place = f.place.shift(state.place, np.array([x, 5.0]) - f.place.estimate(state.place).pose[:2])
        scan = Scan.from_xy([[x, 4.0], [x + 0.5, 4.1], [x - 0.5, 4.1]])
        state = f.update(state._replace(place=place), scan)[0]
        anchors.append(state.size.anchor.copy())
    np.testing.assert_array_equal(np.array(anchors)[:, 0], [-1, -1, -1, -1, 1, 1])
    np.testing.assert_array_equal(np.array(anchors)[:, 1], -1)


class PointState(NamedTuple):
    pose: np.ndarray
    size: np.ndarray


class Turning:
    """A filter that knows its place, finds in every update that front and rear are exchanged, and has no `resize`."""

    def init(self, estimate):
        return PointState(estimate.pose, estimate.size)

    def predict(self, state, dt):
        return state

    def update(self, state, scan):
        pose = state.pose.copy()
        pose[..., 2] = wrap_angle(pose[..., 2] + np.pi)
        return state._replace(pose=pose), None

    def estimate(self, state):
        return prior(state.pose, size=state.size)


def test_where_front_and_rear_are_exchanged_the_body_stays_and_its_ends_change_names():
    f = sized(Turning(), fleet=WHOLE)
    rng = np.random.default_rng(0)
    state = f.init(prior(rear_start(4.6), size=CAR))
    for k in range(20):
        state = f.update(state, scan_of(behind_rear(rng, 6, 9.0, 2.5)))[0]
        np.testing.assert_array_equal(state.size.anchor[0], 1.0 if k % 2 == 0 else -1.0)
    e = f.estimate(state)
    assert abs(e.size[0] - 9.0) < 1.0
    assert abs(e.pose[0] - e.size[0] / 2 - NEAR) < 0.3


def test_a_contour_is_scaled_with_the_size_and_moves_with_the_centre():
    f, state = seen(
        lambda rng: behind_rear(rng, 6, 9.0, 2.5), 20, rear_start(4.6), CAR, filter=sized(find("pmht-spline"))
    )
    inner, e = f.place.estimate(state.place), f.estimate(state)
    got = to_frame(e.pose, e.contour) / e.size
    np.testing.assert_allclose(got, to_frame(inner.pose, inner.contour) / inner.size, atol=1e-9)


def test_a_restart_takes_the_length_and_keeps_the_width():
    f, state = seen(lambda rng: behind_rear(rng, 6, 2.2, 0.8), 30, rear_start(2.2), (2.2, 0.8))
    union = f.estimate(state)._replace(size=np.array([14.0, 0.8]))
    e = f.estimate(f.restart(state, union))
    assert abs(e.size[1] - 0.8) < 0.15
    assert e.size[0] > 10.0


def test_a_restart_knows_a_length_as_well_as_it_is_told():
    f, state = seen(lambda rng: behind_rear(rng, 6, 2.2, 0.8), 5, rear_start(2.2), CAR)
    for std, used in ((0.3, 0.15 * 8.5), (3.0, 3.0)):
        whole = f.estimate(state)._replace(size=np.array([8.5, 1.8]), size_std=np.array([std, 0.1]))
        A = f.restart(state, whole).size.length.max(-1)
        np.testing.assert_allclose(A, -0.5 * ((f.size.length.sizes - 8.5) / used) ** 2, atol=1e-9)  # (ENDS.24)


def test_silence_takes_lengths_away_and_leaves_places():
    """Of a truck or an articulated one, the second is refuted; log probabilities are linear between the lengths."""
    f, state = seen(lambda rng: beside(rng, 6, 9.0, 2.5), 10, (0.0, 11.2, 0.0), TRUCK)
    silent = f.quiet(stack([state, state]), np.array([1]), np.array([[6.0, 12.0]]), np.array([[0.0, -60.0]]))
    added = silent.size.length[1] - state.size.length
    np.testing.assert_allclose(added, np.interp(f.size.length.sizes, [6.0, 12.0], [0.0, -60.0])[:, None] + 0 * added)
    np.testing.assert_array_equal(silent.size.length[0], state.size.length)
    np.testing.assert_array_equal(silent.size.width[1], state.size.width)


def test_probabilities_of_the_fleet_are_the_classes():
    f, state = seen(lambda rng: behind_rear(rng, 6, 2.2, 0.8), 30, rear_start(4.6), CAR)
    p = f.estimate(state).class_probability
    assert f.classes == Fleet().names
    assert p.shape == (6,)
    assert p[f.classes.index("motorcycle")] > 0.99


# -- laws -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("lead", [(), (1,), (3, 2)])
def test_a_batch_equals_the_loop(name, lead):
    laws.a_batch_equals_the_loop(with_size(name), lead=lead)


@pytest.mark.parametrize("name", ["htg-map", "edra-imm", "pmht-spline"])
@given(seed=st.integers(0, 2**32 - 1))
def test_order_and_padding_do_not_matter(name, seed):
    laws.order_and_padding_do_not_matter(with_size(name), seed)


@pytest.mark.parametrize("name", ["htg-map", "edra-imm", "pmht-spline"])
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-3, 3))
def test_turning_the_world_turns_the_answer(name, seed, turn):
    laws.turning_the_world_turns_the_answer(with_size(name), seed, turn)


@pytest.mark.parametrize("name", FILTERS)
def test_without_a_detection_the_prediction_stands(name):
    laws.without_a_detection_the_prediction_stands(with_size(name))


@pytest.mark.parametrize("name", FILTERS)
def test_covariances_stay_positive_and_everything_finite(name):
    f = with_size(name)
    state = laws.covariances_stay_symmetric_and_positive(f, 11, 1e-4, (5,), steps=8)
    assert (f.estimate(state).size_std > 0).all()


@pytest.mark.parametrize("name", rest_slow(FILTERS, "rm-feldmann", "htg-map", "edra-imm", "pmht-spline"))
def test_all_detections_at_one_point_leave_a_finite_state(name):
    laws.all_detections_at_one_point_leave_a_finite_state(with_size(name))


@pytest.mark.parametrize(
    "law",
    [
        laws.states_have_leading_axes,
        laws.there_may_be_no_object,
        laws.a_zero_time_step_changes_nothing,
        laws.missing_range_rates_do_no_harm,
        laws.arguments_are_left_as_they_were,
        laws.a_filter_remembers_nothing,
        laws.states_can_be_chosen_and_stacked,
    ],
)
def test_the_other_laws_of_a_filter_hold(law):
    law(sized(fleet=WHOLE))


# -- density ----------------------------------------------------------------------------------------------------------


def test_the_density_of_detections_has_mass_one():
    f, state = seen(lambda rng: behind_rear(rng, 6, 9.0, 2.5), 20, rear_start(4.6), CAR)
    x, y = np.meshgrid(np.linspace(20, 60, 401), np.linspace(-5, 5, 101), indexing="ij")
    step = 0.1 * 0.1
    xy = np.stack([x.ravel(), y.ravel()], -1)
    states = stack([state])
    scan = Scan.from_xy(xy, noise=(0.1, 0.004, np.nan))
    scan = scan._replace(pose=np.broadcast_to(scan.pose, (len(xy), 3)))
    log_p = f.log_spatial(states, scan, np.zeros(len(xy), int), np.arange(len(xy)))
    assert np.exp(log_p).sum() * step == pytest.approx(1.0, abs=0.03)


def test_a_far_detection_of_a_long_vehicle_is_claimed_before_its_length_is_known():
    f, state = seen(lambda rng: behind_rear(rng, 3, 9.0, 2.5), 3, rear_start(4.6), CAR)
    states, zero = stack([state]), np.zeros(1, int)
    far = Scan.from_xy([[NEAR + 8.0, 0.3]], noise=(0.1, 0.004, np.nan))
    ours = f.log_spatial(states, far, zero, zero)
    inner = f.place.log_spatial(states.place, far, zero, zero)
    assert ours > inner + 1.5


def test_gates_reach_as_far_as_the_body_may():
    f, state = seen(lambda rng: behind_rear(rng, 3, 9.0, 2.5), 3, rear_start(4.6), CAR)
    e, gate = f.estimate(state), f.reach(state)
    assert gate.size[0] > e.size[0] + 2 * e.size_std[0]
    assert gate.pose[0] - gate.size[0] / 2 == pytest.approx(e.pose[0] - e.size[0] / 2, abs=0.1)
    assert state.size.belief.length[f.size.length.sizes > gate.size[0]].sum() <= f.size.impossible


# -- consistency ------------------------------------------------------------------------------------------------------


def length_nees(f, runs=60, scans=30, seed=3):
    """Squared length errors over their variances for vehicles of the fleet seen from behind, all in one batch."""
    rng = np.random.default_rng(seed)
    fleet = Fleet()
    kinds = rng.choice(len(fleet.classes), runs, p=fleet.shares)
    lengths = np.array([rng.normal(*fleet.classes[k].length) for k in kinds])
    widths = np.array([rng.normal(*fleet.classes[k].width) for k in kinds])
    state = f.init(prior(np.tile(rear_start(4.6), (runs, 1)), size=CAR))
    for _ in range(scans):
        xy = np.stack([behind_rear(rng, 6, max(a, 1.8), b) for a, b in zip(lengths, widths, strict=True)])
        state = f.update(f.predict(state, DT), Scan.from_xy(xy, noise=(0.1, 0.004, np.nan)))[0]
    e = f.estimate(state)
    return ((e.size[:, 0] - lengths) / e.size_std[:, 0]) ** 2


def test_length_errors_are_as_large_as_they_are_said_to_be():
    assert 0.3 < length_nees(sized(fleet=WHOLE)).mean() < 1.5


def test_a_filter_that_expects_no_detections_from_inside_is_caught():
    few = SensorModel(max_range=200.0, fov=2 * np.pi)
    few = replace(few, profile=replace(few.profile, inside=0.9, depth=1.5, depth_std=1.0, weight=1.0))
    assert length_nees(sized(sensors=(few,), fleet=WHOLE, independent=100)).mean() > 3.0


def test_the_noise_along_an_axis_is_that_of_range_and_azimuth_and_surface():
    scan = Scan.from_xy([[30.0, 40.0]], noise=(0.2, 0.01, np.nan))
    sensors = sized(fleet=WHOLE).size.profiles
    hits = hits_of(scan, (np.array([0]),), np.array([0]), np.array([[29.0, 40.0, 0.0]]), sensors, 0.2)
    expected = np.sqrt([(0.2 * 0.6) ** 2 + (0.5 * 0.8) ** 2 + 0.01, (0.2 * 0.8) ** 2 + (0.5 * 0.6) ** 2 + 0.01])
    np.testing.assert_allclose(hits.sigma[0], expected, rtol=1e-9)
    np.testing.assert_allclose(hits.xy[0], [1.0, 0.0], atol=1e-9)


# Covariance of the place


def variances(estimate, axes):
    """Of the place along and across the heading, and its correlation with the velocity."""
    M = np.kron(np.eye(2), axes)
    P = M.T @ estimate.cov @ M
    return P[0, 0], P[1, 1], P[:2, 2:] / np.sqrt(np.outer(P.diagonal()[:2], P.diagonal()[2:]))


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_what_place_and_sizes_both_do_not_know_counts_once(heading):
    """(ENDS.20) by hand, where the place is known less well than offsets and outlines allow for, and better."""
    axes = rotation(np.array(heading))
    f, state = seen(lambda rng: behind_rear(rng, 6, 4.5, 1.8), 20, (NEAR + 2.25, 0.0, 0.0), (4.4, 1.8))
    b, size = state.size.belief, replace(f.size, once=True)
    known = np.array([0.2, 0.15]) ** 2 + (2.5 * size.pin_std(f.box(state).size)) ** 2
    rest = b.centre_var + size.centre_std**2
    for place in (np.array([0.5, 0.4]), np.array([0.1, 0.05])):
        inner = np.diag([*place**2, 0.3**2, 0.2**2])
        inner[0, 2] = inner[2, 0] = 0.5 * place[0] * 0.3
        turn = np.kron(np.eye(2), axes)
        box = f.box(state)
        box = box._replace(pose=np.array([*box.pose[:2], heading]), cov=turn @ inner @ turn.T)
        along, across, correlation = variances(size.estimate(state.size, box), axes)
        excess = np.maximum(place**2 - known, 0.0)
        more = b.kind @ size.prior.insets[:, 1] - (b.kind @ size.prior.insets[:, 0]) ** 2
        np.testing.assert_allclose([along, across], excess + rest + [more, 0.0], rtol=0.02)
        assert correlation[0, 0] == pytest.approx(0.5 * np.sqrt(excess[0] / along), abs=0.01)


def test_counted_twice_a_place_that_allows_for_outlines_is_further_from_honest():
    """Mean NEES along and across of 60 cars that were seen from behind for 2 s; 2 is honest."""
    nees = {True: [], False: []}
    for seed in range(60):
        f = composed(find("pmht-spline"), size="ends")
        assert f.size.once
        f, state = seen(
            lambda rng: behind_rear(rng, 6, 4.5, 1.8), 30, (NEAR + 2.25, 0.0, 0.0), (4.4, 1.8), seed=seed, filter=f
        )
        for once, found in nees.items():
            e = replace(f.size, once=once).estimate(state.size, f.box(state))
            error = e.pose[:2] - [NEAR + 2.25, 0.0]
            found.append(error @ np.linalg.solve(e.cov[:2, :2], error))
    assert np.mean(nees[False]) < 0.6 * np.mean(nees[True]) < 1.2


def test_a_place_that_allows_for_nothing_counts_in_full():
    f, state = seen(lambda rng: behind_rear(rng, 6, 4.5, 1.8), 5, (NEAR + 2.25, 0.0, 0.0), (4.4, 1.8))
    assert not f.size.once
    e, box, b = f.estimate(state), f.box(state), state.size.belief
    out = b.kind @ f.size.prior.insets[:, 1] - (b.kind @ f.size.prior.insets[:, 0]) ** 2
    M = rotation(box.pose[2])
    got = (M.T @ (e.cov - box.cov)[:2, :2] @ M).diagonal()
    np.testing.assert_allclose(got, b.centre_var + np.array([out, 0.0]), rtol=0.1)

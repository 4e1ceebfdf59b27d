"""The four filters of the family: reference vectors, limits, gradients, several sensors, closed tracks."""

from dataclasses import replace

import numpy as np
import pytest

from studies.papers.xia2020.calibration import single
from studies.papers.xia2020.generators import sample
from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import MultiObjectTracker, RandomMatrix, Scan, prior
from trackers.geometry import extent_matrix, to_world
from trackers.htg.bins import HTGTable, by_length, metric_ends
from trackers.htg.density import HTG, log_density, moments
from trackers.htg.learned import HTGLearned, HTGMoment
from trackers.htg.map import HTGMap, MotionSizeState
from trackers.htg.objective import Objective, flatten, shape_of
from trackers.htg.online import HTGOnline, OnlineState
from trackers.random_matrix.feldmann import RMState

PUBLISHED = HTG(np.array(0.183), np.array([0.675, 0.670, 0.611, 0.648]), np.array(0.763), np.array([0.037, 0.035]))
TABLE = single(PUBLISHED, *moments(PUBLISHED))
DETECTIONS = [(1.8, 1.0), (-1.5, -0.9), (2.2, 0.2), (-0.3, 1.1), (0.6, -0.6)]
M5 = np.array([0.0, 0.0, 0.3, 10.0, 0.1])


def card_covariance():
    P = np.diag([0.25, 0.25, 0.01, 1.0, 0.01])
    P[0, 3] = P[3, 0] = 0.1
    P[1, 2] = P[2, 1] = 0.02
    return P


def reference_state():
    """The prior of the reference vectors, which come from an independent implementation."""
    return RMState(M5, card_covariance(), np.array(26.0), 20 * extent_matrix(0.3, np.array([4.6, 1.9])))


def reference_map_state():
    P = np.diag([1.0] * 5 + [0.01, 0.01])
    P[:5, :5] = card_covariance()
    return MotionSizeState(np.concatenate([M5, np.log([4.6, 1.9])]), P)


def rear_table():
    """Two closed bins a side by hand: what lies near the end or the side that faces the sensor."""
    B = 8
    aspect = -np.pi + np.arange(B) * 2 * np.pi / B
    near = np.stack([-np.cos(aspect), np.sin(aspect)], -1)  # towards the sensor, in the frame of the body
    faces = np.maximum(np.stack([-near, near], 1).reshape(B, 4), 0) > 0.3  # a1, a2, b1, b2
    p = HTG(np.full(B, 0.2), np.where(faces, 0.75, np.inf), np.zeros(B), np.full((B, 2), 0.02))
    return HTGTable(p, *moments(p))


def test_in_two_classes_each_object_is_updated_with_the_table_of_its_length():
    car, truck = rear_table(), rear_table()
    truck = replace(truck, p=truck.p._replace(rho=np.full(8, 0.3)), size=(12.0, 2.5))
    both = HTGMap(by_length(metric_ends(car), truck, 6.5), metric=False)
    one = prior((20.0, 0.0, 0.0), velocity=(10.0, 0.0), size=(4.6, 1.9))
    other = one._replace(size=np.array([12.0, 2.5]))
    scan = Scan.from_xy([(17.8, 0.3), (18.1, -0.6), (19.0, 0.8)], pose=(0.0, 0.0, 0.0))
    for e, table in ((one, metric_ends(car)), (other, truck)):
        a, b = (f.update(f.init(e), scan)[0] for f in (both, HTGMap(table, metric=False)))
        np.testing.assert_allclose(a.m, b.m, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(a.P, b.P, rtol=1e-12, atol=1e-12)


def test_an_outline_off_the_learned_one_blurs_the_centre_in_body_axes_and_nothing_else():
    sure, blurred = HTGMap(rear_table()), HTGMap(rear_table(), shape_std=(0.1, 0.2))
    state = sure.init(prior((20.0, 5.0, np.pi / 2), velocity=(0.0, 10.0), size=(5.0, 2.0)))
    a, b = sure.estimate(state), blurred.estimate(state)
    np.testing.assert_allclose((b.cov - a.cov)[:2, :2], np.diag([0.4**2, 0.5**2]), atol=1e-12)
    np.testing.assert_array_equal((b.cov - a.cov)[2:], 0)
    scan = Scan.from_xy([(19.5, 3.0), (20.4, 2.8)], pose=(20.0, -20.0, 1.5))
    for x, y in zip(sure.update(state, scan)[0], blurred.update(state, scan)[0], strict=True):
        np.testing.assert_array_equal(x, y)
    pair = np.array([0, 0]), np.array([0, 1])
    lone = MotionSizeState(state.m[None], state.P[None])
    np.testing.assert_array_equal(sure.log_spatial(lone, scan, *pair), blurred.log_spatial(lone, scan, *pair))


def test_literal_learned_update_gives_the_reference_vector():
    state, _ = HTGLearned(TABLE).update(reference_state(), Scan.from_xy(DETECTIONS))
    np.testing.assert_allclose(state.m, [0.2510349620, 0.0389281627, 0.3031142530, 10.1004139848, 0.1], atol=1e-9)
    np.testing.assert_allclose(state.nu, 46.7539193054, rtol=1e-10)
    np.testing.assert_allclose(state.V[[0, 0, 1], [0, 1, 1]], [191.4555919, 49.0260861, 54.0871263], rtol=1e-8)
    # P[3, 3] is .9669466552 in the reference: two digits off its own equations, 1 - .1^2 / S_xx = .9667466555, as the
    # same entry of its random-matrix vector; test_random_matrix holds those equations against a loop.
    diagonal = [0.0421665967, 0.0124746038, 0.0084798375, 0.9667466555, 0.01]
    np.testing.assert_allclose(np.diag(state.P), diagonal, atol=1e-9)


def test_map_update_converges_to_the_reference_vector():
    f = HTGMap(TABLE, sigma=0.0, metric=False, two_starts=False, rounds=80, flat=0.0)
    state, info = f.update(reference_map_state(), Scan.from_xy(DETECTIONS))
    expected = [0.1034283, 0.1287233, 0.2908956, 10.0413713, 0.1, 1.5335525, 0.6466472]
    np.testing.assert_allclose(state.m, expected, atol=1e-6)
    diagonal = [0.08345, 0.02666, 0.00581, 0.97335, 0.01, 0.00793, 0.00796]
    np.testing.assert_allclose(np.diag(state.P), diagonal, rtol=0.02)
    assert info.n == 5


def test_map_update_stops_near_enough_to_its_end():
    """With its own number of rounds the state is within a twentieth of a standard deviation of the maximum."""
    scan = Scan.from_xy(DETECTIONS)
    end, _ = HTGMap(TABLE, sigma=0.0, metric=False, rounds=80, flat=0.0).update(reference_map_state(), scan)
    soon, _ = HTGMap(TABLE, sigma=0.0, metric=False).update(reference_map_state(), scan)
    assert (np.abs(soon.m - end.m) < 0.05 * np.sqrt(np.diag(end.P))).all()


def framed_table():
    """A turned density with anchors, scales and shifts in every bin."""
    rng, table = np.random.default_rng(2), rear_table()
    p = table.p._replace(theta=rng.uniform(-0.3, 0.3, 8))
    return replace(
        table,
        p=p,
        anchor=rng.uniform(-1, 1, (8, 2)),
        scale=rng.uniform(0.8, 1.2, (8, 2)),
        shift=rng.uniform(-0.2, 0.2, (8, 2)),
    )


def two_sensors(table, seed=0):
    """Objective of two objects, each seen by two sensors with range rates, some of them missing."""
    rng = np.random.default_rng(seed)
    m = reference_map_state().m + np.array([[0.0] * 7, [9, 4, 1, 2, 0, 0.2, 0.1]])
    mask = rng.random((2, 6)) < 0.8
    pose = np.where(np.arange(6)[:, None] < 3, [-30.0, 2.0, 0.0], [5.0, -20.0, 1.0])
    xy = m[:, None, :2] + rng.normal(0, 1, (2, 6, 2))
    polar = Scan.from_xy(xy, mask, pose=pose).polar
    polar[..., 2] = np.where(rng.random((2, 6)) < 0.3, np.nan, rng.normal(0, 8, (2, 6)))
    scan = Scan(polar, mask, pose, np.zeros((1, 2)), np.array([[0.1, 0.01, 0.1]]))
    _, points = flatten(scan, 0.2)
    precision = np.linalg.inv(np.stack([reference_map_state().P] * 2))
    return Objective(points, shape_of(table, m, points), m, precision, 0.5, 1.5)


@pytest.mark.parametrize(
    "table", [rear_table(), metric_ends(rear_table()), framed_table()], ids=["plain", "metric", "framed"]
)
def test_gradient_is_the_slope_of_the_log_posterior(table):
    objective = two_sensors(table)
    xi = objective.mean + np.array([0.1, -0.2, 0.05, 0.3, 0.02, 0.1, -0.1])
    value, gradient = objective.evaluate(xi[None])
    for i, e in enumerate(1e-6 * np.eye(7)):
        up, down = (objective.evaluate((xi + d)[None])[0] for d in (e, -e))
        np.testing.assert_allclose(gradient[0, :, i], (up - down)[0] / 2e-6, rtol=1e-4, atol=1e-4)
    assert value.shape == (1, 2)


@pytest.mark.parametrize("table", [rear_table(), framed_table()], ids=["plain", "framed"])
def test_information_is_the_mean_square_of_the_scores(table):
    """Against scores of samples from the density itself, in every state that a place depends on."""
    rng, n = np.random.default_rng(1), 20_000
    m = reference_map_state().m
    where = np.array([-30.0, 2.0, 0.0])
    probe = flatten(Scan.from_xy([[0.0, 0.0]], pose=where, noise=(1e-6, 1e-9, 1.0)), 0.0)[1]
    index = shape_of(table, m[None], probe).bin[0]
    h, shift = table.warp(0.5 * np.exp(m[5:]), index)
    u = sample(table.of(index), n, rng)
    z = to_world(m[:3], shift + h * u)
    # every sample is the only detection of an object of its own
    scan = Scan.from_xy(z[:, None], pose=where, noise=(1e-6, 1e-9, 1.0))
    _, points = flatten(scan, 0.0)
    many, precision = np.tile(m, (n, 1)), np.tile(np.eye(7), (n, 1, 1))
    objective = Objective(points, shape_of(table, many, points), many, precision, 0.5, 1.5)
    s = points.total(objective.places(objective.spread(many[None])))[1:, 0].T
    from trackers.htg.objective import score_moments

    J = objective.spatial_information(table, np.tile(score_moments(table.of(index)), (n, 1, 1)))[0]
    square = s[:, :, None] * s[:, None]
    assert (np.abs(square.mean(0) - J) < 6 * square.std(0) / np.sqrt(n) + 1e-9).all()


def test_from_behind_the_length_is_not_observed():
    """With a metric rear a short car near and a long car far are the same: length and place stay as correlated."""
    f = HTGMap(rear_table())
    rng = np.random.default_rng(3)
    start = prior((30.0, 0.0, 0.0), velocity=(10.0, 0.0), size=(6.0, 1.9), size_std=(0.6, 0.1))
    metric, plain = f.init(start), f.init(start)
    g = replace(f, metric=False)
    for _ in range(30):
        body = np.stack([-3.0 + rng.exponential(0.25, 12), rng.uniform(-0.9, 0.9, 12)], -1) + rng.normal(
            0, 0.1, (12, 2)
        )
        scan = Scan.from_xy(to_world(np.array([30.0, 0, 0]), body), noise=(0.1, 0.003, 0.1))
        metric, plain = f.update(metric, scan)[0], g.update(plain, scan)[0]
    assert f.estimate(metric).size_std[0] > 0.48
    assert abs(f.estimate(metric).size[0] - 6.0) < 0.2
    assert g.estimate(plain).size_std[0] < 0.4  # the unit coordinates of the paper believe to have measured it
    rear = f.estimate(metric).pose[0] - f.estimate(metric).size[0] / 2
    assert abs(rear - 27.0) < 0.25


def test_hole_without_content_is_the_plain_random_matrix():
    """A hole of width zero cuts nothing out: htg-rm-learned is the random matrix with that rho and noise."""
    p = HTG(np.array(0.3), np.zeros(4), np.array(0.0), np.full(2, 1e-12))
    f = HTGLearned(single(p, *moments(p)), sigma=0.2, iterations=3)
    got, _ = f.update(reference_state(), Scan.from_xy(DETECTIONS))
    expected, _ = RandomMatrix(rho=0.3, sigma=0.2).update(reference_state(), Scan.from_xy(DETECTIONS))
    for a, b in zip(got, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-8)


def test_online_with_all_sides_open_keeps_the_random_matrix():
    """A bound of 0 on all sides is no hole: detections in the middle make the random matrix with the same rho."""
    xy = 0.1 * np.array(DETECTIONS)
    f = HTGOnline(RandomMatrix(rho=0.25), iterations=3, full_view=True, n_count=False)
    got, _ = f.update(OnlineState(reference_state(), np.zeros(4)), Scan.from_xy(xy))
    assert (got.bounds == 0).all()
    expected, _ = RandomMatrix(rho=0.25).update(reference_state(), Scan.from_xy(xy))
    for a, b in zip(got.rm, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-8)


def test_the_repair_counts_detections_once():
    for f in (HTGLearned(TABLE), HTGOnline()):
        state = f.init(prior((0.0, 0.0, 0.3), velocity=(9.5, 2.9)))
        nu = lambda s: getattr(s, "rm", s).nu  # noqa: E731
        repaired, _ = replace(f, n_count=True).update(state, Scan.from_xy(DETECTIONS))
        literal, _ = replace(f, n_count=False).update(state, Scan.from_xy(DETECTIONS))
        np.testing.assert_allclose(nu(repaired), nu(state) + 5, rtol=1e-12)
        assert nu(literal) > nu(state) + 8


def test_moment_matching_knows_that_the_mean_of_a_rear_is_not_the_centre():
    table = rear_table()
    rng = np.random.default_rng(0)
    pose, size = np.array([30.0, 0.0, 0.0]), np.array([4.6, 1.9])
    u = sample(table.of(table.bin_of(0.0)), 200, rng)
    xy = to_world(pose, u * size / 2)
    for f, least, most in ((HTGMoment(table), 0.0, 0.2), (RandomMatrix(), 0.9, 3.0)):
        state = f.init(prior((30.0, 0.0, 0.0), size=size, position_std=2.0))
        state, _ = f.update(state, Scan.from_xy(xy))
        assert least <= abs(f.estimate(state).pose[0] - 30.0) <= most


FILTERS = {
    "htg-rm": HTGOnline(),
    "htg-rm-learned": HTGLearned(rear_table(), iterations=20, n_count=True),
    "htg-mm": HTGMoment(rear_table()),
    "htg-map": HTGMap(rear_table(), alpha=0.15),
}


@pytest.mark.parametrize("name", FILTERS)
def test_spatial_density_integrates_to_one(name):
    f = FILTERS[name]
    state = f.init(prior(np.array([[30.0, 4.0, 0.4]]), size=(4.6, 1.9)))
    g = np.linspace(-8, 8, 161)
    xy = np.array([30.0, 4.0]) + np.stack(np.meshgrid(g, g), -1).reshape(-1, 2)
    scan = Scan.from_xy(xy, noise=(0.1, 1e-9, 0.1))
    log_p = f.log_spatial(state, scan, np.zeros(len(xy), int), np.arange(len(xy)))
    np.testing.assert_allclose(np.exp(log_p).sum() * (g[1] - g[0]) ** 2, 1, atol=0.01)


def test_spatial_density_is_the_log_density_over_the_box():
    """For a known centre and a noiseless sensor: p(u) / (l w / 4)."""
    f = HTGMap(TABLE, metric=False)
    state = f.init(prior(np.zeros((1, 3)), size=(4.0, 2.0), position_std=1e-6))
    scan = Scan.from_xy([(1.0, 0.5)], pose=(-20.0, 0, 0), noise=(1e-9, 1e-9, 1.0))
    got = f.log_spatial(state, scan, np.array([0]), np.array([0]))
    np.testing.assert_allclose(got, log_density(np.array([0.5, 0.5]), PUBLISHED) - np.log(2.0), atol=1e-6)


@pytest.mark.parametrize("name", FILTERS)
def test_resizing_changes_the_size_and_nothing_else(name):
    f = FILTERS[name]
    start = f.init(prior(np.array([[0.0, 0, 0.2], [5, 5, 1]]), velocity=(3.0, 1.0)))
    size, std = np.array([[9.0, 2.4], [4.0, 1.7]]), np.array([[0.9, 0.24], [0.4, 0.17]])
    before, after = f.estimate(start), f.estimate(f.resize(start, size, std))
    np.testing.assert_allclose(after.size, size, rtol=1e-9)
    np.testing.assert_allclose(after.size_std, std, rtol=1e-9)
    np.testing.assert_allclose(after.pose, before.pose, atol=1e-12)
    np.testing.assert_allclose(after.cov, before.cov, atol=1e-12)


@pytest.mark.parametrize("name", FILTERS)
def test_many_cars_are_held_by_each_filter(name):
    """Three cars ahead for two seconds: three tracks, no false one, places within a metre."""
    tracker = MultiObjectTracker(FILTERS[name], (RADAR,))
    road = Road([(30, 0, 0, 25), (45, 3.6, 0, 27), (60, -3.6, 0, 24)])
    tracks, _ = drive(tracker, road, 2.0)
    e = tracks.reported.estimate
    assert len(e.pose) == 3
    d = np.hypot(*(e.pose[:, None, :2] - road.cars[:, :2]).transpose(2, 0, 1)).min(0)
    assert (d < (1.0 if name == "htg-map" else 2.0)).all()
    assert (np.abs(e.velocity[:, 1]) < (2.5 if name == "htg-mm" else 1.0)).all()  # its boxes narrow, and turn


def test_a_range_rate_beyond_the_clip_pulls_no_harder():
    """One false range rate of 40 m/s moves the speed no more than one of 4 m/s."""
    f = HTGMap(rear_table())
    state = f.init(prior((30.0, 0.0, 0.0), velocity=(20.0, 0.0)))
    scan = Scan.from_xy([(28.0, 0.1), (28.1, -0.4), (27.9, 0.5)], noise=(0.1, 0.01, 0.1))

    def speed(rate):
        polar = scan.polar.copy()
        polar[:, 2] = (20.0, 20.0, rate)
        return f.update(state, scan._replace(polar=polar))[0].m[3]

    assert abs(speed(24.0) - 20) > 0.05
    np.testing.assert_allclose(speed(60.0), speed(24.0), atol=1e-3)

"""The virtual measurement model: ray geometry, adaptation, and static cases."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from studies.papers.hoher2022.rules import Bayes, Lms
from tests.trackers.random_matrix.contour_cases import CAR, ORIGIN, adapted, box_case, follow, static_case
from trackers import Scan, prior
from trackers.geometry import box_corners, unit, wrap_angle
from trackers.random_matrix.adaptation import GaussNewton, Variances, descend
from trackers.random_matrix.rays import box_hits, box_sector, near_hits, outline, root_of, sector_fan, tangent_sector
from trackers.random_matrix.virtual_measurements import VirtualMeasurements, main_sensor

TRUE, KNOWN = np.array(True), Variances(np.ones(4), np.ones(4))


def hits(bearing, sensor=ORIGIN, centre=ORIGIN, size=CAR, tilt=0.0):
    return near_hits(
        sensor, np.atleast_1d(bearing), np.asarray(centre, float), root_of(np.asarray(size), np.array(tilt))
    )


def test_a_ray_meets_an_ellipse_nowhere_once_or_twice():
    """Circle of radius 1 at (3, 0): past it, tangent at 30 deg where sin = 1/2, through it."""
    circle = {"centre": (2.0, 0.0), "size": (2.0, 2.0)}
    assert_allclose(hits(0.0, **circle), 1.0)
    assert_allclose(hits(np.pi / 6 - 1e-9, **circle), np.sqrt(3), atol=1e-3)
    assert np.isinf(hits(np.pi / 6 + 1e-6, **circle))
    assert np.isinf(hits(np.pi, **circle))  # behind the sensor


def test_a_sensor_inside_has_one_hit_on_every_ray():
    r = hits(np.linspace(-np.pi, np.pi, 50), centre=(0.3, -0.2), tilt=0.7)
    assert np.isfinite(r).all()
    assert_allclose(hits(np.array([0.0, np.pi]), centre=(1.0, 0.0)), [3.35, 1.35])


def test_grazing_rays_keep_their_digits():
    """Against the roots of the quadratic in 40 digits, a millionth of a radian inside the tangent."""
    from fractions import Fraction

    middle, right, left = tangent_sector(ORIGIN, np.array([60.0, 7.0]), root_of(CAR, np.array(0.0)))
    bearing = middle + left - 1e-6
    c, s = (Fraction(v) for v in unit(bearing))
    a2, b2 = Fraction(2.35) ** 2, Fraction(0.9) ** 2
    qa = c * c / a2 + s * s / b2
    qb = -(c * 60 / a2 + s * 7 / b2)
    qc = Fraction(3600) / a2 + Fraction(49) / b2 - 1
    disc = qb * qb - qa * qc
    root = Fraction(int(disc * 10**60)).limit_denominator()
    exact = (-qb - Fraction(np.sqrt(float(root)) / 1e30)) / qa
    assert_allclose(hits(bearing, centre=(60.0, 7.0)), float(exact), rtol=1e-8)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_sector_holds_every_ray_that_hits(seed):
    rng = np.random.default_rng(seed)
    centre, size, tilt = rng.normal(0, 8, 2), rng.uniform(0.5, 9, 2), np.array(rng.uniform(-4, 4))
    L = root_of(size, tilt)
    middle, right, left = tangent_sector(ORIGIN, centre, L)
    grid = np.arange(3600) * 2 * np.pi / 3600
    hit = np.isfinite(near_hits(ORIGIN, grid, centre, L))
    relative = wrap_angle(grid - middle)
    np.testing.assert_array_equal(hit, (relative >= right) & (relative <= left))


def test_a_sector_across_plus_minus_pi_is_whole():
    middle, right, left = tangent_sector(ORIGIN, np.array([-10.0, 0.1]), root_of(CAR, np.array(0.3)))
    bearing = sector_fan(middle, right, left, 33)
    assert right < 0 < left
    assert left - right < 0.5
    assert np.isfinite(near_hits(ORIGIN, bearing, np.array([-10.0, 0.1]), root_of(CAR, np.array(0.3)))).all()
    assert (np.diff(bearing) > 0).all()


def test_hits_lie_on_the_outline():
    L, centre = root_of(CAR, np.array(0.8)), np.array([12.0, -5.0])
    bearing = sector_fan(*tangent_sector(ORIGIN, centre, L), 33)
    z = near_hits(ORIGIN, bearing, centre, L)[:, None] * unit(bearing)
    assert_allclose(np.linalg.norm(np.linalg.solve(L, (z - centre).T), axis=0), 1.0, rtol=1e-9)
    assert_allclose(outline(centre, L)[0], centre + 2.35 * unit(0.8))


EXACT = VirtualMeasurements(sigma=0.0)


@pytest.mark.parametrize("aspect_deg", [0, 5, 10, 30, 45, 60, 90])
def test_gauss_newton_finds_a_static_ellipse_at_every_aspect(aspect_deg):
    state, scan = static_case(np.radians(aspect_deg), EXACT, (4.7, 1.0))
    state = adapted(EXACT, state, scan, 100)
    assert_allclose([*state.centre, *state.size], [15.0, 0.0, 4.7, 1.8], atol=0.01)


def test_body_moments_learn_the_width_of_a_target_seen_end_on():
    f = VirtualMeasurements(rule=Lms(gain=0.5), rays=65, sigma=0.0)
    state = adapted(f, *static_case(0.0, f, (4.7, 1.0)), 150)
    assert_allclose(state.size, [4.7, 1.8], atol=0.05)


@pytest.mark.parametrize("rule", [Lms(), GaussNewton(), Bayes()])
@pytest.mark.parametrize("n", [0, 1, 2])
def test_fewer_than_three_detections_leave_the_size(rule, n):
    f = VirtualMeasurements(rule=rule)
    state = f.predict(f.init(prior((15.0, 2.0, 0.3), velocity=(10.0, 3.0))), 0.1)
    got, info = f.update(state, Scan.from_xy(np.array([[13.0, 2.0], [13.5, 1.2]])[:n].reshape(n, 2)))
    np.testing.assert_array_equal(got.size, state.size)
    assert info.n == n
    assert all(np.isfinite(a).all() for a in f.estimate(got) if a is not None)


def test_a_rejected_step_restores_both_parameters_and_difference():
    """y~ = -theta: every step makes it worse, so after six all is as before and the gain was halved six times."""
    gains = []

    def difference(theta):
        gains.append(theta[0, 0] - 1.0)
        return 5.0 + theta, np.ones(theta.shape[:-1], bool)

    theta = np.ones(4)
    done = descend(Lms(gain=0.4, iterations=6), theta, difference, TRUE, KNOWN)
    np.testing.assert_array_equal(done.theta, theta)
    np.testing.assert_array_equal(done.eps, 6.0 * np.ones(4))
    np.testing.assert_array_equal(done.kept, np.ones(4))
    assert_allclose(gains[1:], 6.0 * 0.4 / 2.0 ** np.arange(6))  # each trial starts from the same theta AND eps


def test_an_accepted_step_is_the_difference_times_the_gain():
    done = descend(
        Lms(gain=0.5, iterations=2), np.zeros(4), lambda t: (8.0 - t, np.ones(t.shape[:-1], bool)), TRUE, KNOWN
    )
    assert_allclose(done.theta, 6.0)
    assert_allclose(done.kept, 0.25)


def test_impossible_ellipses_are_never_taken():
    """Detections on one point pull the size to zero; it stays above 2 cm."""
    f = VirtualMeasurements(rule=Lms(iterations=20), sigma=0.0)
    state = f.init(prior((10.0, 0.0, 0.0), velocity=(5.0, 0.0)))
    scan = Scan.from_xy(np.full((20, 2), [9.0, 0.0]))
    for _ in range(200):
        state, _ = f.update(state, scan)
        assert state.size.min() > 0.02


def test_the_contour_stays_centred_where_the_filter_follows_the_rear():
    error, position = follow(VirtualMeasurements(sigma=0.1))
    assert abs(error[0]) < 0.4
    assert position[0] < -1.0


def test_a_new_track_does_not_jump_from_its_centre_to_the_visible_side():
    """The first innovation is of the size of the noise, not of half a car."""
    f = VirtualMeasurements(sigma=0.1)
    points, _ = f.virtual(ORIGIN, np.array([20.0, 0.0]), root_of(CAR, np.array(0.0)))
    _, info = f.update(f.init(prior((20.0, 0.0, 0.0), velocity=(10.0, 0.0))), Scan.from_xy(points))
    assert np.hypot(*info.eps) < 0.05


def test_the_sensor_with_most_detections_is_the_one_that_counts():
    scan = Scan.from_xy(np.zeros((4, 2)) + 5)._replace(
        pose=np.array([[1.0, 0, 0], [2.0, 0, 0], [2.0, 0, 0], [1.0, 0, 0]]),
        sensor=np.array([3, 7, 7, 3]),
        mask=np.array([True, True, True, False]),
    )
    place, mask = main_sensor(scan)
    assert_allclose(place, [2.0, 0.0])
    np.testing.assert_array_equal(mask, [False, True, True, False])
    tie = scan._replace(mask=np.ones(4, bool))
    for order in ([0, 1, 2, 3], [2, 1, 3, 0]):
        place, _ = main_sensor(tie._replace(pose=tie.pose[order], sensor=tie.sensor[order]))
        assert_allclose(place, [1.0, 0.0])


def test_the_estimate_has_a_contour_of_its_size():
    f = VirtualMeasurements()
    estimate = f.estimate(f.init(prior(np.zeros((3, 3)), size=(6.0, 2.0))))
    assert estimate.contour.shape == (3, 25, 2)
    assert_allclose(np.ptp(estimate.contour[0], axis=0), [6.0, 2.0], rtol=1e-6)
    small = f.estimate(f.resize(f.init(prior(np.zeros(3))), np.array([3.0, 1.5]), np.array([0.3, 0.1])))
    assert_allclose(small.size, [3.0, 1.5])
    assert_allclose(small.size_std, [0.3, 0.1])


def test_size_uncertainty_falls_where_the_size_is_seen():
    """From the side the length is visible and the width hardly."""
    f = VirtualMeasurements(sigma=0.1)
    start, scan = static_case(np.pi / 2, f, (4.7, 1.8))
    after = f.adapt(start, scan)
    ratio = after.size_std / start.size_std
    assert ratio[0] < 0.9
    assert ratio[0] < ratio[1] <= 1.0 + 1e-9


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match="body must be one of ellipse, box, got 'circle'"):
        VirtualMeasurements(body="circle")
    with pytest.raises(ValueError, match="rays must be at least 3"):
        VirtualMeasurements(rays=2)


def test_rays_meet_a_box_at_its_sides():
    L = root_of(np.array([4.0, 2.0]), np.array(0.0))
    r = box_hits(ORIGIN, np.array([0.0, np.arctan2(1, 8), np.pi, 0.2]), np.array([10.0, 0.0]), L)
    assert_allclose(r, [8.0, np.hypot(8, 1), np.inf, np.inf])
    inside = box_hits(ORIGIN, np.array([0.0, np.pi / 2, np.pi]), np.array([0.5, 0.0]), L)
    assert_allclose(inside, [2.5, 1.0, 1.5])


@given(seed=st.integers(0, 2**32 - 1))
def test_rays_meet_a_box_where_the_ray_caster_does(seed):
    rng = np.random.default_rng(seed)
    pose, size = np.array([*rng.normal(0, 10, 2), rng.uniform(-4, 4)]), rng.uniform(0.5, 9, 2)
    bearing = rng.uniform(-np.pi, np.pi, 500)
    corners = box_corners(pose, size)
    u, a, e = unit(bearing)[:, None], corners, np.roll(corners, -1, 0) - corners
    with np.errstate(divide="ignore", invalid="ignore"):
        det = u[..., 0] * e[:, 1] - u[..., 1] * e[:, 0]
        r = (a[:, 0] * e[:, 1] - a[:, 1] * e[:, 0]) / det
        t = (a[:, 0] * u[..., 1] - a[:, 1] * u[..., 0]) / det
    expected = np.where((r > 0) & (t >= 0) & (t <= 1), r, np.inf).min(-1)
    L = root_of(size, pose[2])
    assert_allclose(box_hits(ORIGIN, bearing, pose[:2], L), expected, rtol=1e-9)
    middle, right, left = box_sector(ORIGIN, pose[:2], L)
    relative = wrap_angle(bearing - middle)
    np.testing.assert_array_equal(np.isfinite(expected), (relative >= right) & (relative <= left))


def test_the_length_of_a_box_seen_end_on_stays_where_that_of_an_ellipse_is_made_up():
    """Detections of the flat rear do not inform about the length; an ellipse takes their depth for its curvature."""
    box, ellipse = VirtualMeasurements(body="box", sigma=0.05), VirtualMeasurements(sigma=0.05)
    state, scan = box_case(0.0, box, (4.7, 1.8))
    assert_allclose(adapted(box, state, scan, 50).size, [4.7, 1.8], atol=0.05)
    assert adapted(ellipse, state, scan, 50).size[0] < 3.0


def test_a_box_is_found_from_the_side_and_the_rear_at_once():
    f = VirtualMeasurements(body="box", sigma=0.0, rays=101)
    state, scan = box_case(np.radians(40), f, (4.2, 1.5))
    assert_allclose(adapted(f, state, scan, 300).size, [4.7, 1.8], atol=0.05)


def test_the_bayesian_rule_moves_little_on_few_detections_and_not_at_all_without_doubt():
    f = VirtualMeasurements(rule=Bayes(), body="box", sigma=0.1)
    start, scan = box_case(np.radians(40), f, (4.0, 1.5))
    sparse = scan._replace(mask=np.arange(33) % 8 == 0)
    few, many = f.adapt(start, sparse).size, f.adapt(start, scan).size
    assert 0 < few[0] - 4.0 < many[0] - 4.0
    sure = f.adapt(f.resize(start, start.size, np.full(2, 1e-6)), scan)
    assert_allclose(sure.size, start.size, atol=1e-3)


def test_the_bayesian_rule_reports_how_well_the_size_is_known():
    """Repeated independent scans from 40 deg: the error of the length stays within three of its standard deviations."""
    f = VirtualMeasurements(rule=Bayes(), body="box", sigma=0.1, unbiased=True)
    rng, off = np.random.default_rng(0), []
    for _ in range(20):
        state, scan = box_case(np.radians(40), f, rng.normal(CAR, (0.4, 0.1)))
        state = f.resize(state, state.size, np.array([0.4, 0.1]))
        for _ in range(10):
            noisy = scan.xy + 0.1 * rng.standard_normal(scan.xy.shape)
            state = f.adapt(state, Scan.from_xy(noisy, rng.random(33) < 0.4))
        off.append((state.size - CAR) / state.size_std)
    assert (state.size_std < [0.4, 0.1]).all()
    assert np.abs(off).max() < 3.5


def test_the_spread_of_few_detections_is_not_too_small_when_unbiased():
    """Four detections a scan: dividing by n makes the box a quarter too small in variance."""
    sizes = {}
    for unbiased in (True, False):
        f = VirtualMeasurements(unbiased=unbiased, sigma=0.0, rule=Lms(gain=0.05, iterations=1))
        rng = np.random.default_rng(1)
        state, scan = static_case(np.pi / 2, f, (4.7, 1.8))
        lengths = []
        for _ in range(400):
            keep = np.zeros(33, bool)
            keep[rng.choice(33, 4, replace=False)] = True
            state = f.adapt(state, scan._replace(mask=keep))
            lengths.append(state.size[0])
        sizes[unbiased] = np.mean(lengths[200:])
    assert sizes[False] < sizes[True] - 0.3
    assert abs(sizes[True] - 4.7) < 0.4

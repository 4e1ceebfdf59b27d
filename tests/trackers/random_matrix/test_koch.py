"""Koch's random matrix against Bayes' rule, the errata of the report, and the behaviour at standstill."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from studies.papers.hoher2022.printed import PrintedKoch
from trackers import Scan, prior
from trackers.geometry import rotation
from trackers.random_matrix.koch import NU_LEAST, Koch, KochState, degrees_of_freedom, singer


def random_state(rng, lead=()):
    A = rng.standard_normal((*lead, 3, 3))
    B = rng.standard_normal((*lead, 2, 2))
    return KochState(
        x=rng.normal(0, 3, (*lead, 6)),
        P=A @ A.mT + np.eye(3),
        nu=rng.uniform(6, 20, lead),
        X=10 * (B @ B.mT + np.eye(2)),
        heading=rng.uniform(-3, 3, lead),
    )


def log_density(state, x, X):
    """Log N(x; m, P (x) X) IW(X; nu, state.X), without constants of X and x."""
    cov = np.kron(state.P, X)
    d = x - state.x
    kinematic = -0.5 * (np.linalg.slogdet(cov)[1] + d @ np.linalg.solve(cov, d))
    wishart = -0.5 * ((state.nu + 3) * np.linalg.slogdet(X)[1] + np.trace(np.linalg.solve(X, state.X)))
    return kinematic + wishart


def bayes_spread(filter, seed=0, n=6):
    """Spread of log(prior x likelihood / posterior) over random (x, X): zero when the update is Bayes' rule."""
    rng = np.random.default_rng(seed)
    before = random_state(rng)
    z = before.x[:2] + rng.normal(0, 2, (n, 2))
    after, _ = filter.update(before, Scan.from_xy(z))
    values = []
    for _ in range(30):
        x, A = before.x + rng.normal(0, 2, 6), rng.standard_normal((2, 2))
        X = A @ A.T + 0.3 * np.eye(2)
        d = z - x[:2]
        likelihood = -0.5 * (n * np.linalg.slogdet(X)[1] + np.trace(np.linalg.solve(X, d.T @ d)))
        values.append(log_density(before, x, X) + likelihood - log_density(after, x, X))
    return np.ptp(values)


@pytest.mark.parametrize("seed", range(5))
def test_the_update_is_bayes_rule(seed):
    # 1e-6: the 1e-9 m^2 that keep the scale matrix regular, over the smallest extents drawn
    assert bayes_spread(Koch(), seed) < 1e-6


def test_the_printed_innovation_is_not():
    """Erratum of lines 8 and 12: sigma^2 / n beside a pure factor."""
    assert bayes_spread(PrintedKoch(sigma=0.1)) > 10


def test_prediction_keeps_the_mean_extent_and_the_degrees_of_freedom_above_three():
    f, state = Koch(), random_state(np.random.default_rng(1), (4,))
    extent = state.extent
    for _ in range(60):
        state = f.predict(state, 0.1)
        assert_allclose(state.extent, extent, rtol=1e-12)
    assert_allclose(state.nu, NU_LEAST)


def test_two_steps_without_detections_would_make_the_unguarded_extent_negative():
    """Nu 4 -> 3.27 -> 2.68, below the 3 that the mean needs."""
    nu = 4 * np.exp(-0.1 / 0.5) ** np.arange(3)
    assert_allclose(nu, [4, 3.27, 2.68], atol=0.01)
    state = random_state(np.random.default_rng(2))._replace(nu=np.array(4.0))
    for _ in range(2):
        state = Koch().predict(state, 0.1)
    assert np.linalg.eigvalsh(state.extent).min() > 0


def test_the_update_equals_the_equations_written_out():
    f, s = Koch(), random_state(np.random.default_rng(3))
    z = s.x[:2] + np.random.default_rng(4).normal(0, 1, (5, 2))
    got, info = f.update(s, Scan.from_xy(z))
    n, H = 5, np.array([[1.0, 0, 0]])
    mean = z.mean(0)
    S = (H @ s.P @ H.T).item() + 1 / n
    W = (s.P @ H.T)[:, 0] / S
    eps = mean - np.kron(H, np.eye(2)) @ s.x
    assert_allclose(got.x, s.x + np.kron(W[:, None], np.eye(2)) @ eps, rtol=1e-9)
    assert_allclose(got.P, s.P - S * np.outer(W, W), rtol=1e-9, atol=1e-12)
    assert_allclose(got.X, s.X + np.outer(eps, eps) / S + (z - mean).T @ (z - mean), rtol=1e-8)
    assert got.nu == s.nu + n
    assert_allclose(info.S, S * s.extent, rtol=1e-12)


def test_the_innovation_of_the_corrected_form_does_not_depend_on_the_unit_of_length():
    """In centimetres instead of metres everything scales; the printed form mixes areas with pure numbers."""
    rng = np.random.default_rng(5)
    s, z = random_state(rng), rng.normal(0, 2, (6, 2))

    def ratio(filter):
        small, large = (
            filter.update(s._replace(x=k * s.x, X=k**2 * s.X), Scan.from_xy(k * z))[0].X for k in (1.0, 100.0)
        )
        return large / 1e4 / small

    assert_allclose(ratio(Koch()), np.ones((2, 2)), rtol=1e-6)
    free = PrintedKoch(sigma=100 * 0.5).update(s._replace(x=100 * s.x, X=1e4 * s.X), Scan.from_xy(100 * z))[0]
    assert np.abs(free.X / 1e4 / PrintedKoch(sigma=0.5).update(s, Scan.from_xy(z))[0].X - 1).max() > 0.1


def test_singers_model_has_the_reference_values():
    F, D = singer(0.1, 0.5)
    assert_allclose(F[0], [1, 0.1, 0.005])
    assert_allclose(F[2, 2], np.exp(-0.2))
    assert_allclose(np.diag(D), [0, 0, 1 - np.exp(-0.4)])


def test_the_heading_is_held_at_standstill_and_follows_the_course_else():
    f = Koch()
    start = f.init(prior((0.0, 0.0, 1.0), velocity=(0.0, 0.0), velocity_std=0.1))
    slow, _ = f.update(f.predict(start, 0.1), Scan.from_xy([(0.01, 0.0), (-0.01, 0.02), (0.0, -0.02)]))
    assert_allclose(f.estimate(slow).pose[2], 1.0)
    fast = f.init(prior((0.0, 0.0, 1.0), velocity=(8.0, 6.0)))
    after, _ = f.update(f.predict(fast, 0.1), Scan.from_xy([(0.8, 0.6), (0.9, 0.6), (0.7, 0.6)]))
    assert_allclose(f.estimate(after).pose[2], np.arctan2(after.x[3], after.x[2]))
    assert abs(f.estimate(after).pose[2] - np.arctan2(6, 8)) < 0.1


def test_a_coasting_object_turns_with_its_velocity():
    """Without detections the acceleration fades, the course bends, and the heading with it."""
    f = Koch()
    s = f.init(prior((0.0, 0.0, 0.0), velocity=(10.0, 0.0)))
    s = f.predict(s._replace(x=np.array([0, 0, 10.0, 0, 0, 4.0])), 0.2)
    assert_allclose(s.heading, np.arctan2(s.x[3], s.x[2]))
    assert s.heading > 0.05


def test_yaw_rate_is_centripetal_acceleration_over_speed():
    f = Koch()
    s = f.init(prior((0.0, 0.0, 0.0), velocity=(10.0, 0.0)))._replace(x=np.array([0, 0, 10.0, 0, 0, 3.0]))
    assert_allclose(f.estimate(s).yaw_rate, 0.3)
    standing = s._replace(x=np.array([0, 0, 0.1, 0, 0, 3.0]))
    assert f.estimate(standing).yaw_rate == 0


def test_resizing_changes_the_size_and_keeps_the_variance_of_the_centre():
    f = Koch()
    state = f.init(prior((3.0, 1.0, 0.4), velocity=(9.0, 4.0)))
    resized = f.resize(state, np.array([12.0, 2.5]), np.array([1.2, 0.25]))
    got, old = f.estimate(resized), f.estimate(state)
    assert_allclose(got.size, [12.0, 2.5], rtol=1e-9)
    assert_allclose(got.size_std, [1.2, 0.25], rtol=1e-9)
    assert_allclose(np.trace(got.cov[:2, :2]), np.trace(old.cov[:2, :2]), rtol=1e-6)
    assert_allclose(got.pose, old.pose)


def test_size_spread_and_degrees_of_freedom_are_inverse():
    f = Koch()
    start = prior((0.0, 0.0, 0.0), size=(10.0, 2.5), size_std=(1.0, 0.25))
    assert_allclose(f.estimate(f.init(start)).size_std, start.size_std, rtol=1e-9)
    assert_allclose(degrees_of_freedom(np.array([1.0, 1.0]), np.array([0.1, 0.1])), 55.0)


def range_rate_scan(rng, velocity, centre):
    xy = centre + rng.uniform([-2, -0.9], [2, 0.9], (30, 2))
    scan = Scan.from_xy(xy)
    polar = scan.polar.copy()
    polar[:, 2] = (scan.sight * velocity).sum(-1)
    return scan._replace(polar=polar)


def test_range_rates_correct_the_velocity_only_when_asked():
    velocity, centre = np.array([20.0, 0.0]), np.array([10.0, 5.0])
    scan = range_rate_scan(np.random.default_rng(0), velocity, centre)
    start = prior((*centre, 0.1), velocity=(20.8, 1.0), velocity_std=2.0)

    def error(filter, scan):
        """Along the line of sight, the only direction that range rates see."""
        got = filter.estimate(filter.update(filter.init(start), scan)[0]).velocity
        return abs((got - velocity) @ centre) / np.hypot(*centre)

    silent = scan._replace(polar=np.where(np.arange(3) == 2, np.nan, scan.polar))
    assert error(Koch(rate_weight=0.3), scan) < 0.2 * error(Koch(), scan)
    assert error(Koch(), scan) == error(Koch(), silent)


def test_the_covariance_is_the_kronecker_product():
    f = Koch()
    s = random_state(np.random.default_rng(6))
    assert_allclose(f.estimate(s).cov, np.kron(s.P[:2, :2], s.extent), rtol=1e-6, atol=1e-8)


def test_the_mean_follows_a_turning_object():
    """Constant turn of 0.5 rad/s at 5 m/s, detections all over an ellipse: heading within 5 deg on average."""
    rng = np.random.default_rng(8)
    f, runs = Koch(), 50
    state = f.init(prior(np.tile([0.0, 10.0, 0.0], (runs, 1)), velocity=(5.0, 0.0)))
    off = []
    for k in range(1, 80):
        heading = -0.5 * 0.1 * k
        centre = 10 * np.array([np.sin(-heading), np.cos(-heading)])
        body = rng.standard_normal((runs, 12, 2)) * [1.2, 0.45]
        scan = Scan.from_xy(centre + body @ rotation(heading).T)
        state, _ = f.update(f.predict(state, 0.1), scan)
        off.append(np.angle(np.exp(1j * (f.estimate(state).pose[:, 2] - heading))))
    assert np.abs(np.degrees(np.mean(off[20:]))) < 5
    assert np.degrees(np.std(off[20:])) < 10


def test_bad_time_steps_are_named():
    f = Koch()
    with pytest.raises(ValueError, match="dt must be finite, >= 0"):
        f.predict(f.init(prior((0.0, 0.0, 0.0))), -0.1)

"""Range rates: the derivative of a distance, its gradient, and the correction against a sum over detections."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers import Scan
from trackers.geometry import rotation, unit
from trackers.range_rate import RangeRates, over_ground, polar_gradient


def test_the_rate_over_ground_is_the_derivative_of_the_distance_from_a_resting_sensor():
    sensor, centre, velocity, yaw_rate = np.array([1.0, -2.0]), np.array([20.0, 5.0]), np.array([3.0, 12.0]), 0.4
    lever, step = np.array([2.1, -0.8]), 1e-5

    def distance(t):
        return np.hypot(*(centre + t * velocity + rotation(yaw_rate * t) @ lever - sensor))

    d = centre + lever - sensor
    got = over_ground(d / np.hypot(*d), velocity, np.array(yaw_rate), lever)
    np.testing.assert_allclose(got, (distance(step) - distance(-step)) / (2 * step), rtol=1e-8)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_gradient_is_that_of_finite_differences_and_gives_the_rate_itself(seed):
    rng = np.random.default_rng(seed)
    u, lever, x = unit(rng.uniform(-3, 3)), rng.normal(0, 2, 2), rng.normal(0, [1, 10, 0.5])

    def rate(x):
        return over_ground(u, x[1] * unit(x[0]), x[2], lever)

    h = np.array(polar_gradient(u, unit(x[0]), x[1], lever))
    numeric = [(rate(x + d) - rate(x - d)) / 2e-6 for d in 1e-6 * np.eye(3)]
    np.testing.assert_allclose(h, numeric, atol=1e-7)
    np.testing.assert_allclose(x[1] * h[1] + x[2] * h[2], rate(x), rtol=1e-12, atol=1e-12)


def moving_scan(rng, m, M=6):
    """Detections about m (7,) of a sensor that moves, and their places; two rates are off, one is not measured."""
    xy = m[:2] + rng.normal(0, 1, (M, 2))
    scan = Scan.from_xy(xy)._replace(velocity=np.array([[3.0, -1.0]]))
    rate = over_ground(scan.sight, m[3] * unit(m[2]), m[4], xy - m[:2]) - scan.sight @ scan.velocity[0]
    polar = scan.polar.copy()
    polar[:, 2] = rate + rng.normal(0, 0.1, M)
    polar[:2, 2] += [5.0, -0.4]
    polar[2, 2] = np.nan
    return scan._replace(polar=polar, mask=np.arange(M) != 4), xy


def test_the_correction_is_a_sum_over_the_measured_rates_under_the_mask():
    rng, rates = np.random.default_rng(3), RangeRates(0.3, 0.5, 1.5)
    m = np.array([20.0, 5.0, 0.3, 12.0, 0.2, 4.6, 1.9])
    scan, xy = moving_scan(rng, m)
    A = rng.normal(0, 1, (7, 7))
    P = A @ A.T + 0.1 * np.eye(7)
    information, score = np.linalg.inv(P), np.zeros(7)
    for j in (0, 1, 3, 5):
        h = np.zeros(7)
        h[2:5] = polar_gradient(scan.sight[j], unit(m[2]), m[3], xy[j] - m[:2])
        residual = scan.polar[j, 2] + scan.sight[j] @ scan.velocity[0] - m[3] * h[3] - m[4] * h[4]
        information += 0.3 / 0.5**2 * np.outer(h, h)
        score += 0.3 / 0.5**2 * h * np.clip(residual, -1.5, 1.5)
    got_m, got_P = rates.correct(m, P, scan, xy)
    np.testing.assert_allclose(got_P, np.linalg.inv(information), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(got_m, m + np.linalg.solve(information, score), rtol=1e-9)


def test_without_weight_or_rates_nothing_changes():
    m, P = np.array([20.0, 5.0, 0.3, 12.0, 0.2]), np.eye(5)
    scan, xy = moving_scan(np.random.default_rng(4), m)
    for rates, seen in ((RangeRates(weight=0.0), scan), (RangeRates(), Scan.from_xy(xy))):
        got_m, got_P = rates.correct(m, P, seen, xy)
        np.testing.assert_array_equal(got_m, m)
        np.testing.assert_array_equal(got_P, P)


def test_numbers_that_make_no_sense_are_refused():
    for name, value in (("weight", -0.1), ("std", 0.0), ("clip", 0.0)):
        with pytest.raises(ValueError, match=f"RangeRates.{name} must be"):
            RangeRates(**{name: value})

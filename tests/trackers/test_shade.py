"""What tracks that hide others leave to be seen, against a loop over all of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from trackers.geometry import wrap_angle
from trackers.shade import NEARER, NO_SHADE, Shade


def shade(*others, std=0.0, sensors=1):
    """That of others (row, middle, half, nearest), the same for all sensors."""
    row, middle, half, nearest = np.array(others, float).reshape(-1, 4).T
    return Shade(row.astype(int), *(np.tile(a, (sensors, 1)) for a in (middle, half, std + 0 * half, nearest)))


def one(shade, azimuth, distance, row=0, std=0.0):
    """Probability that a place of one track is seen by the only sensor."""
    at = np.array([[azimuth]]), np.array([[distance]])
    return shade.seen(np.zeros(1, int), np.array([row]), *at, np.array([std]))[0, 0]


def test_of_one_vehicle_before_another_the_edges_are_where_its_box_ends():
    before = shade((1, 0.2, 0.1, 20.0))
    seen = [one(before, a, 40.0) for a in (0.09, 0.11, 0.2, 0.29, 0.31)]
    np.testing.assert_allclose(seen, [1, 0, 0, 0, 1])
    assert one(before, 0.1, 40.0) == pytest.approx(0.5)  # on the edge itself
    assert one(shade((1, 0.2, 0.1, 20.0), std=0.03), 0.05, 40.0, std=0.04) == pytest.approx(norm.cdf(1.0))


def test_nobody_hides_itself_or_what_is_nearer():
    before = shade((1, 0.2, 0.1, 20.0))
    assert one(before, 0.2, 40.0, row=1) == 1.0
    assert one(before, 0.2, 20.0 + 0.9 * NEARER) == 1.0
    assert one(before, 0.2, 20.0 + 1.1 * NEARER) == pytest.approx(0.0)
    assert one(NO_SHADE, 0.2, 40.0) == 1.0


def test_places_are_hidden_across_the_seam_of_azimuths():
    behind = shade((1, np.pi - 0.01, 0.05, 20.0))
    np.testing.assert_allclose([one(behind, a, 40.0) for a in (-np.pi + 0.03, np.pi - 0.05, -np.pi + 0.05)], [0, 0, 1])


@given(st.integers(0, 2**32 - 1))
def test_what_is_seen_is_the_product_over_all_that_hide(seed):
    rng = np.random.default_rng(seed)
    S, O, P, K = 3, 5, 4, 6
    s = Shade(rng.integers(0, 7, O), rng.uniform(-np.pi, np.pi, (S, O)), rng.uniform(0.01, 1.0, (S, O)),
              rng.choice([0.0, 0.003, 0.1], (S, O)), rng.uniform(5, 60, (S, O)))  # fmt: skip
    sensor, row, std = rng.integers(0, S, P), rng.integers(0, 7, P), rng.choice([0.0, 0.02], P)
    azimuth = rng.uniform(-4, 4, (P, 1)) + rng.uniform(-1, 1, (P, 1)) * np.linspace(-1, 1, K)
    distance = rng.uniform(5, 70, (P, K))
    expected = np.ones((P, K))
    for p in range(P):
        for o in np.flatnonzero(s.row != row[p]):
            h, e = s.half[sensor[p], o], max(np.hypot(std[p], s.std[sensor[p], o]), 1e-6)
            d = wrap_angle(s.middle[sensor[p], o] - azimuth[p])
            hides = norm.cdf((d + h) / e) - norm.cdf((d - h) / e)
            expected[p] *= 1 - np.where(s.nearest[sensor[p], o] + NEARER < distance[p], hides, 0)
    np.testing.assert_allclose(s.seen(sensor, row, azimuth, distance, std), expected, atol=1e-12)

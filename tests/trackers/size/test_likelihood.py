"""The likelihood of detections on the grid against a loop, and what a sensor could have seen against a count."""

import numpy as np
import pytest
from scipy.stats import norm

from trackers.size.grid import LENGTH, WIDTH
from trackers.size.likelihood import Depths, log_likelihood
from trackers.size.visible import DEPTHS, room

EPS = 0.04


def drawn(grid, G, rng):
    return Depths(
        depth=rng.uniform(-1, grid.sizes[-1], G),
        sigma=rng.uniform(0.1, 0.5, G),
        face=rng.uniform(0, 0.8, G) * (rng.random(G) < 0.7),
        far=rng.random(G) < 0.3,
        room=rng.uniform(1, 5, (G, len(grid.sizes))),
        behind=rng.uniform(0.05, 0.3, G),
        rounding=np.stack([rng.uniform(0, 0.3, G), rng.uniform(0, 0.2, G)], -1),
    )


def by_hand(grid, z, j, L, o, k):
    """(ENDS.3) to (ENDS.5) of one detection, size and offset."""
    d = z.depth[j] + o
    delta = L - d if z.far[j] else d
    face = z.face[j] * norm.pdf(delta, z.behind[j], np.hypot(z.sigma[j], 0.7 * z.behind[j]))
    r, s_r = z.rounding[j]
    even = norm.cdf(d / z.sigma[j]) - norm.cdf((d - L + r) / np.hypot(z.sigma[j], s_r))
    return (1 - EPS) * (face + (1 - z.face[j]) * even / z.room[j, k]) + EPS / grid.span


@pytest.mark.parametrize("grid", [LENGTH, WIDTH], ids=["length", "width"])
def test_the_likelihood_equals_a_loop_over_detections_sizes_and_offsets(grid):
    rng = np.random.default_rng(1)
    z, start = drawn(grid, 7, rng), np.array([0, 3, 4])
    got = log_likelihood(grid, z, start, EPS)
    for h, rows in enumerate(np.split(np.arange(7), start[1:])):
        for k in rng.integers(0, len(grid.sizes), 12):
            for n in rng.integers(0, len(grid.offsets), 5):
                each = [np.log(by_hand(grid, z, j, grid.sizes[k], grid.offsets[n], k)) for j in rows]
                assert got[h, k, n] == pytest.approx(sum(each), rel=1e-9)


def test_many_detections_neither_underflow_nor_overflow():
    rng = np.random.default_rng(2)
    z = drawn(LENGTH, 400, rng)
    parts = log_likelihood(LENGTH, z, np.arange(400), EPS)
    got = log_likelihood(LENGTH, z, np.array([0, 10]), EPS)
    np.testing.assert_allclose(got[0], parts[:10].sum(0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(got[1], parts[10:].sum(0), rtol=1e-9, atol=1e-9)


def along(distance):
    """Middles of the cells (1, 20, 2) of a body that begins so far ahead of the origin."""
    return np.stack([distance + DEPTHS, np.zeros(len(DEPTHS))], -1)[None]


def seen(distance, max_range, fov=2 * np.pi, heading=0.0):
    pose = np.array([[0.0, 0.0, heading]])
    return room(along(distance), pose, np.array([max_range]), np.array([fov]), LENGTH.sizes)[0]


def test_of_a_body_in_view_all_could_be_seen():
    np.testing.assert_allclose(seen(20.0, 100.0), LENGTH.sizes)


def test_beyond_the_range_nothing_more_could_be_seen():
    np.testing.assert_allclose(seen(20.0, 25.0), np.minimum(LENGTH.sizes, 4.0))  # the cell to 25 m is the last in view


def test_out_of_the_field_of_view_nothing_could_be_seen():
    np.testing.assert_allclose(seen(20.0, 100.0, fov=0.5, heading=1.0), 1.0)

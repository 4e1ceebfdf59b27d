"""The likelihood of detections on the grid against a loop, and what a sensor could have seen against a count."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.stats import norm

from trackers.size.grid import LENGTH, WIDTH
from trackers.size.hidden import CELLS
from trackers.size.likelihood import Depths, by_size_and_offset, log_likelihood
from trackers.size.visible import Room, in_view, room

EPS = 0.04


def drawn(grid, G, rng):
    N = len(grid.offsets)
    return Depths(
        depth=rng.uniform(-1, grid.sizes[-1], G),
        sigma=rng.uniform(0.1, 0.5, G),
        face=rng.uniform(0, 0.6, G) * (rng.random(G) < 0.7),
        far=rng.random(G) < 0.3,
        entered=rng.uniform(0, 0.4, G),
        inside=np.where(rng.random(G) < 0.5, rng.uniform(0.1, 2.0, G), np.inf),
        rooms=[
            Room(
                rows,
                rng.uniform(0, 1, (len(rows), N)),
                rng.uniform(1, 5, (len(rows), len(grid.sizes) + N - 1)),
                np.ones(len(rows)),
                shaded,
            )
            for rows, shaded in ((np.array([1, 4]), np.array([True, False])), (np.array([2]), np.array([False])))
        ],
        through=rng.uniform(0, 0.3, G) * np.isin(np.arange(G), 1),  # of what is in the shade
        least=rng.uniform(0.5, 1.0, G),
        behind=rng.uniform(0.05, 0.3, (G, 2)),
        rounding=np.stack([rng.uniform(0, 0.3, G), rng.uniform(0, 0.2, G)], -1),
    )


def by_hand(grid, z, j, k, n):
    """(ENDS.3) to (ENDS.5) and (ENDS.31) of one detection, size and offset; the latter by an integral."""
    L, o = grid.sizes[k], grid.offsets[n]
    d = z.depth[j] + o
    delta = L - d if z.far[j] else d
    mean, spread = z.behind[j]
    face = z.face[j] * norm.pdf(delta, mean, np.hypot(z.sigma[j], spread))
    r, s_r = z.rounding[j]
    even = norm.cdf(d / z.sigma[j]) - norm.cdf((d - L + r) / np.hypot(z.sigma[j], s_r))
    room = L
    for one in z.rooms:
        for i in np.flatnonzero(one.rows == j):
            room = one.far[i, len(grid.sizes) - 1 - k + n] - one.near[i, n]
    m, inside, share = z.inside[j], 0.0, 1 - z.face[j]
    if np.isfinite(m):
        share -= z.entered[j]
        x = np.linspace(0, L, 4001)
        fall = np.exp(-x / m) / (m * (1 - np.exp(-L / m)))
        inside = z.entered[j] * trapezoid(fall * norm.pdf(delta - x, 0, z.sigma[j]), x)
    shown = (1 - z.through[j]) / max(room - r, z.least[j]) + z.through[j] / max(L - r, z.least[j])  # (ENDS.51)
    return (1 - EPS) * (face + inside + share * even * shown) + EPS / grid.span


@pytest.mark.parametrize("grid", [LENGTH, WIDTH], ids=["length", "width"])
def test_the_likelihood_equals_a_loop_over_detections_sizes_and_offsets(grid):
    rng = np.random.default_rng(1)
    z, start = drawn(grid, 7, rng), np.array([0, 3, 4])
    got = log_likelihood(grid, z, start, EPS)
    for h, rows in enumerate(np.split(np.arange(7), start[1:])):
        for k in rng.integers(0, len(grid.sizes), 12):
            for n in rng.integers(0, len(grid.offsets), 5):
                each = [np.log(by_hand(grid, z, j, k, n)) for j in rows]
                assert got[h, k, n] == pytest.approx(sum(each), rel=1e-5)


def test_many_detections_neither_underflow_nor_overflow():
    rng = np.random.default_rng(2)
    z = drawn(LENGTH, 400, rng)
    parts = log_likelihood(LENGTH, z, np.arange(400), EPS)
    got = log_likelihood(LENGTH, z, np.array([0, 10]), EPS)
    np.testing.assert_allclose(got[0], parts[:10].sum(0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(got[1], parts[10:].sum(0), rtol=1e-9, atol=1e-9)


def seen(distance, max_range, fov=2 * np.pi, heading=0.0):
    """Length [m] that a sensor at the origin leaves room for, (K, N), of a body that begins so far ahead."""
    points = np.stack([distance + CELLS[0].middles, np.zeros(CELLS[0].number)], -1)[None]
    mask = in_view(points, np.array([[0.0, 0.0, heading]]), np.array([max_range]), np.array([fov]))
    got = room(LENGTH, CELLS[0], mask, np.array([0]), np.array([10.0]), np.zeros(1, bool))
    assert got.share[0] == pytest.approx(np.clip(max_range - distance, 0, 10) / 10 if fov > 1 else 0.0)
    return (by_size_and_offset(got.far, len(LENGTH.offsets)) - got.near[:, None])[0]


def test_of_a_body_in_view_all_could_be_seen():
    np.testing.assert_allclose(seen(20.0, 100.0), np.tile(LENGTH.sizes[:, None], 21), atol=1e-9)


def test_beyond_the_range_nothing_more_could_be_seen():
    """Five metres behind the box's anchor end; a body whose anchor end lies further out has more of it in range."""
    np.testing.assert_allclose(seen(20.0, 25.0), np.minimum(LENGTH.sizes[:, None], 5.0 + LENGTH.offsets), atol=1e-9)


def test_out_of_the_field_of_view_nothing_could_be_seen():
    np.testing.assert_allclose(seen(20.0, 100.0, fov=0.5, heading=1.0), 0.0)

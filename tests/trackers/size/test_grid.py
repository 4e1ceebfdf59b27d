"""Grids of size and offset: what prediction, roll and change of the anchor keep."""

import numpy as np
import pytest
from scipy.linalg import expm

from trackers.size.evidence import with_evidence
from trackers.size.grid import LENGTH, WIDTH, Grid

GRIDS = pytest.mark.parametrize("grid", [LENGTH, WIDTH], ids=["length", "width"])


def test_a_loosened_offset_is_that_of_a_new_object_and_sizes_are_as_likely_as_before():
    A = np.concatenate([blob(LENGTH, 2.25, 0.0), blob(LENGTH, 4.5, 0.25)])
    new = LENGTH.loosened(A, np.array([0.0, 1.0]))
    np.testing.assert_array_equal(new[0], A[0])
    np.testing.assert_allclose(np.exp(new[1]).sum(-1), np.exp(A[1]).sum(-1))
    mean, cov = moments(LENGTH, new[1])
    born = LENGTH.born((1,))[0]
    of_birth = moments(LENGTH, born)
    np.testing.assert_allclose(mean[0], of_birth[0][0], atol=1e-9)
    np.testing.assert_allclose(cov[0, 0], of_birth[1][0, 0])
    np.testing.assert_allclose(cov[0, 1], 0.0, atol=1e-9)


def moments(grid, A):
    """Mean and covariance of (near end, size) under exp A (K, N)."""
    p = np.exp(A - A.max())
    p /= p.sum()
    L, o = np.meshgrid(grid.sizes, grid.offsets, indexing="ij")
    x = np.stack([o, L], -1)
    mean = (p[..., None] * x).sum((0, 1))
    d = x - mean
    return mean, (p[..., None, None] * d[..., :, None] * d[..., None, :]).sum((0, 1))


def blob(grid, size, offset, size_steps=2.0, offset_steps=0.8):
    """A (1, K, N) of a Gaussian about a size and an offset [m]."""
    L, o = grid.sizes[:, None], grid.offsets
    h = grid.step
    return -0.5 * (((L - size) / (size_steps * h)) ** 2 + ((o - offset) / (offset_steps * h)) ** 2)[None]


def test_sizes_and_offsets_are_the_steps_of_the_method():
    assert (len(LENGTH.sizes), len(LENGTH.offsets)) == (72, 21)
    assert (len(WIDTH.sizes), len(WIDTH.offsets)) == (25, 11)
    np.testing.assert_allclose(LENGTH.sizes[[0, -1]], [1.75, 19.5])
    np.testing.assert_allclose(WIDTH.offsets[[0, 5, -1]], [-0.5, 0.0, 0.5], atol=1e-12)


@pytest.mark.parametrize("change", [{"last": 19.6}, {"reach": 2.6}, {"first": 0.0}, {"birth_std": 0.0}])
def test_a_grid_that_does_not_fit_is_refused(change):
    whole = {"first": 1.75, "last": 19.5, "reach": 2.5, "step": 0.25, "birth_std": 1.2, "offset_std": 0.3, "span": 12.0}
    with pytest.raises(ValueError, match="must be"):
        Grid(**(whole | change))


@GRIDS
@pytest.mark.parametrize("steps", [-2, 1, 3])
def test_a_roll_moves_the_offset_and_keeps_everything_else(grid, steps):
    A = blob(grid, grid.sizes[12], 0.0, offset_steps=0.3)
    before, after = moments(grid, A[0]), moments(grid, grid.rolled(A, np.array([steps]))[0])
    np.testing.assert_allclose(after[0], before[0] - [steps * grid.step, 0.0], atol=1e-9)
    np.testing.assert_allclose(after[1], before[1], atol=1e-9)


@GRIDS
def test_a_change_of_the_anchor_and_back_is_the_same_posterior(grid):
    A = blob(grid, grid.sizes[10], grid.step, 0.5, 0.2)
    size = grid.sizes[[10]]
    back = grid.flipped(grid.flipped(A, size), size)
    np.testing.assert_allclose(np.exp(back - back.max()), np.exp(A - A.max()), atol=1e-9)


def test_a_change_of_the_anchor_keeps_both_ends():
    size, boxed, offset = 9.0, 8.25, 0.5
    (after, _) = moments(LENGTH, LENGTH.flipped(blob(LENGTH, size, offset, 0.2, 0.2), np.array([boxed]))[0])
    np.testing.assert_allclose(after, [size - boxed - offset, size], atol=1e-6)


@GRIDS
def test_the_offset_returns_to_the_box_as_its_process_says(grid):
    tau, dt = 2.0, 0.4
    P = grid.transition(dt, tau, 0.0)
    o = grid.offsets
    np.testing.assert_allclose(P.sum(-1), 1.0, atol=1e-12)
    inner = np.abs(o) <= 0.7 * grid.reach
    np.testing.assert_allclose((P @ o)[inner], np.exp(-dt / tau) * o[inner], atol=2e-3)
    np.testing.assert_allclose(P @ P, grid.transition(2 * dt, tau, 0.0), atol=1e-12)
    still = grid.transition(100 * tau, tau, 0.0)[0]
    assert np.sqrt(still @ o**2) == pytest.approx(grid.offset_std, rel=0.05)


@GRIDS
@pytest.mark.parametrize("dt", [1e-6, 1 / 15, 0.4, 60.0])
def test_the_transition_is_the_exponential_of_the_rates_of_its_steps(grid, dt):
    """Rates from the transition over the shortest step, with an error of a 10^-6 of them."""
    tau, short = 2.0, 1e-9
    Q = (grid.transition(short, tau, 0.0) - np.eye(len(grid.offsets))) / short
    P = grid.transition(dt, tau, 0.0)
    np.testing.assert_allclose(P, expm(Q * dt), atol=2e-6 * min(dt, 1.0))
    half = grid.transition(round(dt / 2, 12), tau, 0.0)
    np.testing.assert_allclose(P, half @ half, atol=1e-10)
    assert P.min() >= 0


@GRIDS
def test_steps_that_differ_by_rounding_have_one_transition(grid):
    times = np.arange(400) / 15
    found = {grid.transition(float(dt), 2.0, 1e-3).tobytes() for dt in np.diff(times)}
    assert len(found) == 1


def test_a_misplaced_box_is_allowed_for():
    even = LENGTH.transition(1.0, 2.0, 0.1) - np.exp(-0.1) * LENGTH.transition(1.0, 2.0, 0.0)
    np.testing.assert_allclose(even, (1 - np.exp(-0.1)) / 21)


def test_a_prediction_forgets_with_the_memory():
    A = np.log(LENGTH.predicted(blob(LENGTH, 9.0, 0.0), 7.0, 10.0, 2.0, 0.0))
    before, after = moments(LENGTH, blob(LENGTH, 9.0, 0.0)[0])[1][1, 1], moments(LENGTH, A[0])[1][1, 1]
    assert after == pytest.approx(np.exp(0.7) * before, rel=0.01)


def test_a_scan_counts_more_often_for_the_offset_and_once_for_the_size():
    """(ENDS.39): the sums over offsets are those of (ENDS.9), the odds of two offsets given the size sharper."""
    rng = np.random.default_rng(0)
    A, log_p = rng.normal(0, 2, (2, 2, 7, 5))
    new = with_evidence(A, log_p, np.array([1.0, 3.0]))
    plain = A + log_p
    np.testing.assert_allclose(new[0], plain[0] - plain[0].max(), atol=1e-12)
    sizes, others = (np.exp(x[1]).sum(-1) for x in (new, plain))
    np.testing.assert_allclose(sizes / sizes.sum(), others / others.sum(), rtol=1e-12)
    np.testing.assert_allclose(new[1, :, 0] - new[1, :, 1], (A + 3 * log_p)[1, :, 0] - (A + 3 * log_p)[1, :, 1])

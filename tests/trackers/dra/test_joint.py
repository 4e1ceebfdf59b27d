"""The parts of the joint form: packed matrices, hypotheses that share one, and the best assignments of many objects."""

from itertools import product as combinations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from trackers.dra.joint import COLUMNS, ENTRY, ROWS, alike, enumerate_best, inverse, product
from trackers.dra.regions import REGIONS
from trackers.dra.state import SEEN


def positive_definite(rng, count, scale):
    """Matrices (count, 9, 9) as the information matrices are: the identity and more."""
    D = scale * rng.standard_normal((count, SEEN, 3))
    return np.eye(SEEN) + D @ D.mT


@settings(deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 20), st.floats(0.01, 300))
def test_packed_inverses_products_and_determinants_are_those_of_the_whole_matrices(seed, count, scale):
    rng = np.random.default_rng(seed)
    A, v = positive_definite(rng, count, scale), rng.standard_normal((count, SEEN))
    packed = np.ascontiguousarray(A[:, ROWS, COLUMNS].T)
    np.testing.assert_allclose(product(packed, v.T).T, (A @ v[..., None])[..., 0], rtol=1e-9, atol=1e-9 * scale**2)
    C, log_det = inverse(packed)
    # elimination is the worse the further the largest eigenvalue is from one
    np.testing.assert_allclose(C[ENTRY].transpose(2, 0, 1), np.linalg.inv(A), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(log_det, np.linalg.slogdet(A)[1], rtol=1e-9, atol=1e-9)


@settings(deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 6), st.integers(1, 40))
def test_hypotheses_are_alike_exactly_where_object_and_numbers_by_region_are_equal(seed, M, F):
    rng = np.random.default_rng(seed)
    region, owner = rng.integers(0, REGIONS, (F, M)), np.sort(rng.integers(0, 3, F))
    first, which = alike(region, owner)
    names = [(int(o), *np.bincount(row, minlength=REGIONS)) for o, row in zip(owner, region, strict=True)]
    same = np.array([[a == b for b in names] for a in names])
    np.testing.assert_array_equal(which[:, None] == which, same)
    np.testing.assert_array_equal(which[first], np.arange(len(first)))
    assert (np.diff(owner[first]) >= 0).all()  # those of one object stand together


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 40))
def test_objects_with_fewer_detections_have_their_own_best_assignments(seed, cap):
    rng = np.random.default_rng(seed)
    n = np.array([4, 2, 2, 1])
    score = rng.normal(0, 2, (4, 2, 4, REGIONS))
    score[rng.random(score.shape) < 0.4] = -np.inf
    score[..., 0] = np.where(np.isfinite(score).any(-1), score[..., 0], 0.0)
    found = enumerate_best(score, n, cap)
    for b, k in combinations(range(4), range(2)):
        sums = [sum(score[b, k, r, i] for r, i in enumerate(phi)) for phi in combinations(range(REGIONS), repeat=n[b])]
        likely = np.sort([s for s in sums if s > max(sums) - 15])[::-1]
        alive = found.alive[b, k]
        got = [score[b, k, range(n[b]), phi[: n[b]]].sum() for phi in found.region[b, k][alive]]
        np.testing.assert_allclose(np.sort(got)[::-1], likely[:cap], rtol=1e-12)
        assert not found.region[b, k, :, n[b] :].any()

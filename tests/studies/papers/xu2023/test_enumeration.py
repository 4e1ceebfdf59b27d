"""The paper's update: against joint matrices, laws, the other forms; packed matrices and the best assignments."""

from dataclasses import replace
from itertools import product as combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.papers.xu2023.cases import VARIANCES
from studies.papers.xu2023.enumeration import (
    COLUMNS,
    ENTRY,
    ROWS,
    Enumeration,
    alike,
    enumerate_best,
    inverse,
    product,
)
from studies.papers.xu2023.simulation import advance, detect, start
from trackers import Scan, find, prior
from trackers.batch import take
from trackers.dra import DataRegion, DataRegionState
from trackers.dra.filter import root
from trackers.dra.measurement import flatten, linearise_regions
from trackers.dra.regions import REGIONS
from trackers.dra.state import OBSERVED, PLACE

X = np.array([20, 30, 0, 3, 1, 0, 0.1, 2.4, 0.9, 2.4, -0.9])
P = np.diag([0.25, 0.25, 0.01, 0.25, 0.25, 0.01, 0.01, 0.04, 0.04, 0.04, 0.04])
Z = np.array([[17.9, 0.03, 2.2], [18.6, -0.01, 2.3]])
NOISE = np.array([[0.1, 0.005, 0.027]])
SCAN = Scan(Z, np.ones(2, bool), np.array([[0, 0, 0.1]]), np.array([[28, 0.5]]), NOISE)
OPEN = replace(VARIANCES, gate=100.0, interior_gate=100.0)  # no gate
PAPER = DataRegion(models=("cv",), parameters=OPEN, prior="uniform", form=Enumeration(200))
STATE = DataRegionState(np.ones(1), X[None], P[None])


@pytest.mark.parametrize(
    ("prior_of", "x", "y", "log_c1"),
    [("uniform", 20.026510, 2.505982, 0.537121), ("rays", 20.063277, 2.459708, 1.152288)],
)
def test_updates_are_those_of_an_independent_implementation(prior_of, x, y, log_c1):
    state, info = replace(PAPER, prior=prior_of).update(STATE, SCAN)
    np.testing.assert_allclose(state.m[0, [0, 3]], [x, y], atol=2e-6)
    np.testing.assert_allclose(info.log_likelihood, log_c1, atol=2e-6)


def test_the_update_is_a_loop_over_all_hypotheses():
    """(23) to (28) of the paper with one matrix of all measurements for each of the 25 hypotheses."""
    _, flat = flatten(SCAN, tuple(NOISE[0]))
    L = root(X, P)
    regions = linearise_regions(X[None, None], L[None, None], flat)
    zbar, D, B = regions.zbar[0, 0, 0], regions.D[0, 0, 0], regions.B[0, 0, 0]
    weights, means, covs = [], [], []
    for phi in combinations(range(5), repeat=2):
        H = np.concatenate([D[i] for i in phi])
        S = H @ H.T
        for r, i in enumerate(phi):
            S[3 * r : 3 * r + 3, 3 * r : 3 * r + 3] += B[i]
        nu = np.concatenate([z - zbar[i] for z, i in zip(flat.z[0], phi, strict=True)])
        K = H.T @ np.linalg.inv(S)
        log_w = -0.5 * (nu @ np.linalg.solve(S, nu) + np.linalg.slogdet(2 * np.pi * S)[1]) + 2 * np.log(0.2)
        weights.append(log_w)
        means.append(X + L[:, :9] @ K @ nu)
        covs.append(P - L[:, :9] @ K @ H @ L[:, :9].T)
    w = np.exp(weights) / np.exp(weights).sum()
    mean = w @ np.array(means)
    d = np.array(means) - mean
    cov = np.einsum("h,hij->ij", w, np.array(covs) + d[:, :, None] * d[:, None])
    state, info = PAPER.update(STATE, SCAN)
    # what is e^-15 less likely than the best is left out
    np.testing.assert_allclose(state.m[0], mean, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(state.P[0], cov, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(info.log_likelihood, np.log(np.exp(weights).sum()), rtol=1e-5)


@given(seed=st.integers(0, 2**32 - 1))
def test_objects_side_by_side_are_updated_as_alone_and_order_and_padding_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    x = np.repeat(start()[None], 4, 0)
    radar = x.copy()
    radar[:, PLACE] += rng.uniform(-30, -15, (4, 2))
    scan = detect(x, radar, rng)
    mask = scan.mask & (rng.random(scan.mask.shape) < [[1.0], [0.7], [0.3], [0.0]])
    f = find("edra-imm", form=Enumeration())
    pose = x[:, [0, 3, 6]] + rng.normal(0, [0.5, 0.5, 0.05], (4, 3))
    state = f.init(prior(pose, velocity=x[:, [1, 4]]))
    together, info = f.update(state, scan._replace(mask=mask))
    M = mask.shape[1]
    for b in range(4):
        order = rng.permutation(M)
        polar = np.concatenate([scan.polar[b, order], np.full((2, 3), np.nan)])
        padded = Scan(polar, np.append(mask[b, order], [False] * 2), scan.pose[b], scan.velocity[b], scan.noise)
        alone, alone_info = f.update(take(state, b), padded)
        got, want = (*take(together, b), info.log_likelihood[b]), (*alone, alone_info.log_likelihood)
        for one, other in zip(got, want, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8)


def test_near_singular_covariances_and_bodies_give_finite_states():
    f = find("edra-imm", form=Enumeration())
    begin = f.init(prior((20.0, 3.0, 0.0), velocity=(30.0, 1.0)))
    point = begin.m.copy()
    point[..., 7:] = 0.0
    for m, cov in ((begin.m, 1e-12 * begin.P), (point, begin.P)):
        state, _ = f.update(begin._replace(m=m, P=cov), SCAN)
        assert all(np.isfinite(a).all() for a in state)
        assert np.isfinite(f.estimate(state).size).all()


def error(form, runs, steps, seed, more):
    """RMSE of the position [m] over the second half of some steps beside a car with 1 + `more` detections a scan."""
    f, rng = find("edra-imm", form=form), np.random.default_rng(seed)
    x = np.repeat(start()[None], runs, 0)
    radar = x.copy()
    radar[:, PLACE] += [-18.0, -12.0]
    begin = x[:, [0, 3, 6]] + rng.normal(0, [0.4, 0.4, 0.02], (runs, 3))
    state = f.init(prior(begin, velocity=x[:, [1, 4]] + rng.normal(0, 0.4, (runs, 2)), heading_std=0.02))
    errors = []
    for k in range(steps):
        x, radar = advance(x, k, rng, True), advance(radar, k, rng, False)
        scans = [detect(x, radar, rng) for _ in range(more)]
        scan = scans[0]._replace(
            polar=np.concatenate([s.polar for s in scans], 1), mask=np.concatenate([s.mask for s in scans], 1)
        )
        state, _ = f.update(f.predict(state, 0.1), scan)
        if 2 * k > steps:
            errors.append(f.estimate(state).pose[:, :2] - x[:, PLACE])
    return np.sqrt((np.array(errors) ** 2).sum(-1).mean())


def test_moment_matching_does_as_well_as_the_enumeration_at_six_detections():
    joint, sequential = error(Enumeration(128), 8, 40, 1, 1), error("sequential", 8, 40, 1, 1)
    assert sequential == pytest.approx(joint, rel=0.25)
    assert sequential < 0.25


def test_with_many_detections_a_capped_enumeration_is_overconfident_and_the_linear_forms_are_not():
    capped = error(Enumeration(8), 4, 20, 2, 7)
    assert error("sequential", 4, 20, 2, 7) < 0.7 * capped
    assert error("soft", 4, 20, 2, 7) < 0.9 * capped


def test_the_best_assignments_are_the_best():
    score = np.random.default_rng(0).normal(0, 1, (1, 1, 4, 5))
    found = enumerate_best(score, np.array([4]), 7)
    all_sums = sorted(sum(score[0, 0, r, i] for r, i in enumerate(phi)) for phi in combinations(range(5), repeat=4))
    got = [score[0, 0, range(4), phi].sum() for phi in found.region[0, 0]]
    np.testing.assert_allclose(sorted(got), all_sums[-7:], rtol=1e-12)


def test_a_cap_of_no_hypothesis_is_refused():
    with pytest.raises(ValueError, match="cap must be at least 1"):
        Enumeration(0)


# -- parts ------------------------------------------------------------------------------------------------------------


def positive_definite(rng, count, scale):
    """Matrices (count, 9, 9) as the information matrices are: the identity and more."""
    D = scale * rng.standard_normal((count, OBSERVED, 3))
    return np.eye(OBSERVED) + D @ D.mT


@given(st.integers(0, 2**32), st.integers(1, 20), st.floats(0.01, 300))
def test_packed_inverses_products_and_determinants_are_those_of_the_whole_matrices(seed, count, scale):
    rng = np.random.default_rng(seed)
    A, v = positive_definite(rng, count, scale), rng.standard_normal((count, OBSERVED))
    packed = np.ascontiguousarray(A[:, ROWS, COLUMNS].T)
    np.testing.assert_allclose(product(packed, v.T).T, (A @ v[..., None])[..., 0], rtol=1e-9, atol=1e-9 * scale**2)
    C, log_det = inverse(packed)
    # elimination is the worse the further the largest eigenvalue is from one
    np.testing.assert_allclose(C[ENTRY].transpose(2, 0, 1), np.linalg.inv(A), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(log_det, np.linalg.slogdet(A)[1], rtol=1e-9, atol=1e-9)


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

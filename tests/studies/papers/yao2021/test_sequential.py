"""The paper's update of one ellipse after the other: a loop of Kalman updates, laws, and next to the update of all."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studies.papers.yao2021.sequential import OneByOne
from trackers import Scan, prior
from trackers.batch import take
from trackers.geometry import rotation, to_world
from trackers.pmht import SplinePmht
from trackers.pmht.association import SyntheticDetections, columns, congruence, matrices
from trackers.pmht.joint import predict_ellipses
from trackers.pmht.model import find
from trackers.range_rate import RangeRates

MODEL = find("yao2021")
SIZE = np.array([5.0, 2.0])
PAPER = SplinePmht(MODEL, "none", OneByOne(), rates=RangeRates(weight=0.0), sigma=0.05)


def outline_scan(rng, pose, count, lead=(), noise=0.1):
    """Detections on the outline of the model."""
    l = rng.integers(0, 24, (*lead, count))
    body = MODEL.mu[l] * SIZE + noise * rng.standard_normal((*lead, count, 2))
    return Scan.from_xy(to_world(np.asarray(pose, float), body))


def test_the_update_is_a_loop_of_kalman_updates():
    rng = np.random.default_rng(2)
    m = np.array([3.0, -2.0, 0.7, 11.0, 0.05, 5.0, 2.0])
    S = rng.standard_normal((7, 7)) * np.array([0.2, 0.2, 0.03, 0.3, 0.03, 0.2, 0.1])[:, None]
    P = S @ S.T + 1e-4 * np.eye(7)
    M = rng.uniform(0, 2, 24)
    M[3] = 0.0
    A = rotation(m[2]) * m[5:]
    E = congruence(A) @ columns(MODEL.Sigma)
    z = MODEL.mu @ A.T + 0.1 * rng.standard_normal((24, 2))
    R = np.tile([[0.0025], [0.0], [0.0025]], 24)
    got_m, got_P = OneByOne().update(m, P, MODEL.mu.T, E, SyntheticDetections(M, z.T, R))
    start = m[:2]
    for l in np.flatnonzero(M):
        now = predict_ellipses(m, P, MODEL.mu[l : l + 1].T)
        S = matrices(now.C)[0] + (A @ MODEL.Sigma[l] @ A.T + 0.0025 * np.eye(2)) / M[l]
        C = now.T @ now.h[..., 0]
        K = C @ np.linalg.inv(S)
        m, P = m + K @ (start + z[l] - m[:2] - now.c[:, 0]), P - K @ S @ K.T
    np.testing.assert_allclose(got_m, m, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(got_P, P, atol=1e-10)


@given(seed=st.integers(0, 2**32 - 1))
def test_order_padding_and_batches_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    pose = np.array([10.0, 5.0, 0.4])
    scan = outline_scan(rng, pose, 8, (3,))
    state = PAPER.init(prior(np.tile(np.add(pose, [0.2, -0.1, 0.02]), (3, 1)), velocity=(10.0, 0.0), size=SIZE))
    batch, _ = PAPER.update(PAPER.predict(state, 0.1), scan)
    order = rng.permutation(8)
    for i in range(3):
        polar = np.concatenate([scan.polar[i, order], np.full((2, 3), np.nan)])
        alone = PAPER.predict(take(state, i), 0.1)
        got, _ = PAPER.update(alone, scan._replace(polar=polar, mask=np.arange(10) < 8))
        for a, b in zip(got, batch, strict=True):
            np.testing.assert_allclose(a, b[i], rtol=1e-7, atol=1e-9)


def test_detections_all_around_correct_every_state_that_they_show_as_all_at_once_does():
    pose = np.array([10.0, 5.0, 0.4])
    scan = outline_scan(np.random.default_rng(6), pose, 400, noise=0.05)
    start = prior(
        np.add(pose, [0.3, -0.2, 0.05]), size=np.add(SIZE, [0.3, -0.1]), size_std=(0.3, 0.15), heading_std=0.1
    )
    for f in (replace(PAPER, iterations=12), replace(PAPER, form="joint", iterations=12)):
        estimate = f.estimate(f.update(f.init(start), scan)[0])
        np.testing.assert_allclose(estimate.pose, pose, atol=0.05)
        np.testing.assert_allclose(estimate.size, SIZE, atol=0.12)

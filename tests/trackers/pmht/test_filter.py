"""UKF-PMHT on a spline: transforms and updates against plain loops, laws, limits, lost associations."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers import Scan, SensorModel, prior
from trackers.geometry import rotation, to_world, unit
from trackers.pmht import SplinePmht, SplineState, Walk
from trackers.pmht.association import RelativeDetections, SyntheticDetections, columns, congruence, matrices, synthesise
from trackers.pmht.joint import Doubt, missing, predict_ellipses
from trackers.pmht.joint import update as joint_update
from trackers.pmht.model import find
from trackers.pmht.state import predicted, rotating_root, turned
from trackers.range_rate import RangeRates
from trackers.unscented import STANDARD, sigma_points

MODEL = find("yao2021")
PAPER = SplinePmht(MODEL, "none", rates=RangeRates(weight=0.0), sigma=0.05)
CAR = SplinePmht("surround-car+surround-truck", walk=Walk(0.4, 0.026, 1e-3))
SIZE = np.array([5.0, 2.0])


def state_at(rng, lead=()):
    """A state with all correlations."""
    m = np.array([3.0, -2.0, 0.7, 11.0, 0.05, 5.0, 2.0])
    S = rng.standard_normal((*lead, 7, 7)) * np.array([0.2, 0.2, 0.03, 0.3, 0.03, 0.2, 0.1])[:, None]
    P = S @ S.mT + 1e-4 * np.eye(7)
    one = PAPER.init(prior(np.zeros((*lead, 3)), size=SIZE))
    return one._replace(m=np.broadcast_to(m, (*lead, 7)).copy(), P=P)


def outline_scan(rng, pose, count=20, lead=(), noise=0.1):
    """Detections on the outline of the model."""
    l = rng.integers(0, 24, (*lead, count))
    body = MODEL.mu[l] * SIZE + noise * rng.standard_normal((*lead, count, 2))
    return Scan.from_xy(to_world(np.asarray(pose, float), body))


def literal_moments(m, P, l):
    """The nine-dimensional augmented transform of one ellipse, point by point."""
    A9 = np.zeros((9, 9))
    A9[:7, :7], A9[7:, 7:] = P, MODEL.Sigma[l]
    T = np.zeros((9, 9))
    T[:7, :7], T[7:, 7:] = rotating_root(P), np.linalg.cholesky(MODEL.Sigma[l])
    m9, reach = np.concatenate([m, MODEL.mu[l]]), np.sqrt(STANDARD.reach(9))
    X = np.concatenate([[m9], m9 + reach * T.T, m9 - reach * T.T])
    y = np.array([x[:2] + rotation(x[2]) @ (x[5:7] * x[7:]) for x in X])
    Wm, Wc = STANDARD.weights(9)
    z = Wm @ y
    return z, (Wc[:, None] * (y - z)).T @ (y - z), (Wc[:, None] * (X[:, :7] - m)).T @ (y - z), T


def test_the_closed_form_is_the_literal_augmented_transform():
    s = state_at(np.random.default_rng(0))
    expected = predict_ellipses(s.m, s.P, MODEL.mu.T)
    E = congruence(rotation(s.m[2]) * s.m[5:]) @ columns(MODEL.Sigma)
    for l in range(24):
        z, C, D, _ = literal_moments(s.m, s.P, l)
        np.testing.assert_allclose(expected.c[:, l] + s.m[:2], z, atol=1e-12)
        got = matrices(expected.C)[l]
        A = rotation(s.m[2]) * s.m[5:]
        np.testing.assert_allclose(got + A @ MODEL.Sigma[l] @ A.T, C, atol=1e-12)
        np.testing.assert_allclose(expected.T @ expected.h[..., l], D, atol=1e-12)
        np.testing.assert_allclose(matrices(E)[l], A @ MODEL.Sigma[l] @ A.T, rtol=1e-12)


def made_synthetic(rng, m):
    centre = MODEL.mu @ (rotation(m[2]) * m[5:]).T + 0.1 * rng.standard_normal((24, 2))
    M = rng.uniform(0, 2, 24)
    M[3] = 0.0
    return SyntheticDetections(M, centre.T, np.tile([[0.0025], [0.0], [0.0025]], 24))


def test_the_joint_update_is_the_information_form_of_plain_matrices():
    rng = np.random.default_rng(1)
    s = state_at(rng)
    z = made_synthetic(rng, s.m)
    expected, E = predict_ellipses(s.m, s.P, MODEL.mu.T), congruence(rotation(s.m[2]) * s.m[5:]) @ columns(MODEL.Sigma)
    J, score = np.linalg.inv(s.P), np.zeros(7)
    for l in range(24):
        if z.M[l] == 0:
            continue
        zp, C, D, _ = literal_moments(s.m, s.P, l)
        A = rotation(s.m[2]) * s.m[5:]
        C = C - A @ MODEL.Sigma[l] @ A.T
        V = (A @ MODEL.Sigma[l] @ A.T + 0.0025 * np.eye(2)) / z.M[l]
        H = D.T @ np.linalg.inv(s.P)
        W = C - H @ D + V
        J += H.T @ np.linalg.solve(W, H)
        score += H.T @ np.linalg.solve(W, z.z[:, l] - (zp - s.m[:2]))
    m, P = joint_update(s.m, expected, E, z)
    np.testing.assert_allclose(P, np.linalg.inv(J), rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(m, s.m + np.linalg.solve(J, score), rtol=1e-9, atol=1e-10)


def test_what_is_known_of_a_place_is_the_curvature_of_the_likelihood_without_associations():
    """Complete less missing information against second differences of log p(z), in whitened coordinates."""
    rng, L, M = np.random.default_rng(6), 24, 9
    s = state_at(rng)
    s = s._replace(P=1e-4 * s.P)  # nearly linear
    expected, R = predict_ellipses(s.m, s.P, MODEL.mu.T), np.tile([[0.01], [0.0], [0.01]], M)
    E = congruence(rotation(s.m[2]) * s.m[5:]) @ columns(MODEL.Sigma)
    z = expected.c[:, rng.integers(0, L, M)] + 0.3 * rng.standard_normal((2, M))
    S, pi, rest = matrices(E) + 0.01 * np.eye(2), rng.dirichlet(np.ones(L)), 0.01

    def joint(u):
        c = expected.c + np.einsum("kil,k->il", expected.h, u)
        d = z.T[:, None] - c.T
        power = np.einsum("mli,lij,mlj->ml", d, np.linalg.inv(S), d)
        return pi * np.exp(-0.5 * power) / (2 * np.pi * np.sqrt(np.linalg.det(S)))

    def log_likelihood(u):
        return np.log(joint(u).sum(-1) + rest).sum()

    steps = 0.5 * np.eye(7)
    curvature = np.array([[
        log_likelihood(a + b) - log_likelihood(a - b) - log_likelihood(b - a) + log_likelihood(-a - b) for a in steps
    ] for b in steps])  # fmt: skip
    w = joint(np.zeros(7))
    w = w / (w.sum(-1, keepdims=True) + rest)
    doubt = Doubt(w, RelativeDetections(z, R, np.ones(M, bool)), 1.0)
    got = missing(expected, E + 0.01 * np.array([[1.0], [0.0], [1.0]]), doubt, np.zeros(7))
    complete = np.einsum("l,kil,lij,njl->kn", w.sum(0), expected.h, np.linalg.inv(S), expected.h)
    np.testing.assert_allclose(complete - got, -curvature, atol=2e-3 * np.abs(complete).max())
    assert np.abs(got).max() > 0.3 * np.abs(complete).max()
    _, P = joint_update(s.m, expected, E, synthesise(w, doubt.detections), doubt)
    assert np.linalg.eigvalsh(P).min() > 0


def seen_in_part(f, doubt=0.0, scans=20):
    """Error across [m] and claimed standard deviation of a car ahead, whose rear is half out of the field of view."""
    rng, models = np.random.default_rng(7), (SensorModel(fov=np.radians(20.0), max_range=100.0),)
    f = replace(f, doubt=doubt)
    f = f.on_sensors(models) if f.sensors else f
    pose = np.array([20.0, 20.0 * np.tan(np.radians(10.0)), 0.0])
    state = f.init(prior(pose, size=(4.6, 1.86), size_std=(0.01, 0.01), position_std=0.4, heading_std=0.01))
    for _ in range(scans):
        y = pose[1] - rng.uniform(0.0, 0.93, 4)  # the right half
        xy = np.stack([np.full(4, 17.7), y], -1) + 0.1 * rng.standard_normal((4, 2))
        state, _ = f.update(state, Scan.from_xy(xy, noise=(0.1, 0.1 / 17.0, 0.1)))
    return state.m[1] - pose[1], np.sqrt(state.P[1, 1])


def test_what_lies_out_of_the_field_of_view_is_not_missed():
    seeing = replace(CAR, sensors=(SensorModel(),))
    assert abs(seen_in_part(seeing)[0]) < 0.11
    assert seen_in_part(CAR)[0] < -0.14


def test_who_does_not_know_the_ellipses_of_its_detections_is_less_sure_of_its_place():
    """Detections in the middle of a face say little of where it is across."""
    sure, unsure = (seen_in_part(CAR, doubt, scans=1)[1] for doubt in (0.0, 0.9))
    assert unsure > 1.3 * sure


def test_prediction_is_the_plain_transform_and_without_a_turn_it_is_straight():
    s = state_at(np.random.default_rng(3))
    Wm, _ = STANDARD.weights(7)
    X = sigma_points(s.m, s.P)
    got = predicted(s.m, s.P, Walk(), 0.5)
    np.testing.assert_allclose(got.mean, Wm @ turned(X, 0.5), atol=2e-3)  # another root of P, the same order
    straight = s.m.copy()
    straight[4] = 0.0
    np.testing.assert_allclose(turned(straight, 2.0)[:2], straight[:2] + 22.0 * unit(straight[2]), rtol=1e-12)
    nearly = straight.copy()
    nearly[4] = 1e-9
    np.testing.assert_allclose(turned(nearly, 2.0), turned(straight, 2.0), atol=1e-7)


def test_no_time_changes_nothing_and_noise_is_a_density():
    s = state_at(np.random.default_rng(4))
    still = predicted(s.m, s.P, Walk(), 0.0)
    np.testing.assert_allclose(still.mean, s.m, atol=1e-12)
    np.testing.assert_allclose(still.cov, s.P, atol=1e-12)
    np.testing.assert_allclose(2 * Walk().covariance(0.5), Walk().covariance(1.0), rtol=1e-12)


@pytest.mark.parametrize("f", [PAPER, CAR, replace(CAR, visibility="none")])
@given(seed=st.integers(0, 2**32 - 1))
def test_order_padding_and_batches_do_not_matter(f, seed):
    rng = np.random.default_rng(seed)
    pose = np.array([10.0, 5.0, 0.4])
    scan = outline_scan(rng, pose, 8, (3,))
    state = f.init(prior(np.tile(np.add(pose, [0.2, -0.1, 0.02]), (3, 1)), velocity=(10.0, 0.0), size=SIZE))
    batch, _ = f.update(f.predict(state, 0.1), scan)
    order = rng.permutation(8)
    for i in range(3):
        one = SplineState(*(leaf[i] for leaf in state))
        polar = np.concatenate([scan.polar[i, order], np.full((2, 3), np.nan)])
        got, _ = f.update(f.predict(one, 0.1), scan._replace(polar=polar, mask=np.arange(10) < 8))
        for a, b in zip(got, batch, strict=True):
            np.testing.assert_allclose(a, b[i], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("f", [PAPER, CAR])
@given(turn=st.floats(-3, 3), seed=st.integers(0, 2**32 - 1))
def test_turning_the_world_turns_the_answer(f, turn, seed):
    rng = np.random.default_rng(seed)
    pose = np.array([10.0, 5.0, 0.4])
    scan = outline_scan(rng, pose, 8)
    state = f.init(prior(np.add(pose, [0.2, -0.1, 0.02]), velocity=(9.0, 4.0), size=SIZE))
    got, _ = f.update(f.predict(state, 0.1), scan)
    R = rotation(turn)
    other = scan._replace(pose=np.add(scan.pose, [0.0, 0.0, turn]))
    begin = np.concatenate([R @ (np.add(pose, [0.2, -0.1, 0.02]))[:2], [pose[2] + 0.02 + turn]])
    rotated = f.init(prior(begin, velocity=R @ [9.0, 4.0], size=SIZE))
    again, _ = f.update(f.predict(rotated, 0.1), other)
    np.testing.assert_allclose(again.m[:2], R @ got.m[:2], atol=1e-6)
    np.testing.assert_allclose(again.m[2:] - [turn, 0, 0, 0, 0], got.m[2:], atol=1e-6)


def test_ten_kilometres_away_nothing_is_lost():
    rng = np.random.default_rng(5)
    pose, far = np.array([10.0, 5.0, 0.4]), np.array([8e3, -6e3, 0.0])
    scan = outline_scan(rng, pose)
    moved = scan._replace(pose=scan.pose + far)
    near, _ = PAPER.update(PAPER.init(prior(pose, size=SIZE)), scan)
    away, _ = PAPER.update(PAPER.init(prior(pose + far, size=SIZE)), moved)
    np.testing.assert_allclose(away.m - near.m, [*far[:2], 0, 0, 0, 0, 0], atol=1e-9)


def test_an_empty_scan_changes_nothing():
    state = CAR.init(prior((10.0, 5.0, 0.4)))
    got, info = CAR.update(state, Scan.from_xy(np.zeros((3, 2)), np.zeros(3, bool)))
    assert got is state
    assert np.isnan(info.nis)
    assert not info.lost
    assert info.notes == ()


def test_detections_all_around_correct_every_state_that_they_show():
    rng = np.random.default_rng(6)
    f = replace(PAPER, iterations=12)
    pose = np.array([10.0, 5.0, 0.4])
    scan = outline_scan(rng, pose, 400, noise=0.05)
    start = prior(
        np.add(pose, [0.3, -0.2, 0.05]), size=np.add(SIZE, [0.3, -0.1]), size_std=(0.3, 0.15), heading_std=0.1
    )
    got, _ = f.update(f.init(start), scan)
    estimate = f.estimate(got)
    np.testing.assert_allclose(estimate.pose, pose, atol=0.05)
    np.testing.assert_allclose(estimate.size, SIZE, atol=0.12)
    assert (estimate.size_std < [0.3, 0.15]).all()


def test_a_lost_association_is_noted_and_recovered_at_once():
    rng = np.random.default_rng(7)
    pose = np.array([30.0, 5.0, 0.4])
    scan = outline_scan(rng, pose, 40)
    start = prior(np.add(pose, [5.0, 3.5, 0.0]), size=SIZE, position_std=0.15)  # far off, and sure of it
    found, info = PAPER.update(PAPER.init(start), scan)
    ignored, _ = replace(PAPER, lost_below=0.0).update(PAPER.init(start), scan)
    assert info.lost
    (note,) = info.notes
    assert note.kind == "lost"
    assert note.where
    assert info.share < 0.5
    assert np.linalg.norm(found.m[:2] - pose[:2]) < 0.6
    assert np.linalg.norm(ignored.m[:2] - pose[:2]) > 3.0
    _, again = PAPER.update(found, scan)
    assert not again.lost
    assert again.share > 0.9


def test_clutter_is_left_out_when_its_density_is_known():
    rng = np.random.default_rng(8)
    pose, wrong = np.array([30.0, 5.0, 0.4]), {0.0: [], 0.05: []}
    for _ in range(60):
        body = outline_scan(rng, pose, 12).xy
        clutter = pose[:2] + rng.uniform(-5, 5, (5, 2))
        scan = Scan.from_xy(np.concatenate([body, clutter]))
        for density in wrong:
            f = replace(PAPER, eps=density / 12.0 + 1e-8)
            got, _ = f.update(f.init(prior(pose, size=SIZE, position_std=0.5)), scan)
            wrong[density].append(((got.m[:2] - pose[:2]) ** 2).sum())
    assert np.mean(wrong[0.05]) < 0.8 * np.mean(wrong[0.0])


def test_range_rates_correct_the_speed():
    pose = np.array([30.0, 0.0, 0.1])
    rng = np.random.default_rng(9)
    scan = outline_scan(rng, pose, 20)
    rate = scan.sight @ (20.0 * unit(0.1))
    scan = scan._replace(polar=np.concatenate([scan.polar[:, :2], rate[:, None]], -1))
    start = CAR.init(prior(pose, velocity=19.0 * unit(0.1), velocity_std=2.0, size=SIZE))
    with_, _ = CAR.update(start, scan)
    without, _ = replace(CAR, rates=RangeRates(weight=0.0)).update(start, scan)
    assert abs(with_.m[3] - 20) < 0.3
    assert abs(without.m[3] - 19) < 0.1


def test_one_side_pulls_the_centre_only_with_equal_weights():
    """A box seen from behind: with equal weights its detections are also shared out to sides that nobody sees."""
    rng = np.random.default_rng(10)
    model = CAR.models[0]
    sensor, truth = np.array([0.0, 0.0]), np.array([20.0, 0.0, 0.0])
    rear = np.flatnonzero(model.mu[:, 0] < -0.42)
    errors = {"rays": [], "none": []}
    for _ in range(40):
        l = rng.choice(rear, 10)
        draw = np.array([rng.multivariate_normal(model.mu[i], model.Sigma[i]) for i in l])
        scan = Scan.from_xy(to_world(truth, draw * model.size), pose=np.array([*sensor, 0.0]), noise=(0.05, 0.002, 0.1))
        for name in errors:
            f = replace(CAR, visibility=name)
            start = prior(np.add(truth, [0.4, 0.0, 0.0]), velocity=(20.0, 0.0), size=model.size, position_std=0.7)
            got, _ = f.update(f.init(start), scan)
            errors[name].append(got.m[0] - truth[0])
    assert abs(np.mean(errors["rays"])) < 0.1
    assert np.mean(np.square(errors["rays"])) <= 1.05 * np.mean(np.square(errors["none"]))


def test_the_density_over_the_body_is_that_of_the_update_and_integrates_to_one():
    state = CAR.init(prior([[20.0, 3.0, 0.2]], position_std=1e-3))
    xy = np.stack(np.meshgrid(np.arange(15, 25, 0.05), np.arange(-1, 7, 0.05)), -1).reshape(-1, 2)
    scan = Scan.from_xy(xy, noise=(0.1, 0.005, 0.1))
    log_p = CAR.log_spatial(state, scan, np.zeros(len(xy), int), np.arange(len(xy)))
    assert np.exp(log_p).sum() * 0.05**2 == pytest.approx(1.0, abs=0.03)
    near = xy[np.argmax(log_p)]
    assert np.linalg.norm(near) < 20  # on the side that faces the sensor


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"visibility": "some"}, "visibility must be one of rays, none"),
        ({"form": "both"}, "form must be joint or an EllipseUpdate"),
        ({"iterations": 0}, "iterations must be a whole number > 0"),
        ({"inflation": 1.0}, "inflation must be > 1"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(change, text):
    with pytest.raises(ValueError, match=text):
        replace(PAPER, **change)

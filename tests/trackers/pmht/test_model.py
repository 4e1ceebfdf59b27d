"""The closed spline, the models upon it, and what of them a sensor sees."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from trackers.geometry import unit
from trackers.pmht import SplineModel
from trackers.pmht import model as models
from trackers.pmht.model import as_json, basis, chain, curve, find, outlines, resolve, slope_basis
from trackers.pmht.offline import rectangle_start
from trackers.pmht.visibility import DIRECTIONS, directions, visibility_table, weights

BOX = rectangle_start()
SIZE = np.array([5.0, 2.0])


@given(n_c=st.integers(4, 20), degree=st.integers(1, 3), seed=st.integers(0, 2**32 - 1))
def test_the_basis_is_a_partition_of_unity_and_closes(n_c, degree, seed):
    r = np.random.default_rng(seed).uniform(0, n_c, 20)
    B = basis(r, n_c, degree)
    assert (B >= 0).all()
    np.testing.assert_allclose(B.sum(1), 1, atol=1e-12)
    np.testing.assert_allclose(basis(r + n_c, n_c, degree), B, atol=1e-12)
    np.testing.assert_allclose(slope_basis(r, n_c, degree).sum(1), 0, atol=1e-12)


def test_the_basis_is_that_of_scipy():
    n_c, d, r = 7, 3, np.linspace(3.0, 6.99, 40)
    for j in range(n_c - d):
        want = BSpline.basis_element(np.arange(j, j + d + 2), extrapolate=False)(r)
        np.testing.assert_allclose(basis(r, n_c, d)[:, j], np.nan_to_num(want), atol=1e-12)


def test_tangents_are_differences_of_the_curve():
    r, h = np.linspace(0, 12, 50), 1e-6
    difference = (basis(r + h, 12, 3) - basis(r - h, 12, 3)) / (2 * h)
    np.testing.assert_allclose(slope_basis(r, 12, 3), difference, atol=1e-8)


def test_fewer_ellipses_than_control_points_are_refused():
    with pytest.raises(ValueError, match="at least n_c = 12"):
        chain(11, 12, 3)


def test_a_model_survives_its_file_and_a_damaged_one_is_refused(tmp_path):
    model = find("surround-car")
    path = tmp_path / "again.json"
    path.write_text(json.dumps(as_json(replace(model, name="again"), {"from": "here"})))
    again = find(str(path))
    np.testing.assert_allclose(again.p, model.p, atol=1e-6)
    np.testing.assert_allclose(again.Sigma, model.Sigma, rtol=1e-5)
    assert (again.size, again.interior) == (model.size, model.interior)
    data = json.loads(path.read_text())
    for broken in ({}, data | {"points": [[1]]}, data | {"format": "other"}):
        path.write_text(json.dumps(broken))
        with pytest.raises(ValueError, match=r"again\.json"):
            models.load(path)


def test_models_of_one_filter_have_equal_numbers_of_ellipses():
    start = rectangle_start(16, 8)
    odd = SplineModel.of("odd", start.p, start.Sigma, (5.0, 2.0))
    assert len(resolve("surround-car+surround-truck")) == 2
    with pytest.raises(ValueError, match="equal numbers"):
        resolve((find("surround-car"), odd))
    with pytest.raises(LookupError, match=r"known: .*surround-car"):
        find("no-such-model")


def test_the_drawn_outline_lies_outside_the_curve_by_the_spread_of_the_ellipses():
    ring, wide = curve(BOX.p), outlines(BOX.p, BOX.Sigma, 1.0)
    assert np.ptp(wide[:, 0]) == pytest.approx(np.ptp(ring[:, 0]) + 2 * 0.06, abs=0.01)
    assert np.ptp(wide[:, 1]) == pytest.approx(np.ptp(ring[:, 1]) + 2 * 0.075, abs=0.01)


def test_from_ahead_the_front_is_seen_and_from_aside_the_side():
    table = visibility_table(BOX.p, SIZE, 24)
    mu = chain(24, 12) @ BOX.p * SIZE
    assert table.shape == (DIRECTIONS, 24)
    np.testing.assert_allclose(table.sum(-1), 1, atol=1e-12)
    assert table[0] @ mu[:, 0] == pytest.approx(2.3, abs=0.15)
    assert table[DIRECTIONS // 4] @ mu[:, 1] == pytest.approx(0.8, abs=0.1)
    assert (table[0][mu[:, 0] < -1] == 0).all()


def test_sight_of_a_symmetric_body_is_symmetric():
    table = visibility_table(BOX.p, SIZE, 24)
    mirror = -np.arange(24) % 24  # ellipses run from ahead, counter-clockwise
    np.testing.assert_allclose(table[-np.arange(DIRECTIONS) % DIRECTIONS][:, mirror], table, atol=1e-9)


def test_a_wheel_hides_the_bonnet_behind_it():
    """A tractor: the bonnet is 1 m, the rear wheels are 2 m wide."""

    r = np.linspace(0, 1, 24, endpoint=False)
    corners = np.array([[2.5, 0], [2.5, 0.5], [-0.5, 0.5], [-0.5, 1], [-2.5, 1], [-2.5, 0]])
    corners = np.concatenate([corners, corners[::-1] * [1, -1]])
    at = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    want = np.stack([np.interp(r * at[-1], at, corners[:, i]) for i in range(2)], -1) / SIZE
    p = np.linalg.lstsq(chain(24, 24), want, rcond=None)[0]
    mu = chain(24, 24) @ p * SIZE
    table = visibility_table(p, SIZE, 24)
    bonnet = (mu[:, 0] > -0.3) & (mu[:, 0] < 0.6) & (mu[:, 1] > 0)
    behind = round(DIRECTIONS * 160 / 360)  # from behind, a little to the left
    assert bonnet.any()
    assert table[behind][bonnet].sum() == 0
    assert table[DIRECTIONS // 4][bonnet].sum() > 0


@given(seed=st.integers(0, 2**32 - 1))
def test_weights_sum_to_one_and_change_without_a_jump(seed):
    rng = np.random.default_rng(seed)
    table = visibility_table(BOX.p, SIZE, 24)
    at = rng.uniform(-10, 10, (5, 24))
    w, near = weights(table, at, 0.02), weights(table, at + 1e-6, 0.02)
    np.testing.assert_allclose(w.sum(-1), 1, atol=1e-12)
    np.testing.assert_allclose(near, w, atol=1e-4)
    assert (w >= 0.02 / 24 - 1e-12).all()


def test_from_close_by_each_ellipse_has_its_own_direction():
    c = np.array([[2.0, -2.0], [0.0, 0.0]])
    d = directions(c, np.array(0.3), np.array([[0.0, 2.0]]))
    np.testing.assert_allclose(d[0] + 0.3, [np.arctan2(2, -2), np.arctan2(2, 2)], atol=1e-12)
    far = directions(c, np.array(0.0), 1e6 * unit(np.array([1.0])))
    np.testing.assert_allclose(far, 1.0, atol=1e-5)

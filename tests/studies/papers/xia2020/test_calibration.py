"""Calibrated frames: the mean score with respect to place and size vanishes, also under a wrong density."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from studies.papers.xia2020.calibration import calibrate, negative, score
from trackers.htg.bins import HTGTable, as_json, load
from trackers.htg.density import HTG, moments
from trackers.htg.learned import HTGLearned
from trackers.htg.learning import FitOptions, fit


def rear_data(count, seed):
    """Body coordinates and sizes [m]: the rear of cars, a metre across to the left, deeper than it is noisy."""
    rng = np.random.default_rng(seed)
    size = rng.uniform([4.0, 1.6], [5.4, 2.1], (count, 2))
    x = -size[:, 0] / 2 + rng.exponential(0.25, count)
    y = rng.uniform(-0.2, 1.0, count) * size[:, 1] / 2
    return np.stack([x, y], -1) + rng.normal(0, 0.1, (count, 2)), size


@cache
def learned(count, seed):
    """A table of one bin, and the data it was learned from."""
    body, size = rear_data(count, seed)
    return one_bin(body / (size / 2)), body, size


def one_bin(u):
    p = HTG(*(leaf[None] for leaf in fit(u, options=FitOptions(theta=0.0, screen=400)).p))
    return HTGTable(p, *moments(p), size=(4.7, 1.85))


def mean_scores(table, body, size):
    """Mean and standard error of the scores in place and log size, in unit coordinates."""
    h, shift = table.warp(size / 2, np.zeros(len(body), int))
    u = (body - shift) / h
    s = score(u, table.of(np.array(0)))
    f = np.concatenate([s, s * u + 1], -1)
    return f.mean(0), f.std(0) / np.sqrt(len(f))


def test_calibration_takes_the_bias_out_of_the_scores():
    table, body, size = learned(1500, 1)
    aspect = np.zeros(len(body))
    before, error = mean_scores(table, body, size)
    assert (np.abs(before) > 5 * error).any()  # the family alone is not closed under a shift
    fine = calibrate(table, body, size, aspect, mirrored=False)
    after, error = mean_scores(fine, body, size)
    assert (np.abs(after) < np.maximum(0.5 * error, 0.02)).all()
    fresh, error = mean_scores(fine, *rear_data(4000, 2))
    assert (np.abs(fresh) < 5 * error).all()


def test_gradient_of_the_likelihood_is_its_slope():
    rng = np.random.default_rng(0)
    u, variance = rng.normal(0, 0.8, (200, 2)), rng.uniform(0.01, 0.05, (200, 2))
    x = np.array([np.log(0.2), 0.6, 0.7, 0.5, 0.8, 0.2, *np.log([0.03, 0.05]), 0.1, -0.2, 0.05, -0.1])
    _, gradient = negative(x, u, variance)
    for e, g in zip(1e-6 * np.eye(12), gradient, strict=True):
        slope = (negative(x + e, u, variance)[0] - negative(x - e, u, variance)[0]) / 2e-6
        np.testing.assert_allclose(g, slope, rtol=1e-3, atol=1e-4)


def test_known_noise_is_left_out_of_r():
    table, body, size = learned(1500, 1)
    all_in_r = calibrate(table, body, size, np.zeros(1500), mirrored=False)
    known = calibrate(table, body, size, np.zeros(1500), noise=np.full((1500, 2), 0.1), mirrored=False)
    metres = [(t.p.r * t.scale**2)[0, 0] for t in (known, all_in_r)]
    assert metres[0] < metres[1]


def test_a_calibrated_table_survives_its_file_and_is_refused_by_the_literal_filter(tmp_path):
    table, body, size = learned(1500, 1)
    fine = replace(table, scale=np.array([[1.1, 0.9]]), shift=np.array([[0.1, -0.2]]))
    (tmp_path / "fine.json").write_text(json.dumps(as_json(fine)))
    got = load(str(tmp_path / "fine.json"))
    np.testing.assert_array_equal(got.scale, fine.scale)
    np.testing.assert_array_equal(got.shift, fine.shift)
    with pytest.raises(ValueError, match="coordinates of its own"):
        HTGLearned(got).model()
    assert HTGLearned(replace(got, scale=np.ones((1, 2)), shift=np.zeros((1, 2)))).model() is not None

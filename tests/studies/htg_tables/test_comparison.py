"""Densities held against each other on detections that they have not seen, and the page that shows it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

from studies.htg_tables.comparison import (
    MOST,
    HeldOut,
    cross_validate,
    folds,
    gap,
    inside_share,
    judge,
    table,
)
from studies.htg_tables.models import DensityModel, fit_gaussian, fit_mixture, fit_uniform
from studies.htg_tables.page import render, shipped
from studies.page import TABLES, as_csv
from testbed.learn.detections import GROWN, TrainingDetections

DOCS = Path(__file__).parents[3] / "docs"


def test_expectation_maximisation_finds_two_clusters_and_the_tied_form_needs_one_covariance():
    rng = np.random.default_rng(6)
    u = np.concatenate([rng.normal([-0.6, 0], 0.1, (300, 2)), rng.normal([0.6, 0], 0.1, (300, 2))])
    one, two = fit_gaussian(u), fit_mixture(u, 2, True, np.random.default_rng(0))
    true = np.log(0.5 / (2 * np.pi * 0.01)) - ((u - np.sign(u[:, :1]) * [0.6, 0]) ** 2).sum(1) / 0.02
    assert two(u).mean() == pytest.approx(true.mean(), abs=0.03)
    assert two(u).mean() > one(u).mean() + 0.5


def test_a_gaussian_has_the_density_of_the_textbook():
    u = np.random.default_rng(7).normal(size=(500, 2)) * [0.3, 0.5]
    d = u - u.mean(0)
    C = d.T @ d / len(u)
    textbook = -np.einsum("ni,ij,nj->n", d, np.linalg.inv(C), d) / 2 - np.log(2 * np.pi) - np.log(np.linalg.det(C)) / 2
    np.testing.assert_allclose(fit_gaussian(u)(u), textbook, rtol=1e-9)


def test_the_share_in_the_grown_box_is_one_for_the_uniform_and_known_for_a_gaussian():
    assert inside_share(fit_uniform(np.zeros((1, 2)))) == pytest.approx(1.0)
    u = np.random.default_rng(8).normal(size=(100_000, 2)) * 0.6
    assert inside_share(fit_gaussian(u)) == pytest.approx((np.abs(u) < GROWN).all(1).mean(), abs=3e-3)


def test_folds_are_blocks_of_consecutive_scans():
    scan = np.array([5, 5, 6, 8, 9, 9, 9, 12])
    assert folds(scan, 3).tolist() == [0, 0, 0, 1, 1, 1, 1, 2]
    with pytest.raises(ValueError, match="needs at least 9"):
        folds(scan, 9)


def test_a_model_is_judged_on_what_it_has_not_seen():
    rng = np.random.default_rng(9)
    u = np.concatenate([rng.normal(0, 0.1, (400, 2)), rng.normal([0.9, 0], 0.02, (100, 2))])
    held = np.arange(500) >= 400
    model = DensityModel("one Gaussian", 5, fit_gaussian, bins=1)
    plain, gated = judge(model, u, np.zeros(500), held).mean(1)
    assert plain < -20  # a cluster that it never saw
    assert gated == pytest.approx(plain, abs=1e-6)
    assert judge(model, u, np.zeros(500), ~held)[0].mean() < -5


def test_the_comparison_has_a_row_for_every_model():
    rng = np.random.default_rng(10)
    n = 800
    data = TrainingDetections(rng.uniform(-1, 1, (n, 2)), rng.uniform(-3, 3, n), None, np.arange(n), "made up")
    models = [DensityModel("uniform", 0, fit_uniform, bins=1), DensityModel("Gaussian", 5, fit_gaussian, bins=1)]
    rows = cross_validate(data, models, 4)
    assert rows[0].plain == pytest.approx(np.full(n, -np.log(5.76)))
    assert rows[0].gated == pytest.approx(rows[0].plain)
    lines = table(rows).splitlines()
    assert len(lines) == 4
    assert "| Gaussian | 5 |" in lines[3]
    assert gap(rows[1], rows[0], True).positive


def held_out(name, log_p):
    return HeldOut(DensityModel(name, 1, fit_uniform), log_p, log_p, np.ones(len(log_p), int))


def test_an_interval_takes_neighbouring_scans_for_one_draw():
    rng = np.random.default_rng(11)
    draws = rng.normal(0.1, 1.0, 40)
    base, row = held_out("base", np.zeros(400)), held_out("row", np.repeat(draws, 10))
    got = gap(row, base, gated=True)
    assert got.value == pytest.approx(draws.mean())
    assert got.half == pytest.approx(student.ppf(0.975, 39) * draws.std(ddof=1) / np.sqrt(40))


@pytest.mark.parametrize(("advantage", "resolved"), [(0.5, True), (-0.5, False), (0.0, None)])
def test_a_difference_is_resolved_where_its_interval_leaves_out_zero(advantage, resolved):
    noise = np.random.default_rng(12).normal(0, 0.3, 200)
    rows = [held_out("base", np.zeros(200)), held_out("row", noise - noise.mean() + advantage)]
    got = gap(rows[1], rows[0], True)
    assert got.positive is resolved
    np.testing.assert_allclose(got.value, advantage, atol=1e-12)


def test_the_committed_page_lists_the_shipped_tables_as_they_are():
    """On failure: put `as_csv(shipped())` into docs/results/tables/htg-tables/tables.csv."""
    assert as_csv(shipped()) == (DOCS / TABLES / "htg-tables" / "tables.csv").read_text()


def test_the_page_has_the_tables_and_the_comparisons():
    said = render(["### Cars\n\nfigures of cars", "### Trucks\n\nfigures of trucks"])
    assert shipped() in said
    assert "### Cars\n\nfigures of cars\n\n### Trucks" in said
    assert f"at most {MOST} detections" in said

"""Hoher et al. (2022) as reported: our figures against reference figures, and the answer on every claim."""

import json

import numpy as np
import pytest

from studies.papers.hoher2022.claims import longest_one_sided, stability
from studies.papers.hoher2022.experiment import CASES, REFERENCE, UTurnRuns, experiment, methods, run
from studies.papers.hoher2022.runs import MEASURES
from studies.papers.hoher2022.uturn import FIRST, SECOND, SHAPES, lidar_scans, truth

RUNS = 20
SMOOTH = (
    "RM",
    "C33",
    "G",
)  # the rest accepts and rejects on a grid of rays, or has weights that the reference does not state


@pytest.fixture(scope="module")
def reproduction(tmp_path_factory):
    out = tmp_path_factory.mktemp("hoher2022")
    return run(runs=RUNS, out=out), out


def tolerance(case, method, column, reference):
    """Bars of the reference: single deterministic runs, twice that on the grid; shares of 100 runs.

    Twenty runs instead of a hundred widen the standard errors of the mean, below 0.01 and 0.04 m, by 2.2.
    """
    loose = 1.0 if method.startswith(SMOOTH) else 2.0
    if column == "IoU":
        return loose * (0.02 if "sigma 0.0" in case else 0.04)
    if column == "tilt [deg]":
        return loose * 0.7
    return loose * (0.05 if "sigma 0.0" in case else max(0.1, 0.08 * abs(reference)))


@pytest.mark.slow
def test_the_reference_figures_are_met(reproduction):
    report, _ = reproduction
    off = []
    for row in report.rows:
        if row.method == "C naive" or row.case.startswith("drift"):
            continue  # the reference: "only clearly worse"; and the norm of a matrix step depends on the frame
        for column, reference in row.reference.items():
            error = abs(row.measured[column] - reference)
            if error > tolerance(row.case, row.method, column, reference):
                off.append(f"{row.case}, {row.method}, {column}: {row.measured[column]:.3f} for {reference}")
    compared = sum(len(row.reference) for row in report.rows)
    assert compared > 1000
    assert len(off) <= 0.02 * compared, "\n".join(off)


@pytest.mark.slow
def test_a_learned_tilt_has_the_error_of_the_reference(reproduction):
    report, _ = reproduction
    for row in report.rows:
        if row.case.startswith("drift") and not row.method.startswith("abc"):
            assert abs(row.measured["tilt [deg]"] - row.reference["tilt [deg]"]) < 2.5, row
            assert abs(row.measured["IoU"] - row.reference["IoU"]) < 0.08, row


@pytest.mark.slow
def test_the_verdicts_are_those_of_the_reference(reproduction):
    outcome = {v.claim.text[:24]: v.outcome for v in reproduction[0].answers}
    assert outcome["The adaptation gives a m"] == "confirmed"
    assert outcome["The algorithm as printed"].startswith("confirmed under")  # not on the ellipse at 0.5 m
    assert "ellipse, sigma 0.5" not in outcome["The algorithm as printed"]
    assert "sigma 0.0" in outcome["Seen from one side, the "]
    assert outcome["I = 2 iterations are qui"].startswith("confirmed under")
    assert outcome["The step rule is stable "] == "confirmed under body moments"
    assert outcome["Overwriting the filter's"] == "confirmed"
    assert "second path, ellipse, sigma 0.5" in outcome["Fed back correctly, the "]
    assert (
        "imaging" not in outcome["Fed back correctly, the "]
    )  # detections from inside: the offset is not the contour's
    assert "sigma 0.5" not in outcome["The virtual spread needs"]


@pytest.mark.slow
def test_the_adaptation_helps_on_contour_detections_of_our_radar_and_not_on_those_from_inside(reproduction):
    report, _ = reproduction
    for radar, helps in (("lidar-1deg", True), ("imaging", False)):
        case = f"our radar {radar}, rectangle"
        alone, with_it = (report.row(case, m) for m in ("RM corrected, 2 sigma", "C33 I=2"))
        assert (with_it["IoU"] > alone["IoU"] + 0.1) == helps, case
    assert report.answers[-1].outcome == "confirmed under our radar lidar-1deg, rectangle"


@pytest.mark.slow
def test_pictures_and_figures_are_written(reproduction):
    report, out = reproduction
    assert len(report.figures) == 7
    assert all(path.stat().st_size > 10_000 for path in report.figures)
    written = json.loads((out / "hoher2022.json").read_text())
    assert len(written["rows"]) == len(report.rows) == sum(len(c.methods) for c in CASES)
    assert len(written["verdicts"]) == 11


def test_the_course_and_the_lidar_are_those_of_the_reference():
    """195 steps of 0.5 m; 7 to 49 hits, 15 on average."""
    poses = FIRST.poses()
    assert len(poses) == 195
    np.testing.assert_allclose(poses[0], [25, 26, np.pi])
    np.testing.assert_allclose(poses[-1, 1:], [6, 2 * np.pi], atol=1e-9)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    np.testing.assert_allclose(steps, 0.5, atol=1e-3)
    hits = [int(s.mask.sum()) for s in lidar_scans(truth(FIRST, "rectangle"), 0.0, 1, np.random.default_rng(0))]
    assert (min(hits), max(hits), round(np.mean(hits))) == (7, 49, 15)
    np.testing.assert_allclose(SECOND.poses()[-1, 1:], [-8, 0], atol=1e-9)


def test_shapes_have_their_centroid_at_the_origin_and_their_size():
    size = {name: np.ptp(outline, axis=0) for name, outline in SHAPES.items()}
    np.testing.assert_allclose(size["tractor"], [4.5, 2.2])
    np.testing.assert_allclose(size["L"], [6.0, 2.4])
    np.testing.assert_allclose(size["rectangle"], [4.7, 1.8])
    assert longest_one_sided().stop - longest_one_sided().start == 19


def test_every_reference_belongs_to_a_row():
    rows = {(case.name, method) for case in CASES for method in case.methods}
    assert set(REFERENCE) <= rows


def test_one_noise_free_case_meets_the_preferred_bars():
    """The rows that do not depend on a grid of rays, on the first path; the quick twin of the slow test."""
    names = ("RM corrected, 1 sigma", "C33 I=2", "G I=1")
    found = UTurnRuns()
    experiment(1, 0, found, wanted=lambda case, name: case.name == "rectangle, sigma 0.0" and name in names)
    assert len(found.rows) == len(names)
    for row in found.rows:
        assert list(row.reference) == list(MEASURES)
        for column, reference in row.reference.items():
            bar = tolerance(row.case, row.method, column, reference)
            assert abs(row.measured[column] - reference) <= bar, (row.method, column)


def test_the_step_rule_is_unstable_end_on_with_eigenvalues_only():
    assert stability().outcome == "confirmed under body moments"


def test_methods_have_names_of_their_own():
    assert len(methods(0.1)) == 28

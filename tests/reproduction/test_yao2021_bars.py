"""Figures of an independent implementation with their tolerances: 100 runs of both methods on both contours."""

from functools import cache

import numpy as np
import pytest

from studies.papers.yao2021 import experiment as yao2021
from studies.papers.yao2021.simulation import CONTOURS, A, B, run_stages, simulate
from trackers.pmht.model import find

RUNS = 100


@cache
def measured(contour, method):
    """Figures of all stages, and lost runs."""
    runs = run_stages(
        {"A": A, "B": B}[method], find(yao2021.MODEL), simulate(CONTOURS[contour], RUNS, np.random.default_rng(1))
    )
    lost = sum(int(gone.sum()) for gone in runs.lost.values())
    return {stage: yao2021.measure(runs, stage, CONTOURS[contour]) for stage in runs.stages}, lost


BEFORE = {
    "truck": {"position m": (0.095, 0.125), "speed m/s": (0.025, 0.034), "heading rad": (0.005, 0.007)},
    "tractor": {"position m": (0.15, 0.22), "speed m/s": (0.030, 0.043), "heading rad": (0.011, 0.018)},
}
SMOOTHED = {
    "truck": {"position m": 0.99, "speed m/s": 0.93, "heading rad": 0.6},
    "tractor": {"position m": 0.97, "speed m/s": 0.93, "heading rad": 0.75},
}
ADAPTED = {
    ("truck", "A"): {"position m": 0.92, "heading rad": 1.1},
    ("tractor", "A"): {"position m": 0.82, "heading rad": 0.65},
    ("truck", "B"): {"position m": 0.50},
    ("tractor", "B"): {"position m": 0.35},
}
OVERLAP = {("truck", "A"): 0.90, ("tractor", "A"): 0.83, ("truck", "B"): 0.91, ("tractor", "B"): 0.88}


@pytest.mark.slow
@pytest.mark.parametrize("contour", CONTOURS)
@pytest.mark.parametrize("method", ["A", "B"])
def test_no_more_than_two_runs_are_lost(contour, method):
    assert measured(contour, method)[1] <= 2


@pytest.mark.slow
@pytest.mark.parametrize("contour", CONTOURS)
@pytest.mark.parametrize("method", ["A", "B"])
def test_the_filter_and_the_smoother_reach_the_reference(contour, method):
    stages, _ = measured(contour, method)
    for column, (low, high) in BEFORE[contour].items():
        assert low <= stages["before"][column] <= high, column
    for column, most in SMOOTHED[contour].items():
        assert stages["smoothed"][column] <= most * stages["before"][column], column


@pytest.mark.slow
@pytest.mark.parametrize(("contour", "method"), ADAPTED)
def test_the_adaptation_gains_what_the_reference_gains(contour, method):
    stages, _ = measured(contour, method)
    for column, most in ADAPTED[contour, method].items():
        assert stages["adapted"][column] <= most * stages["not adapted"][column], column
    assert stages["adapted"]["IoU"] >= OVERLAP[contour, method]


@pytest.mark.slow
@pytest.mark.parametrize(("contour", "most", "nees"), [("truck", 0.055, 6), ("tractor", 0.060, 7)])
def test_with_the_frame_moved_the_filter_is_accurate_and_consistent(contour, most, nees):
    adapted = measured(contour, "B")[0]["adapted"]
    assert adapted["position m"] <= most
    assert abs(adapted["offset m"]) <= 0.03
    assert 2 <= adapted["NEES"] <= nees

"""Statistics over trainings: by hand, and against each other."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

from studies.learned.figure import draw
from studies.learned.trainings import improvement, needed, profile, section
from testbed.evaluation.intervals import bootstrap_interval
from tests.studies.learned.test_page import DOCS, RESULTS, read_runs


def test_the_probability_of_improvement_counts_pairs_of_trainings():
    a, b = np.array([5.0, 6.0, 1.0]), np.array([4.0, 5.0])
    assert improvement(a, b) == pytest.approx((1 + 0.5 + 1 + 1 + 0 + 0) / 6)
    assert improvement(b, a) == pytest.approx(1 - improvement(a, b))
    drawn = np.stack([a, a[[0, 0, 0]]]), np.stack([b, b])
    np.testing.assert_allclose(improvement(*drawn), [improvement(a, b), 0.75])


def test_trainings_of_one_distribution_are_better_half_of_the_time():
    a, b = np.random.default_rng(0).normal(size=(2, 20))
    assert 0.5 in bootstrap_interval([a, b], improvement)
    assert 0.5 not in bootstrap_interval([a + 2, b], improvement)


def test_as_many_trainings_as_are_said_to_be_needed_resolve_the_difference():
    rng = np.random.default_rng(1)
    n = needed(np.array([-3.0, 3.0]) / np.sqrt(2), np.array([-1.0, 1.0]) / np.sqrt(2), 2.0)  # spreads 3 and 1
    assert n == 20
    a, b = 3 * rng.normal(size=(2000, n)), 2 + rng.normal(size=(2000, n))
    z = (b.mean(1) - a.mean(1)) / np.sqrt(10 / n)
    assert (z > 1.96).mean() == pytest.approx(0.8, abs=0.03)


def test_a_training_on_tracks_is_compared_with_itself_on_the_truth():
    """Returns 10, 14 and 12 on tracks, each 2 less than on the truth, though the means of kinds would hide it."""
    rows = [
        {
            "scenario": k,
            "tracker": kind,
            "driven": on,
            "seed": 1000,
            "reward": of + extra + (2.0 if on == "truth" else 0.0),
        }
        for k, of in enumerate((10.0, 14.0, 12.0))
        for kind, extra in (("truth", 0.0), ("imm-spline", 3.0))
        for on in ("truth", "imm-spline")
    ]
    cells = [[c.strip() for c in line.split("|")] for line in section(pd.DataFrame(rows)).splitlines() if "`" in line]
    assert [row[1:5] for row in cells[:2]] == [
        ["`truth`", "3", cells[0][3], "-2.0 [-2.0, -2.0]"], ["`imm-spline`", "3", cells[1][3], "-2.0 [-2.0, -2.0]"],
    ]  # fmt: skip
    assert cells[0][3].startswith("12.0 [")
    assert cells[1][3].startswith("15.0 [")


def test_the_picture_shows_each_kind_on_each_source(tmp_path):
    path = draw(read_runs(DOCS / "results" / RESULTS, ""), tmp_path / "learned.png")
    assert imread(path).std() > 0


def test_the_committed_trainings_have_a_row_a_kind():
    text = section(read_runs(DOCS / "results" / RESULTS, ""))
    assert text.count("| `") == 2
    assert profile(np.array([1.0, 2.0, 3.0]), 1.5) == pytest.approx(2 / 3)

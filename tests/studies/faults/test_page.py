"""The page of faults: its numbers are those of the committed runs."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from studies.effects import effect, read_runs, rows, write_runs
from studies.faults.page import RESULTS, render
from studies.faults.tables import FAULT, NONE, by_fault
from tests.studies.committed_pages import assert_committed

DOCS = Path(__file__).parents[3] / "docs"


def made():
    """Runs of a fault that adds 1 m to one tracker and nothing to the other, in two scenarios."""
    rng = np.random.default_rng(0)
    found = []
    for scenario in ("a", "b"):
        for seed in range(6):
            usual = rng.normal(4.0, 1.0)
            for tracker, cost in (("x", 1.0), ("y", 0.0)):
                for fault in ("", "+drop:0.2"):
                    gospa = usual + (cost + rng.normal(0, 0.01) if fault else 0.0)
                    found.append((f"{scenario}{fault}", tracker, seed, gospa, int(bool(fault))))
    return pd.DataFrame(found, columns=["scenario", "tracker", "seed", "gospa", "switches"])


def test_a_change_is_paired_by_seed_so_that_the_spread_of_seeds_does_not_hide_it():
    table = by_fault(made())
    assert set(table["fault"]) == {NONE, "drop:0.2"}
    assert set(table["scenario"]) == {"a", "b"}
    worse, same = (effect(table, FAULT, "drop:0.2", tracker, "gospa") for tracker in ("x", "y"))
    assert worse.change.value == pytest.approx(1.0, abs=0.02)
    assert 0.9 < worse.change.low < worse.change.high < 1.1
    assert same.change.low < 0.0 < same.change.high < 0.05
    assert worse.mean.high - worse.mean.low > 0.5
    row = dict(zip(("fault", "x", "x change", "y", "y change"), rows(table, FAULT, "gospa", 2)[1], strict=True))
    assert row["fault"] == "`drop:0.2`"
    assert row["x change"].startswith("**+1.0")
    assert not row["y change"].startswith("**")


def test_the_runs_without_a_fault_are_still_those_when_read_back(tmp_path):
    table = by_fault(made())
    write_runs(table, tmp_path / RESULTS)
    pd.testing.assert_frame_equal(read_runs(tmp_path / RESULTS, ""), table, rtol=1e-5)


def test_the_page_shows_the_committed_runs():
    assert_committed("faults", render(read_runs(DOCS / "results" / RESULTS, "")))

"""Tables of runs: what is missing stays missing, and what was never run is said."""

import numpy as np
import pandas as pd
import pytest

from studies.effects import facts, read_runs, spell, write_runs
from testbed.evaluation.intervals import Interval


def made():
    """Two runs, of which one has no value."""
    found = [("a", "none", "x", 3, 1.25), ("a", "drop:0.2", "x", 4, np.nan)]
    return pd.DataFrame(found, columns=["scenario", "fault", "tracker", "seed", "gospa"])


def test_a_missing_value_is_read_back_as_one_and_a_text_as_it_is(tmp_path):
    write_runs(made(), tmp_path / "runs.csv")
    pd.testing.assert_frame_equal(read_runs(tmp_path / "runs.csv", ""), made())


def test_runs_that_were_never_made_are_refused_with_the_remedy(tmp_path):
    with pytest.raises(ValueError, match=r"runs\.csv is not there yet; run it"):
        read_runs(tmp_path / "runs.csv", "run it")


def test_facts_count_runs_and_seeds():
    assert facts(made()) == "2 runs in open loop: `a`, 2 seeds (3, 4)"
    assert facts(made().assign(seed=3)) == "2 runs in open loop: `a`, 1 seed (3)"


def test_an_interval_is_written_where_there_is_one():
    assert spell(Interval(1.0, 0.5, 1.5), 1, "+") == "+1.0 [+0.5, +1.5]"
    assert spell(Interval(1.0, np.nan, np.nan), 2) == "1.00"

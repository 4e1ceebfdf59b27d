"""The page of persistence: its numbers are those of the committed runs."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sensors import RADARS
from studies.effects import effect, read_runs, rows
from studies.persistence.page import COLUMNS, LIFETIME, LIFETIMES, RESULTS, lasting, render
from tests.studies.committed_pages import assert_committed

DOCS = Path(__file__).parents[3] / "docs"


def made():
    """Runs in which a lifetime of 5 s adds 1 to all measures of one tracker, and nothing else does anything."""
    rng = np.random.default_rng(0)
    found = []
    for scenario in ("a", "b"):
        for seed in range(6):
            usual = rng.normal(4.0, 1.0)
            for lifetime in LIFETIMES:
                for tracker in ("x", "y"):
                    value = usual + (lifetime == 5.0 and tracker == "x") + rng.normal(0, 0.01) * (lifetime > 0)
                    found.append((scenario, lifetime, tracker, seed, *[value] * 5))
    return pd.DataFrame(found, columns=list(COLUMNS))


def test_a_change_is_paired_by_seed_and_marked_where_it_is_resolved():
    mean, change = effect(made(), LIFETIME, 5.0, "x", "gospa")
    assert change.value == pytest.approx(1.0, abs=0.02)
    assert change.high - change.low < 0.05 < mean.high - mean.low
    shown = rows(made(), LIFETIME, "gospa", 2)
    assert [row[0] for row in shown] == ["off", "0.2 s", "1 s", "5 s"]
    assert shown[0][2] == shown[0][4] == ""
    assert shown[3][2].startswith("**+1.0")
    assert shown[3][4].startswith(("+0.0", "-0.0"))


def test_a_lifetime_is_that_of_all_sensors_and_none_is_the_rig_itself():
    rig = RADARS["surround"]
    assert lasting(rig, 0.0) == rig
    assert [sensor.persistence.lifetime for sensor in lasting(rig, 0.2).sensors] == [0.2] * 6


def test_the_page_shows_the_committed_runs():
    assert_committed("persistence", render(read_runs(DOCS / "results" / RESULTS, "")))

"""The page of learned policies: drives of real policies, and numbers that are those of the committed drives."""

from pathlib import Path

import numpy as np
import pytest

from studies.effects import read_runs
from studies.learned.drives import ENVIRONMENT, RADAR, WARM_UP, drives, policies
from studies.learned.page import RESULTS, render
from testbed.experiments.engine import Engine
from testbed.planners.learned import save_policy
from tests.studies.committed_pages import assert_committed

DOCS = Path(__file__).parents[3] / "docs"
FASTER = 3


@pytest.fixture
def folder(tmp_path):
    """Two policies of one layer for 5 vehicles by 5 features: one always wants to be faster, the other to stay."""
    for name, favoured in (("truth-0", FASTER), ("rm-koch-0", 1)):
        save_policy(tmp_path / f"{name}.npz", [(np.zeros((5, 25)), np.eye(5)[favoured])], activation="relu")
    return tmp_path


def test_each_policy_drives_on_everything_that_one_was_trained_on(folder):
    table = drives(policies(folder), str(folder / "out"), Engine(), episodes=1)
    assert list(zip(table["tracker"], table["driven"], table["seed"], strict=True)) == [
        (t, d, s) for t in ("truth", "rm-koch") for d in ("truth", "rm-koch") for s in (1000,)
    ]
    assert (table["length"][table["crashed"] == 0] == 30).all()  # of the environment, when nothing ends it before
    assert table["length"].max() <= 30
    pairs = table.pivot_table(index=["tracker", "seed"], columns="driven", values="reward")
    np.testing.assert_array_equal(pairs["truth"], pairs["rm-koch"])  # these policies look at nothing


def test_policies_drive_in_the_world_that_they_were_trained_in():
    text = (DOCS / "examples" / "train.py").read_text()
    assert f"RADAR = {RADAR}".replace("'", '"') in text
    assert f"{WARM_UP=}".lower() in text
    assert f'"{ENVIRONMENT}"' in text


def test_files_of_other_names_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"holds no TRACKER-SEED\.npz"):
        policies(tmp_path)
    (tmp_path / "my-policy.npz").touch()
    with pytest.raises(ValueError, match=r"my-policy\.npz is not named TRACKER-SEED.npz"):
        policies(tmp_path)


def test_the_page_shows_the_committed_drives():
    assert_committed("learned-policies", render(read_runs(DOCS / "results" / RESULTS, "")))

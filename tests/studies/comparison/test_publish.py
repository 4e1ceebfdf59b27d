"""Committed results of which some trackers are replaced."""

import json
import shutil
from dataclasses import replace

import pandas as pd
import pytest

from studies.comparison.page import closed
from studies.comparison.publish import ABOUT, RUNS, TABLES, publish_part, read_part, replace_trackers
from testbed.experiments.command import execute
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.engine import Engine
from testbed.experiments.store import Results

PART = Comparison(("xia2020-lane",), ("htg-mm",), (0, 1, 2), Settings(duration=1.0))


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """Runs of one tracker alone."""
    out = tmp_path_factory.mktemp("part") / "runs"
    execute(replace(PART, out=str(out)), Engine())
    return out


@pytest.fixture
def older(published, tmp_path):
    """Committed results in which that tracker has other numbers and another digest."""
    target = tmp_path / "results"
    shutil.copytree(published, target)
    runs = pd.read_parquet(target / RUNS)
    runs.loc[runs["tracker"] == "htg-mm", ["gospa", "rmse_length"]] += 1
    runs.to_parquet(target / RUNS)
    known = json.loads((target / ABOUT).read_text())
    known["identity"]["code of htg-mm"] = "ba9876543210"
    (target / ABOUT).write_text(json.dumps(known))
    for name in TABLES:
        table = pd.read_csv(target / f"{name}.csv")
        numbers = table.select_dtypes("number").columns
        table.loc[table["tracker"] == "htg-mm", numbers] += 1
        table.to_csv(target / f"{name}.csv", index=False)
    return target


def test_replacing_a_tracker_gives_what_publishing_all_gives(part, older, published):
    times = pd.read_parquet(published / RUNS)
    assert replace_trackers(part, older) == ("htg-mm",)
    pd.testing.assert_frame_equal(pd.read_parquet(older / RUNS), times)  # wall times too: they are kept
    for name in TABLES:
        assert (older / f"{name}.csv").read_text() == (published / f"{name}.csv").read_text()
    assert json.loads((older / ABOUT).read_text()) == json.loads((published / ABOUT).read_text())


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("seeds", [0, 1], "has seeds"),
        ("scenarios", ["cut-in"], "has scenarios"),
        ("trackers", ["rm-koch"], "publish all"),
    ],
)
def test_runs_that_do_not_fit_are_refused(part, older, key, value, sentence):
    known = json.loads((older / ABOUT).read_text()) | {key: value}
    (older / ABOUT).write_text(json.dumps(known | {"reference": "rm-koch"} if key == "trackers" else known))
    before = (older / RUNS).read_bytes()
    with pytest.raises(ValueError, match=sentence):
        replace_trackers(part, older)
    assert (older / RUNS).read_bytes() == before


def test_the_digest_that_all_share_is_left_to_refresh(part, older):
    known = json.loads((older / ABOUT).read_text())
    known["identity"]["code"] = "0123456789ab"
    (older / ABOUT).write_text(json.dumps(known))
    replace_trackers(part, older)
    assert json.loads((older / ABOUT).read_text())["identity"]["code"] == "0123456789ab"


def test_runs_in_closed_loop_are_published_beside_the_others_and_stand_on_the_page(part, tmp_path):
    assert read_part("closed", tmp_path) is None
    assert "No run was made in closed loop" in closed(None)
    with pytest.raises(ValueError, match="does not hold runs of closed loop; make them with --loop closed"):
        publish_part("closed", part, tmp_path)
    comparison = replace(PART, settings=Settings(duration=0.6, loop="closed"), seeds=(0, 1), out=str(tmp_path / "runs"))
    execute(comparison, Engine())
    publish_part("closed", tmp_path / "runs", tmp_path)
    found = read_part("closed", tmp_path)
    runs = Results.read(comparison).runs.set_index("seed")
    assert found.study.settings.loop == "closed"
    assert found.spans.set_index("seed")["progress"].to_numpy() == pytest.approx(runs["progress"].to_numpy(), rel=1e-6)
    (row,) = [line for line in closed(found).splitlines() if line.startswith("| `htg-mm`") and "[" not in line][:1]
    assert float(row.split("|")[4]) == pytest.approx(runs["progress"].mean(), abs=0.05)

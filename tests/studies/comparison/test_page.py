"""Committed results and the page made from them."""

import json
import shutil

import pandas as pd
import pytest

from studies.comparison import committed
from studies.comparison.page import layers, render
from studies.comparison.publish import read, stored_comparison
from testbed.experiments.compare import Comparison, Settings, write_runs
from testbed.experiments.store import Results
from tests.studies.committed_pages import assert_committed
from tests.studies.comparison.conftest import DOCS, TRACKERS
from tests.testbed.experiments.made_results import make


def test_a_folder_tells_which_comparison_made_it(folder):
    found = stored_comparison(folder)
    assert (found.scenarios, found.trackers, found.seeds) == (("xia2020-lane",), TRACKERS, (0, 1, 2))
    assert found.settings == Settings(duration=1.0)


def test_a_folder_that_lacks_a_run_is_refused_with_its_name(folder, tmp_path):
    part = tmp_path / "part"
    shutil.copytree(folder, part)
    (part / "rows" / "xia2020-lane_htg-mm_seed1.parquet").unlink()
    with pytest.raises(ValueError, match="lacks 1 runs, xia2020-lane_htg-mm_seed1 among them"):
        stored_comparison(part)


def test_published_runs_are_those_of_the_folder(folder, published):
    results, known, tables = read(published)
    whole = pd.read_parquet(write_runs(Results.read(stored_comparison(folder)))).set_index(
        ["scenario", "tracker", "seed", "phase"]
    )["gospa"]
    kept = results.spans.set_index(["scenario", "tracker", "seed", "phase"])["gospa"]
    pd.testing.assert_series_equal(kept, whole, check_dtype=False, rtol=1e-6)
    assert known["reference"] == results.study.baseline == "htg-mm"
    assert set(known["seconds"]) == {"simulation", "sensing", "loading", "tracking", "metrics", "writing"}
    assert set(tables["consistency"]["tracker"]) == set(TRACKERS)


def test_the_page_shows_every_tracker_and_scenario(published):
    page = render(published)
    assert all(f"`{tracker}`" in page for tracker in TRACKERS)
    assert "| xia2020-lane |" in page


def test_layers_are_held_against_the_complete_tracker_and_not_against_the_reference(tmp_path):
    """Errors of made results rise in the order of the trackers, so the tracker without a layer is worse."""
    names = ("imm-spline", "imm-spline:size=off")
    table = layers(make(Comparison(("cut-in",), names, (0, 1, 2, 3), out=str(tmp_path))))
    assert "From 1 scenarios and 4 seeds; length: the scenarios' own." in table
    (row,) = [line for line in table.splitlines() if "size=off" in line and "GOSPA" in line]
    assert float(row.split("|")[3].split("[")[0]) > 0
    assert layers(None) == "No run was made without a layer."


def test_the_pictures_of_the_page_are_figures_of_the_report(published):
    pictures = sorted(path.name for path in (published.parent / "pictures").iterdir())
    assert pictures == ["comparison-time_nees_position.png"]


def test_the_committed_page_is_of_the_committed_results():
    """On failure: `make study-comparison`."""
    known = json.loads((DOCS / "results" / "comparison.json").read_text())
    page = (DOCS / "comparison.md").read_text()
    assert f"committed results of {known['date']}" in page
    assert known["identity"]["code"] in page
    assert all(f"`{tracker}`" in page for tracker in known["trackers"])
    claims = (DOCS / "reproductions.md").read_text()
    for paper in committed.read(DOCS / "results" / "reproduce"):
        for v in paper["verdicts"]:
            assert f"| {v['claim']} ({v['source']}) | {v['outcome']} |" in claims


@pytest.mark.slow
def test_the_committed_page_is_what_the_results_give():
    """On failure: `make study-comparison`."""
    assert_committed("comparison", render(DOCS / "results"))


def test_verdicts_are_taken_out_of_complete_reproductions_only(tmp_path):
    verdict = {"claim": "better", "source": "IV", "outcome": "confirmed", "numbers": "1 < 2"}
    found = {"paper": "hoher2022", "settings": {"runs": 3, "seed": 0, "more": 1}, "rows": [1], "verdicts": [verdict]}
    (tmp_path / "hoher2022.json").write_text(json.dumps({**found, "interrupted": False}))
    (tmp_path / "xia2020.json").write_text(json.dumps({**found, "paper": "xia2020", "interrupted": True}))
    (path,) = committed.take(tmp_path, tmp_path / "kept")
    kept = json.loads(path.read_text())
    assert kept["verdicts"] == [verdict]
    assert kept["settings"] == {"runs": 3, "seed": 0}
    assert "rows" not in kept


def test_a_folder_without_reproductions_is_refused(tmp_path):
    with pytest.raises(ValueError, match="holds no complete reproduction"):
        committed.take(tmp_path, tmp_path / "kept")

"""The page of the benchmark's entries, and verdicts of reproductions."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from studies.comparison import committed
from studies.comparison.page import BEFORE, ENTRIES, FIGURES, figures, main, moved, render
from studies.stored import stored_comparison
from testbed.experiments.benchmark.definition import find
from testbed.experiments.benchmark.entries import Entry, read_all
from testbed.experiments.benchmark.table import alike
from testbed.experiments.compare import Settings
from tests.studies.committed_pages import assert_committed
from tests.studies.comparison.conftest import DOCS, TRACKERS

V1 = find("v1")
MADE = {"date": "2026-12-24T10:00:00Z", "machine": "Linux, 2 cores", "commit": "0123456789abcdef"}


def entry(name, gospa, seeds=8):
    """An entry of so many seeds whose measures differ a little from seed to seed."""
    runs = [
        {"track": track.name, "case": case, "seed": seed, **dict.fromkeys(track.measures, gospa + 0.01 * (seed % 3))}
        for track in V1.tracks
        for seed in V1.development[:seeds]
        for case in track.case_names
    ]
    cost = {"open": 1.5, "closed": 2.5, "faults": 3.5}
    return Entry("v1", name, "tracker", None, V1.development, V1.digests(), tuple(runs), cost, {}, MADE)


@pytest.fixture
def entries():
    return [entry("imm-spline", 1.0), entry("rm-koch", 2.0, 3), entry("imm-spline:size=off", 1.5), entry("dra", 3.0, 1)]


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


def test_every_entry_has_a_rank_and_what_is_missing_is_said(entries):
    page = render(entries, None)
    rows = {line.split("|")[1].strip(" `"): line.split("|") for line in page.splitlines() if line.startswith("| `")}
    assert rows["imm-spline"][3].strip() == "8"
    assert rows["rm-koch"][3].strip() == "3"
    assert "no entry of `rm-feldmann`" in page
    assert "open: rm-koch has 84 of 224 runs and 3 whole seeds of 8" in page
    assert "closed: dra has 8 of 64 runs and 1 whole seeds of 8" in page
    assert "There is no older record." in page
    assert page.count(" by case, ") == 3


def test_a_tracker_without_a_layer_stands_beside_the_complete_one_only(entries):
    page = render(entries, None)
    ranks, _, layers = page.partition("## What each layer earns")
    assert "size=off" not in ranks
    (row,) = [line for line in layers.splitlines() if "size=off" in line and "GOSPA" in line]
    assert row.split("|")[3].strip() == "+0.500 [0.500, 0.500]"
    assert "No entry was made without a layer" in render(entries[:2], None)


def test_what_moved_is_counted(entries):
    key = ["track", "tracker", "measure", "value", "low", "high"]
    rows = [("open", "imm-spline", "gospa", 5.0, 4.0, 6.0), ("open", "rm-koch", "gospa", 2.01, 1.9, 2.1)]
    text = moved(entries[:2], V1, pd.DataFrame(rows, columns=key))
    assert "- GOSPA [m], open: intervals are apart for 1 of 2 trackers" in text
    assert "- progress [m], closed: intervals are apart for 0 of 0 trackers" in text


def test_the_readme_has_figures_of_the_default_tracker_only_where_it_has_an_entry(entries):
    assert "| GOSPA | 1.01 m [1.00, 1.02] |" in figures(entries)
    assert "imm-htg" not in figures(entries)
    assert figures(entries[1:]) is None


def test_entries_are_taken_and_pages_written(entries, tmp_path):
    docs = tmp_path / "docs"
    for one in [*entries, replace(entry("old", 9.0), digests={"code": "other"})]:
        (tmp_path / "runs").mkdir(exist_ok=True)
        one.write(tmp_path / "runs")
    (docs / "results").mkdir(parents=True)
    shutil.copy(DOCS / BEFORE, docs / BEFORE)
    begin, end = "a\n<!-- figures: written by `make benchmark` -->\n", "<!-- end of figures -->\nb"
    (tmp_path / "README.md").write_text(f"{begin}x\n{end}")
    main(tmp_path / "runs", docs)
    assert {one.name for one in read_all(docs / ENTRIES)} == {one.name for one in entries}
    first = (docs / "comparison.md").read_text()
    main(None, docs)
    assert (docs / "comparison.md").read_text().splitlines()[4:] == first.splitlines()[4:]
    readme = (tmp_path / "README.md").read_text()
    assert "| NEES | 1.0 [1.0, 1.0] |" in readme
    assert readme.startswith(begin)
    assert readme.endswith(end)


def committed_entries():
    if not (DOCS / ENTRIES).exists():
        pytest.skip("no entry is committed yet; `make benchmark` makes them")
    return alike(read_all(DOCS / ENTRIES))[0]


def test_the_committed_page_is_of_the_committed_entries():
    """On failure: `make study-comparison`."""
    assert_committed("comparison", render(committed_entries(), pd.read_csv(DOCS / BEFORE)))


def test_the_older_record_has_every_tracker_of_its_day():
    table = pd.read_csv(DOCS / BEFORE)
    assert table.groupby(["track", "measure"])["tracker"].nunique().eq(17).all()
    assert np.isfinite(table[["value", "low", "high"]]).all(axis=None)


def test_figures_of_the_readme_are_those_of_the_committed_entries():
    """On failure: `make study-comparison`."""
    assert FIGURES.search((DOCS.parent / "README.md").read_text()).group() == figures(committed_entries())


def test_committed_verdicts_stand_on_the_page():
    claims = (DOCS / "reproductions.md").read_text()
    for paper in committed.read(DOCS / "results" / "reproduce"):
        for v in paper["verdicts"]:
            assert f"| {v['claim']} ({v['source']}) | {v['outcome']} |" in claims


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

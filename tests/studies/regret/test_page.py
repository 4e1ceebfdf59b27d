"""The page of regret is made from two tables, with a part for each study that there is."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from studies.__main__ import app
from studies.regret.page import ABOUT, PARTS, about_of, joined, load, text
from testbed.environment.sources.substitution import subsets
from testbed.evaluation import metric
from testbed.evaluation.metric import keys
from testbed.experiments.pairs import MEASURES, scored
from testbed.experiments.regret import DRIVES, PAIRS
from tests.studies.committed_pages import assert_committed

DOCS = Path(__file__).parents[3] / "docs"
ZERO = dict.fromkeys((*MEASURES, *keys(metric.DRIVES)), 0.0)


def made(worth, planners=("mpc", "mpc-cautious"), seeds=8):
    """Tables of drives and of pairs; worth: condition -> drive score, to which the seed adds a little."""
    rng = np.random.default_rng(5)
    drives, pairs = [], []
    for planner in planners:
        for seed in range(seeds):
            own = {c: value + 0.1 * rng.standard_normal() for c, value in worth.items()}
            for condition, value in own.items():
                what = {"scenario": "probe-brake", "planner": planner, "condition": condition, "seed": seed}
                drives.append(
                    {**what, **ZERO, "progress": 100 + 20 * value, "ttc_min": 10.0, "gospa": abs(value), "cpu": 1.0}
                )
                for reference in ("truth", "in-view"):
                    if condition not in ("truth", reference):
                        words = {"reference": reference, "parted": 1.0, "parting": "at 1.0 s"}
                        pairs.append({**words, **what, **ZERO, "drive_value": value - own[reference]})
    return scored(pd.DataFrame(drives), pd.DataFrame(pairs))


def test_the_page_has_a_part_for_each_study_and_figures_of_the_tables():
    parts = {f"t:{s}": -1.0 for s in subsets() if s not in ("", "EGV")}
    found = {
        "main": made({"truth": 5.0, "in-view": 5.0, "t": 3.0, "u": 4.5}),
        "attribution": made({"truth": 5.0, "in-view": 5.0, "t": 3.0, **parts}),
        "doses": made({"truth": 5.0, "in-view": 5.0, "in-view+latency=0.2": 4.0}),
        "caution": made({"truth": 5.0, "in-view": 5.0, "t": 3.0, "t+covariance=4": 2.0}),
    }
    page = text(found)
    scores = found["main"][0].query("planner == 'mpc'").set_index(["condition", "seed"])["score"]
    assert f"| `t` | {(scores['truth'] - scores['t']).mean():+.3f} [" in page
    titles = ("Regret by tracker", "Which group", "Injected errors", "Does knowing the uncertainty help?")
    assert [title for title in titles if f"## {title}" not in page] == []
    assert "| `in-view+latency=0.2` | probe-brake | mpc |" in page
    assert "64 drives" in page
    assert text({"main": found["main"]}).count("\n## ") == page.count("\n## ") - 3


@pytest.mark.slow
def test_the_committed_page_says_what_the_committed_tables_say():
    results = DOCS / "results" / "regret"
    found = {name: load(results / name) for name in PARTS if (results / name).exists()}
    written = text(found, about=about_of(results))
    assert_committed("regret", written)


def test_the_page_begins_with_what_was_written_about_its_drives_until_there_are_others(tmp_path):
    (folder := tmp_path / "study").mkdir()
    drives, pairs = made({"truth": 5.0, "in-view": 5.0, "t": 3.0}, ("idm",))
    drives.to_parquet(folder / DRIVES)
    pairs.to_parquet(folder / PAIRS)
    run = [f"main={folder}", "--docs", str(tmp_path)]
    assert CliRunner().invoke(app, ["regret", *run]).exit_code == 0
    about = tmp_path / "results" / "regret" / ABOUT
    about.write_text("Of these drives.\n")
    assert CliRunner().invoke(app, ["regret", *run[1:]]).exit_code == 0
    assert (tmp_path / "regret.md").read_text().splitlines()[4] == "Of these drives."
    assert CliRunner().invoke(app, ["regret", *run]).exit_code == 0
    assert not about.exists()


def test_tables_are_published_and_pictures_drawn_beside_the_page(tmp_path):
    folder, docs = tmp_path / "study", tmp_path / "docs"
    folder.mkdir()
    drives, pairs = made({"truth": 5.0, "in-view": 5.0, "t": 3.0, "u": 4.0}, ("idm",))
    drives.to_parquet(folder / DRIVES)
    pairs.to_parquet(folder / PAIRS)
    done = CliRunner().invoke(app, ["regret", f"main={folder}", "--docs", str(docs)])
    assert done.exit_code == 0, done.output
    assert (docs / "results/regret/main" / PAIRS).exists()
    assert (docs / "pictures/regret-regret.png").exists()
    first = (docs / "regret.md").read_text()
    assert CliRunner().invoke(app, ["regret", "--docs", str(docs)]).exit_code == 0
    again = (docs / "regret.md").read_text()
    assert again.splitlines()[3:] == first.splitlines()[3:]  # but for the command


def test_a_folder_without_tables_is_refused(tmp_path):
    done = CliRunner().invoke(app, ["regret", f"main={tmp_path}", "--docs", str(tmp_path / "docs")])
    assert done.exit_code == 2
    assert "has no drives.parquet" in done.stderr


KEYS = ["scenario", "planner", "condition", "seed"]


def test_folders_are_joined_and_a_drive_counts_once():
    drives, _ = made({"truth": 5.0, "in-view": 5.0, "t": 3.0})
    idm = drives[drives["planner"] == "mpc"]
    again = idm.assign(cpu=7.0)[::-1]
    both = joined([again, drives], KEYS)
    assert len(both) == len(drives)
    assert both["progress"].sum() == pytest.approx(drives["progress"].sum())
    pd.testing.assert_frame_equal(both, joined([again, both, drives], KEYS))


def test_folders_that_differ_about_a_drive_are_refused():
    drives, _ = made({"truth": 5.0, "in-view": 5.0, "t": 3.0})
    with pytest.raises(ValueError, match="two folders differ about"):
        joined([drives, drives.assign(progress=drives["progress"] + 1e-6)], KEYS)


@pytest.mark.parametrize("study", ["main", "main=", "mian=runs", "=runs"])
def test_a_study_without_part_or_folder_is_refused(study, tmp_path):
    done = CliRunner().invoke(app, ["regret", study, "--docs", str(tmp_path)])
    assert done.exit_code == 2
    assert "PART=FOLDER" in done.stderr


def test_what_is_committed_stays_when_more_is_added(tmp_path):
    docs, worth = tmp_path / "docs", {"truth": 5.0, "in-view": 5.0, "t": 3.0}
    for planner in ("idm", "mpc"):
        (folder := tmp_path / planner).mkdir()
        for table, name in zip(made(worth, (planner,)), (DRIVES, PAIRS), strict=True):
            table.to_parquet(folder / name)
        args = ["regret", f"main={folder}", "--add", "--docs", str(docs)]
        assert CliRunner().invoke(app, args).exit_code == 0
    assert "planners `idm`, `mpc`" in (docs / "regret.md").read_text()


@pytest.mark.parametrize("missing", ["t", "in-view"])
def test_a_study_that_lacks_a_condition_has_a_page_still(missing):
    drives, pairs = made({"truth": 5.0, "in-view": 5.0, "t": 3.0, "u": 4.0})
    kept = (pairs["condition"] != missing) & (pairs["reference"] != missing)
    assert "# What tracking error costs" in text({"main": (drives[drives["condition"] != missing], pairs[kept])})

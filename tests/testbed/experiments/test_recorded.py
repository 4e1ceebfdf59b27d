"""Comparisons on recordings: those of our scenarios give what the scenarios give, tracks stand beside trackers."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.evaluation.metric import COSTS
from testbed.experiments.command import execute
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.engine import Engine
from testbed.experiments.recorded import GROUP, RecordedComparison
from testbed.experiments.report import logs
from testbed.experiments.statistics import cells
from testbed.experiments.store import Results
from testbed.experiments.study import Tally
from testbed.replay.pairing import Files
from tests.testbed.replay.made_tracks import recording, tracks, written

TRACKERS, SEEDS = ("rm-koch", "rm-feldmann"), (0, 1)


def compared(recordings, out, trackers=(), **files):
    found = {name: Files.of([text], recordings).each for name, text in files.items()}
    folders = Files.of((), recordings).recordings
    return RecordedComparison.of(folders, trackers, found, out=str(out))


def spans(study):
    assert execute(study, Engine()).failed == []
    return Results.read(study).runs.sort_values(["tracker", "seed"]).reset_index(drop=True)


def test_recordings_of_scenarios_give_what_the_scenarios_give(tmp_path):
    call = ["record", "cut-in", "--seeds", "0:2", "--duration", "0.6", "--radar", "front", "--out", str(tmp_path / "r")]
    assert CliRunner().invoke(app, call).exit_code == 0
    assert sorted(p.name for p in (tmp_path / "r").iterdir()) == ["cut-in_seed0", "cut-in_seed1"]
    live = Comparison(("cut-in",), TRACKERS, SEEDS, Settings("front", duration=0.6), out=str(tmp_path / "live"))
    study = compared([str(tmp_path / "r")], tmp_path / "recorded", TRACKERS)
    assert (study.scenarios, study.seeds) == (("cut-in",), SEEDS)
    own, theirs = (spans(one).drop(columns=[*COSTS]) for one in (study, live))
    assert own.equals(theirs[own.columns])


def test_tracks_stand_beside_trackers_and_have_a_log(tmp_path):
    folders = [str(recording(tmp_path / "drives" / name, 0.5)) for name in ("monday", "tuesday")]
    for name in ("monday", "tuesday"):
        written(tracks(0.5), tmp_path / "mine" / f"{name}.csv")
    study = compared(folders, tmp_path / "out", ("rm-koch",), mine=str(tmp_path / "mine" / "*.csv"))
    assert (study.scenarios, study.seeds, study.trackers) == ((GROUP,), (0, 1), ("rm-koch", "mine"))
    runs = spans(study)
    mine = runs[runs.tracker == "mine"]
    assert mine.gospa.tolist() == pytest.approx([0.0, 0.0], abs=1e-6)
    assert (runs[runs.tracker == "rm-koch"].gospa > 0.1).all()
    assert not [line for line in study.judge(Results.read(study), Tally()).shown if "left out" in str(line)]
    nees = [cell for cell in cells(Results.read(study), ("nees_position",)) if cell.tracker == "mine"]
    assert [cell.difference for cell in nees] == [None]  # it has no covariances: there is nothing to compare
    assert study.facts() == [("recordings", "0: monday, 1: tuesday")]
    results = Results.read(study)
    assert results.runs.set_index("tracker").loc["mine", "ms_per_scan"].isna().all()
    pick = logs.picks(results)[-1]
    assert pick.trackers == ("mine", "rm-koch")
    path = logs.log_path(pick, tmp_path / "out")
    path.parent.mkdir()
    assert logs.write_one(pick, study, tmp_path / "out").note == ""
    assert path.is_file()
    text = Path(study._files["mine", folders[0]].path)
    text.write_text(text.read_text() + "0.5,other,500,0,0,20,0,4.5,1.8\n")
    with pytest.raises(ValueError, match=r"holds runs with code of mine"):
        execute(study, Engine())


def test_a_recording_without_its_file_has_no_run_of_these_tracks(tmp_path):
    folders = [str(recording(tmp_path / name, 0.2)) for name in ("a", "b")]
    file = written(tracks(0.2), tmp_path / "t" / "b.csv")
    file.write_text(file.read_text() + "0.95,late,5,0,0,20,0,4.5,1.8\n")
    study = compared(folders, tmp_path / "out", ("rm-koch",), mine=str(file))
    (line,) = [line for line in study.judge(Results.read(study), Tally()).shown if "left out" in str(line)]
    assert line.startswith(f"! mine, {folders[1]}: 1 of 7 rows are of no scan")
    assert [(run.seed, run.source) for run in study.work()] == [(0, "rm-koch"), (1, "rm-koch"), (1, "mine")]


def test_scans_outside_the_truth_are_not_scored(tmp_path):
    folder = recording(tmp_path / "a", 0.5)
    head, *rows = (folder / "truth.csv").read_text().splitlines()
    (folder / "truth.csv").write_text("\n".join([head, *rows[2:-2]]) + "\n")
    runs = spans(compared([str(folder)], tmp_path / "out", mine=str(written(tracks(0.5), tmp_path / "mine.csv"))))
    assert (runs.scans.tolist(), runs.false_per_scan.tolist()) == ([4], [0.0])


def test_what_cannot_be_compared_is_refused(tmp_path):
    folder = recording(tmp_path / "a", 0.3)
    (folder / "truth.csv").unlink()
    with pytest.raises(ValueError, match=r"a has no table truth to compare with"):
        compared([str(folder)], tmp_path / "out", ("rm-koch",)).check()
    wrong = CliRunner().invoke(app, ["compare", "cut-in", "--recording", str(folder)])
    assert (wrong.exit_code, "without scenarios and --seeds" in wrong.stderr) == (2, True)
    wrong = CliRunner().invoke(app, ["compare"])
    assert (wrong.exit_code, "give the names of scenarios" in wrong.stderr) == (2, True)

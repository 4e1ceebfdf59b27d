"""The folder of a study: it goes on after damage, refuses what is not its own, and a failing run stops nothing."""

import json
import os
import re
import shutil
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from rich.console import Console
from rich.progress import Progress

from testbed import files
from testbed.experiments import command, store
from testbed.experiments.command import calculated, carry_out, execute, shuffled
from testbed.experiments.engine import Engine
from testbed.experiments.run import DONE, FAILED, FOUND
from testbed.experiments.store import ABOUT, RECORDINGS, ROWS, Results, Store, make
from tests.testbed.experiments.naps import FreshNaps, Nap, Naps

FIRST, SECOND = Nap(0, 0.0), Nap(1, 0.0)


@pytest.fixture
def made(tmp_path):
    """A study whose folder is complete."""
    study = Naps(out=str(tmp_path / "naps"))
    tally = execute(study, Engine())
    assert (tally.done, tally.found, tally.failed, tally.exit_status) == (6, 0, [], 0)
    return study


def test_a_study_leaves_what_identifies_it_and_a_file_of_each_run(made):
    out = Path(made.out)
    assert {p.name for p in out.iterdir()} == {ABOUT, RECORDINGS, ROWS}
    assert {p.name for p in (out / ROWS).iterdir()} == {f"nap{k}.parquet" for k in range(6)}
    known = Store(made).about()
    assert (known["study"], known["settings"]) == ("naps", "soft")
    assert {"code", "version of numpy"} <= set(known)


def test_what_is_there_is_found_and_not_made_again(made):
    before = {p: p.stat().st_mtime_ns for p in Path(made.out).rglob("*.*")}
    tally = execute(made, Engine())
    assert (tally.done, tally.found) == (0, 6)
    assert before == {p: p.stat().st_mtime_ns for p in Path(made.out).rglob("*.*")}
    assert make(FIRST, made, Path(made.out)).status == FOUND


def test_results_say_what_ran_compiled_where_they_were_made(made, monkeypatch):
    assert Results.read(made).compiled == files.compiled()
    monkeypatch.setattr(store, "compiled", lambda: "radar by numba 1.0")
    more = replace(made, count=8)
    execute(more, Engine())
    assert Results.read(more).compiled == "; ".join(sorted([files.compiled(), "radar by numba 1.0"]))


def test_other_work_joins_the_folder(made):
    tally = execute(replace(made, count=8), Engine())
    assert (tally.done, tally.found) == (2, 6)


def truncate(path, _):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path, _):
    data = bytearray(path.read_bytes())
    for k in range(len(data) // 2, len(data) // 2 + 64):
        data[k] ^= 255
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (truncate, "is damaged"),
        (flip, "is damaged"),
        (lambda path, other: path.write_bytes(b""), "is damaged"),
        (lambda path, other: shutil.copy(other, path), "holds the run"),
    ],
    ids=["truncated", "flipped", "empty", "another run"],
)
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_corrupt_file_is_named_and_made_again(made, damage, told, jobs):
    store = Store(made)
    damage(store.path(FIRST), store.path(SECOND))
    tally = execute(made, Engine(jobs))
    assert (tally.done, tally.found) == (1, 5)
    (redone,) = tally.redone
    assert redone.name == FIRST.name
    assert redone.note.startswith(f"{store.path(FIRST)} {told}")
    assert store.table(FIRST)["k"].to_pylist() == [0]


def test_a_file_of_another_layout_is_made_again(made):
    path = Store(made).path(FIRST)
    table = pq.read_table(path)
    pq.write_table(table.replace_schema_metadata(table.schema.metadata).rename_columns(["other"]), path)
    assert execute(made, Engine()).done == 1


def test_results_say_what_is_there_and_what_is_missing(made):
    Store(made).path(FIRST).unlink()
    results = Results.read(made)
    assert results.missing == [FIRST]
    assert results.runs[["k", "slept"]].to_numpy().tolist() == [[k, 0.0] for k in range(1, 6)]
    assert (results.seconds["writing"] > 0).all()


def test_a_run_that_cannot_be_written_is_one_sentence_and_stops_nothing(made):
    path = Store(made).path(FIRST)
    path.unlink()
    path.mkdir()  # nothing can be written in its place
    tally = execute(made, Engine())
    (failed,) = tally.failed
    assert failed.name == FIRST.name
    assert re.fullmatch(r"cannot .*parquet.*", failed.note)
    assert tally.found == 5


def test_a_run_that_fails_fails_alone_with_its_traceback(tmp_path):
    tally = execute(Naps(bad=(2,), out=str(tmp_path)), Engine())
    (failed,) = tally.failed
    assert (failed.name, failed.status, tally.done) == ("nap2", FAILED, 5)
    assert "Traceback" in failed.note
    assert "ZeroDivisionError: nap 2" in failed.note


# Folders


def test_a_folder_of_other_settings_is_refused_before_anything_is_made(made):
    with pytest.raises(ValueError, match="holds runs with settings 'soft', wanted is 'hard'; choose another directory"):
        execute(replace(made, settings="hard"), Engine())


@pytest.mark.parametrize("field", ["code", "version of numpy", "version of highway-env"])
def test_runs_of_other_code_or_versions_are_refused(made, field):
    edited(made, {field: "older"})
    with pytest.raises(ValueError, match=f"holds runs with {field} 'older', wanted is"):
        Store(made).check()


def test_runs_of_another_study_are_refused(made):
    edited(made, {"study": "regret"})
    with pytest.raises(ValueError, match="holds runs of `testbed regret`, wanted are those of `testbed n"):
        Store(made).check()


def test_what_a_new_tracker_is_made_of_may_join_but_not_change(made):
    edited(made, {"code of mine": "abc"})
    Store(made).open()
    assert Store(made).about()["code of mine"] == "abc"


@pytest.mark.parametrize("name", [ROWS, "comparison.json", "drives"])
def test_a_folder_of_something_else_or_of_an_older_version_is_left_alone(tmp_path, name):
    (tmp_path / name).mkdir()
    for study in (Naps(out=str(tmp_path)), FreshNaps(out=str(tmp_path))):
        with pytest.raises(ValueError, match="holds other files than those of `testbed naps`, or runs of an older ver"):
            execute(study, Engine())
    assert (tmp_path / name).exists()


@pytest.mark.parametrize("text", ["", "{", "[1]", "null"])
def test_a_damaged_identity_is_refused(tmp_path, text):
    (tmp_path / ABOUT).write_text(text)
    with pytest.raises(ValueError, match=f"{ABOUT} is damaged; delete the folder"):
        Store(Naps(out=str(tmp_path))).check()


def test_a_study_that_wants_its_runs_fresh_deletes_others_and_nothing_else(tmp_path):
    study = FreshNaps(out=str(tmp_path))
    assert execute(study, Engine()).done == 6
    (tmp_path / "notes.txt").touch()
    assert execute(study, Engine()).found == 6
    assert execute(replace(study, settings="hard"), Engine()).done == 6
    assert (tmp_path / "notes.txt").exists()


@pytest.mark.parametrize("inside", [".", "deeper"])
def test_a_file_in_place_of_the_folder_is_refused(tmp_path, inside):
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"out: cannot write to .*; choose another directory"):
        Store(Naps(out=str(tmp_path / "file" / inside))).check()


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_directory_without_leave_to_write_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OSError, match=f"out: cannot write to {tmp_path}"):
        Store(Naps(out=str(tmp_path))).check()


def edited(study, changes):
    """Change what the folder says of itself."""
    path = Path(study.out) / ABOUT
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


# Interruption and order


def interrupt_when(there, seconds=60.0):
    """Send this process Ctrl-C as soon as `there()`."""

    def wait():
        deadline = time.monotonic() + seconds
        while not there() and time.monotonic() < deadline:
            time.sleep(0.005)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_leaves_whole_files_and_the_same_call_makes_the_rest(tmp_path, jobs):
    study = Naps(count=40, seconds=0.02, out=str(tmp_path))
    rows = tmp_path / ROWS
    thread = interrupt_when(lambda: len(list(rows.glob("*.parquet"))) > 2)
    tally = execute(study, Engine(jobs))
    thread.join()
    assert (tally.exit_status, tally.interrupted) == (130, True)
    assert 2 < tally.done < 40
    assert all(Store(study).is_made(work) for work in study.work() if Store(study).path(work).exists())
    again = execute(study, Engine(jobs))
    assert (again.exit_status, again.done + again.found) == (0, 40)
    assert again.found >= tally.done


@pytest.mark.parametrize(("kind", "said"), [(Naps, " naps"), (FreshNaps, "interrupted: the same")])
def test_an_interrupted_command_shows_what_there_is_unless_it_judges_the_whole(tmp_path, kind, said):
    study = kind(count=40, seconds=0.02, out=str(tmp_path))
    thread = interrupt_when(lambda: len(list((tmp_path / ROWS).glob("*.parquet"))) > 2)
    console = Console(record=True, width=200)
    assert carry_out(study, Engine(), console, Progress(disable=True)) == 130
    thread.join()
    text = console.export_text()
    assert said in text
    assert "the same command makes the rest" in text
    assert carry_out(study, Engine(), console, Progress(disable=True)) == 0
    assert "40 naps" in console.export_text()


def test_groups_stay_together_and_processes_begin_with_different_ones(monkeypatch):
    works = [Nap(k, 0.0) for k in range(40)]
    orders = []
    for process in range(6):
        monkeypatch.setattr(command.os, "getpid", lambda process=process: process)
        found = shuffled(works, lambda work: work.k // 2)
        assert sorted(found) == works
        assert all(a.k // 2 == b.k // 2 for a, b in zip(found[::2], found[1::2], strict=True))
        orders.append(found[0].k)
    assert len(set(orders)) > 1


def test_two_runs_of_one_name_are_refused(tmp_path):
    class Twice(Naps):
        def work(self):
            return [FIRST, FIRST]

    with pytest.raises(ValueError, match="two runs have the same name"):
        execute(Twice(out=str(tmp_path)), Engine())


def divided(a, b):
    """A calculation without files."""
    return a / b


@pytest.mark.parametrize("jobs", [1, 2])
def test_calculations_come_in_their_order_and_a_failure_is_told(jobs):
    assert list(calculated(divided, [(6, 2), (8, 4), (9, 9)], Engine(jobs))) == [3.0, 2.0, 1.0]
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        list(calculated(divided, [(1, 1), (1, 0)], Engine(jobs)))


def test_the_outcome_of_a_run_says_how_it_ended(made, tmp_path):
    store = Store(made, tmp_path)
    (tmp_path / ROWS).mkdir()
    assert make(FIRST, made, tmp_path).status == DONE
    assert store.is_made(FIRST)

"""`testbed compare` as a user meets it: sentences for wrong input, Ctrl-C, and going on."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pandas as pd
import psutil
import pyarrow.parquet as pq
import pytest

from testbed.compare.runs.config import Comparison, Settings
from testbed.compare.runs.results import RUNS, collect, write_runs
from testbed.compare.runs.tasks import ROWS, rows_path
from testbed.compare.runs.work import execute
from testbed.evaluation.metric import COSTS
from testbed.experiments.engine import Engine
from testbed.experiments.rows import check_part
from tests.testbed.command_line.refused import refused

PLAIN = {**os.environ, "COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"}
LONG = Comparison(("xia2020-lane",), ("rm-koch", "rm-feldmann"), tuple(range(6)), Settings("front", duration=0.5))
ASKED = ["compare", "xia2020-lane", "--radar", "front", "--duration", "0.5", "--seeds", "0:6"]
TRACKERS = ["--tracker", "rm-koch", "--tracker", "rm-feldmann"]


def refused_here(out, *args):
    """The sentence with which `testbed compare` is refused that writes to a folder."""
    return refused("compare", "xia2020-lane", "--out", out, *args)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["merg"], "no scenario 'merg'; did you mean 'merge'?"),
        (["--tracker", "htg-mapp"], "did you mean 'htg-map'?"),
        (["--radar", "frnt"], "did you mean 'front'?"),
        (["--planner", "imd"], "did you mean 'idm'?"),
        (["--seeds", "0:0"], "seeds '0:0' are empty"),
        (["--seeds", "many"], "seeds must read like 0:20, 0,3,7 or 5, got 'many'"),
        (["--tracker", "rm-koch", "--reference", "rm-vmm"], "reference 'rm-vmm' is not compared"),
        (["--duration", "nan"], "duration must be positive and finite, got nan s"),
        (["--loop", "half"], "loop must be one of open, closed"),
        (["--jobs", "0"], "jobs must be 1 or more, or -1 for all cores, got 0"),
        (["xia2020-lane"], "scenarios must differ"),
    ],
)
def test_wrong_input_is_one_sentence(tmp_path, args, sentence):
    assert sentence in refused_here(tmp_path, *args)


def test_an_out_that_cannot_be_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    assert "out: cannot write to" in refused_here(tmp_path / "file")


def test_a_folder_of_other_settings_is_one_sentence(tmp_path):
    (tmp_path / "comparison.json").write_text('{"radar": "front"}')
    assert "holds runs with radar 'front', wanted is 'surround'" in refused_here(tmp_path)


def test_tables_are_printed_where_they_cannot_be_written(tmp_path, command):
    (tmp_path / RUNS).mkdir()
    done = command(*ASKED[:-1], "0", "--tracker", "rm-koch", "--out", tmp_path)
    assert done.status == 2
    assert "GOSPA [m]" in done.out
    assert done.err.splitlines()[-1].startswith(f"testbed: cannot write {tmp_path / RUNS}: it is a directory;")


def test_a_closed_loop_shows_the_drives_and_keeps_them_with_their_units(tmp_path, command):
    asked = ["compare", "xia2020-lane", "--radar", "front", "--duration", "0.5", "--seeds", "0", "--loop", "closed"]
    done = command(*asked, "--tracker", "rm-koch", "--out", tmp_path)
    assert done.status == 0, done.err
    assert "the drives with 95 % intervals" in done.out
    assert "progress [m]" in done.out
    stored = pq.read_schema(tmp_path / RUNS)
    assert {name: stored.field(name).metadata[b"unit"] for name in ("progress", "tit")} == {
        "progress": b"m",
        "tit": b"s^2",
    }
    assert "The drives" in (tmp_path / "report.html").read_text()


def started(out):
    """A comparison on two processes that has made its first runs."""
    command = [sys.executable, "-m", "testbed", *ASKED, *TRACKERS, "--jobs", "2", "--out", str(out)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=PLAIN, start_new_session=True
    )
    deadline = time.monotonic() + 300
    while not list((out / ROWS).glob("*.parquet")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    return process


def test_the_workers_of_a_comparison_that_was_killed_end(tmp_path):
    process = started(tmp_path)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert len(workers) >= 2
    process.kill()
    process.wait()
    _, alive = psutil.wait_procs(workers, timeout=30)
    for worker in alive:
        worker.kill()
    assert alive == []


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """Folder, exit status and output of a comparison that got Ctrl-C after its first runs."""
    out = tmp_path_factory.mktemp("interrupted")
    process = started(out)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
    output, errors = process.communicate(timeout=300)
    return out, process.returncode, output, errors


def test_an_interrupted_comparison_says_so_and_leaves_whole_files(interrupted):
    out, status, output, errors = interrupted
    assert status == 130, errors
    assert "interrupted: tables of the runs made so far; the same command makes the rest" in output
    assert "Traceback" not in output + errors
    made = {task for task in LONG.tasks if rows_path(task, out).exists()}
    assert 0 < len(made) < len(LONG.tasks)
    for task in made:
        check_part(rows_path(task, out), task)


def test_it_goes_on_and_ends_with_the_tables_of_an_uninterrupted_one(interrupted, tmp_path):
    resumed, whole = replace(LONG, out=str(interrupted[0])), replace(LONG, out=str(tmp_path))
    report = execute(resumed, Engine(1))
    assert report.found > 0
    assert report.done == len(LONG.tasks) - report.found
    execute(whole, Engine(1))
    for task in LONG.tasks:
        a, b = (pq.read_table(rows_path(task, Path(c.out))) for c in (resumed, whole))
        assert a.equals(b, check_metadata=True)
    for comparison in (resumed, whole):
        write_runs(collect(comparison))
    frames = [pd.read_parquet(Path(c.out) / RUNS).drop(columns=list(COSTS)) for c in (resumed, whole)]
    pd.testing.assert_frame_equal(*frames, check_exact=True)

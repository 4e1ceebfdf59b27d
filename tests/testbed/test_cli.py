"""The command line as a user meets it, by its streams, its files and its exit status.

What runs for long, and what ends otherwise than by itself, has a process of its own; the rest is called in this one.
"""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from io import StringIO

import pytest
from rich.console import Console

import testbed
from scenarios import SCENARIOS
from scenarios.traffic.scenario import KEYS
from testbed.command_line import tables
from testbed.command_line.tables import light_table
from testbed.command_line.terminal import Terminal, busy
from testbed.log import reader
from testbed.log.text import OF_DRIVE, OF_TRACKER, shown
from trackers import DEFAULT

TESTBED = [sys.executable, "-m", "testbed"]
PLAIN = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}


def call(*args, **options):
    return subprocess.run(
        [*TESTBED, *map(str, args)], capture_output=True, text=True, env=PLAIN, timeout=120, check=False, **options
    )


def start(out, *args):
    """A long run that has written its first frames."""
    command = [*TESTBED, "run", "cut-in", "--radar", "front", "--duration", "600", "--out", str(out), *args]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=PLAIN)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        if any(has_frames(log) for log in out.glob("*.rrd")):
            return process
        time.sleep(0.2)
    process.kill()
    raise AssertionError(process.communicate())


def has_frames(log):
    """Whether there is more than the layout in a log that is being written, and no half message at its end."""
    if log.stat().st_size < 100_000 or log.read_bytes()[:4] != b"RRF2":
        return False
    try:
        return len(reader.steps(log)) > 1
    except (LookupError, ValueError, RuntimeError):
        return False


def test_a_run_prints_its_tables_and_where_its_files_are(tmp_path):
    done = call("run", "cut-in", "--radar", "front", "--duration", 1, "--seed", 3, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    name = f"cut-in_{DEFAULT}_front_idm_seed3_1s"
    for line in ("GOSPA [m]", "GOSPA: ", "NEES: ", "position RMSE [m]", "hardest braking [m/s^2]"):
        assert line in done.stdout
    assert f"testbed review {tmp_path / name}.rrd" in done.stdout
    assert {p.name for p in tmp_path.iterdir()} == {f"{name}.rrd", f"{name}.json"}
    assert len(done.stderr.strip().splitlines()) == 1  # the bar does not flood a file
    assert "1.0 / 1.0 s" in done.stderr


def test_a_run_without_metrics_prints_what_the_trackers_cost(tmp_path, command):
    tracker = ["--tracker", "rm-koch", "--radar", "front"]
    done = command("run", "cut-in", *tracker, "--duration", 0.4, "--no-metrics", "--log", "off", "--out", tmp_path)
    assert done.status == 0
    assert "cost of the trackers" in done.out
    assert "GOSPA" not in done.out


def test_a_focus_on_no_vehicle_is_reported(tmp_path, command):
    done = command("run", "lone-leader", "--radar", "front", "--duration", 1, "--focus", 99, "--out", tmp_path)
    assert done.status == 0
    assert "--focus: there was no vehicle 99; vehicles: 1" in " ".join(done.out.split())


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_leaves_a_whole_log_and_partial_results(tmp_path, number, status):
    process = start(tmp_path)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == status, err
    assert "interrupted" in out
    assert "Traceback" not in err
    (results,), (log,) = tmp_path.glob("*.json"), tmp_path.glob("*.rrd")
    found = json.loads(results.read_text())
    assert found["interrupted"]
    assert 0 < found["drive"]["elapsed"] < 600
    assert reader.complete(log)
    assert len(reader.steps(log)) == found["trackers"][DEFAULT]["scans"]


def test_a_killed_run_leaves_a_readable_log_and_no_results(tmp_path):
    process = start(tmp_path)
    process.kill()
    process.communicate(timeout=60)
    (log,) = tmp_path.iterdir()
    assert log.match("*_600s.unfinished-*.rrd")
    assert not reader.complete(log)
    steps = reader.steps(log).tolist()
    assert steps == list(range(len(steps)))
    assert steps


def test_a_disk_that_fills_up_costs_the_rest_of_the_log_and_nothing_else(tmp_path):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (2_100_000, 2_100_000))

    done = call(
        "run", "dense-traffic", "--tracker", "rm-feldmann", "--duration", 4, "--out", tmp_path, preexec_fn=limit
    )
    assert done.returncode == 2, done.stderr
    _, sentence = done.stderr.strip().splitlines()  # the first is the bar
    assert sentence.startswith("testbed: cannot write the log ")
    assert "dense-traffic_" in sentence
    assert re.search(r"\.rrd: File too large; it ends at [1-3]\.\d s$", sentence)
    assert "GOSPA [m]" in done.stdout
    assert "interrupted" not in done.stdout
    (results,), (log,) = tmp_path.glob("*.json"), tmp_path.glob("*.rrd")
    assert json.loads(results.read_text())["drive"]["elapsed"] == pytest.approx(4.0)
    first, last = reader.span(log)
    assert first == 0.0
    assert f"ends at {last:.1f} s" in sentence


@pytest.mark.slow
def test_two_runs_at_once_leave_whole_files(tmp_path):
    options = ["--tracker", "rm-feldmann", "--radar", "front", "--duration", "0.4", "--out", str(tmp_path)]
    command = [*TESTBED, "run", "cut-in", *options]
    both = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=PLAIN) for _ in range(2)]
    for process in both:
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
    (results,), (log,) = tmp_path.glob("*.json"), tmp_path.glob("*.rrd")
    assert len(list(tmp_path.iterdir())) == 2
    scans = json.loads(results.read_text())["trackers"]["rm-feldmann"]["scans"]
    assert reader.complete(log)
    assert reader.steps(log).tolist() == list(range(scans))


@pytest.mark.parametrize(
    ("args", "parts"),
    [
        (["run", "cut-inn"], ["scenario 'cut-inn'", "did you mean 'cut-in'"]),
        (["run", "cut-in", "--tracker", "rm"], ["tracker 'rm'", "rm-feldmann"]),
        (["run", "cut-in", "--radar", "sonar"], ["radar 'sonar'", "surround"]),
        (["run", "cut-in", "--planner", "me"], ["planner 'me'", "idle"]),
        (["run", "cut-in", "--log", "loud"], ["log", "'loud'", "metrics"]),
        (["run", "cut-in", "--seed", "-1"], ["seed", "-1"]),
        (["run", "cut-in", "--seed", "x"], ["--seed", "valid int", "testbed run --help"]),
        (["run", "cut-in", "--duration", "0"], ["duration", "0.0 s"]),
        (["run", "cut-in", "--duration", "inf"], ["duration", "inf s"]),
        (["run", "cut-in", "--out", "FILE"], ["out: cannot write to", "choose another directory"]),
        (["run"], ["scenario", "testbed run --help"]),
        (["run", "cut-in", "--sed", "1"], ["--sed", "testbed run --help"]),
        (["fly"], ["'fly'", "--help"]),
        (["list", "sonar"], ["catalogue 'sonar'", "radars"]),
        (["list", "traker"], ["catalogue 'traker'", "did you mean 'trackers'"]),
        (["review", "nowhere.rrd"], ["nowhere.rrd", "testbed run"]),
        (["review", "FILE"], ["is not a review log", ".rrd"]),
        (["review", "FILE", "--at", "3"], ["FILE"]),
        (["bench", "cut-inn"], ["did you mean 'cut-in'"]),
        (["bench", "--radar", "sonar"], ["radar 'sonar'"]),
        (["review"], ["at least one log", "testbed run"]),
        (["review", "--report", "nowhere"], ["no folder nowhere", "--out"]),
        (["review", "FILE", "--report", "."], ["--report shows a whole folder"]),
        (["review", "--report", "nowhere", "--view", "overview"], ["--report shows a whole folder"]),
        (["review", "FILE", "--html", "a.html", "--at", "3"], ["--at and --view go with --screenshot", "#t=3.5"]),
        (["review", "FILE", "--gif", "a.gif", "--view", "overview"], ["--at and --view go with --screenshot"]),
        (["review", "FILE", "--html", "a.html", "--web"], ["--web shows logs in a browser", "--html"]),
        (["run", "cut-in", "--log", "off", "--focus", "3"], ["focus 3 is of the log", "--log off"]),
        (["review", "FILE", "--focus", "3", "--html", "a.html"], ["--focus goes with the viewer", "#veh=3"]),
        (["calibrate", "--data", "nowhere"], ["nowhere", "objects.npz"]),
    ],
)
def test_a_wrong_command_line_is_one_sentence(tmp_path, monkeypatch, command, args, parts):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "FILE").touch()
    done = command(*args)
    assert done.status == 2
    assert done.out == ""
    (line,) = done.err.strip().splitlines()
    assert line.startswith("testbed: ")
    for part in parts:
        assert part in line
    assert [p.name for p in tmp_path.iterdir()] == ["FILE"]


@pytest.mark.parametrize("what", [None, *tables.entries()])
def test_catalogues_name_every_entry_within_80_columns(command, what):
    done = command("list", *([what] if what else []))
    assert done.status == 0
    lines = done.out.splitlines()
    assert max(map(len, lines)) <= 80
    first_words = {line.split()[0] for line in lines if line.split()}
    for name, entries in tables.entries().items():
        listed = {entry for entry, _ in entries} <= first_words
        assert listed == (what in (None, name))
    assert ("replay:FILE[:ego=ID,react=METRES,smooth=SECONDS]" in done.out) == (what in (None, "scenarios"))


@pytest.mark.parametrize("columns", [1, 5, 10, 20, 45])
def test_no_number_of_a_table_is_cut_on_a_narrow_terminal(monkeypatch, capsys, columns):
    table = light_table("a title that is longer than the terminal is wide")
    for name, justify in (("measure", "left"), ("tracker-with-a-long-name", "right"), ("other", "right")):
        table.add_column(name, justify=justify)
    table.add_row("localisation part of what is measured", "123456.789", "0.25")
    monkeypatch.setenv("COLUMNS", str(columns))
    Terminal().print(table)
    said = capsys.readouterr().out
    assert {"123456.789", "0.25"} <= set(said.split())
    assert "…" not in said


def test_a_table_is_as_before_where_it_has_room(monkeypatch, capsys):
    table = light_table("title")
    table.add_column("some words")
    table.add_column("number", justify="right")
    table.add_row("some words", "1.0")
    monkeypatch.setenv("COLUMNS", "80")
    for console in (Terminal(), Console()):
        console.print(table)
    said = capsys.readouterr().out
    assert said[: len(said) // 2] == said[len(said) // 2 :]


def test_a_folder_is_its_newest_log(tmp_path, command):
    done = command("review", tmp_path)
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert f"there is no log (.rrd) in {tmp_path}" in done.err
    for age, name in ((9, "old.rrd"), (1, "new.rrd"), (5, "older.rrd")):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    done = command("review", tmp_path, "--html", tmp_path / "a.html")
    assert f"log      {tmp_path / 'new.rrd'}, the newest of 3" in done.out
    assert f"{tmp_path / 'new.rrd'} is not a review log" in done.err


def test_the_list_of_scenarios_names_the_parameters_of_recorded_traffic():
    written = tables.BESIDE["scenarios"].partition("[:")[2].partition("]")[0]
    assert tuple(part.partition("=")[0] for part in written.split(",")) == KEYS


COMMANDS = (
    "list",
    "run",
    "replay",
    "record",
    "review",
    "bench",
    "learn-htg",
    "learn-spline",
    "compare",
    "regress",
    "reproduce",
    "calibrate",
)


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_has_an_example(command, name):
    done = command(*name.split(), "--help")
    assert done.status == 0
    assert f"Example: testbed {name}" in done.out
    assert max(map(len, done.out.splitlines())) <= 80


def test_the_version_is_shown(command):
    done = command("--version")
    assert (done.status, done.out) == (0, f"testbed {testbed.__version__}\n")


def test_without_a_command_the_help_is_shown():
    done = call()
    assert done.returncode == 2
    assert "calibrate" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_units_in_brackets_are_printed(tmp_path):
    """Rich takes brackets for markup unless they are escaped."""
    row = dict.fromkeys(OF_TRACKER, 1.0)
    drive = dict.fromkeys(OF_DRIVE, None) | {"elapsed": 2.0}
    facts = {"scenario": "s", "radar": "r", "seed": 0, "planner": "p", "trackers": ["a[red]"]}
    timing = {"wall": 1.0, "trackers": {"a[red]": {"ms_per_scan": 2.5}}}
    result = {"run": facts, "trackers": {"a[red]": row}, "drive": drive, "timing": timing}
    console = Console(width=80, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    console.print(tables.metrics(result))
    console.print(tables.drive(result))
    text = console.export_text()
    for label in (metric.title for metric in shown((*OF_TRACKER, *OF_DRIVE))):
        assert label in text
    assert text.count("a[red]") == 2
    assert "–" in text  # what was not measured


def test_every_scenario_says_its_duration_before_it_is_built():
    """The progress bar takes it from the catalogue."""
    assert all(scenario.duration > 0 for scenario in SCENARIOS.values())


@pytest.mark.parametrize("terminal", [True, False])
def test_a_long_reading_is_said_on_a_terminal_and_nowhere_else(monkeypatch, terminal):
    shown = StringIO()
    monkeypatch.setattr(shown, "isatty", lambda: terminal, raising=False)
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    with busy("reading [drive]"):
        pass
    assert ("reading [drive]" in shown.getvalue()) == terminal
    assert terminal or not shown.getvalue()

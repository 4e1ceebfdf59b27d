"""`testbed regress` as a user meets it, on a small part of the suite and the committed baselines."""

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from sensors.fault_text import KINDS, faults_of
from testbed.experiments.baselines import NONE
from testbed.experiments.command import check, execute
from testbed.experiments.compare import Settings
from testbed.experiments.engine import Engine
from testbed.experiments.regress import CASES, COMMITTED, FAULTS, Regress, orphans

ROOT = Path(__file__).parents[3]
TESTBED = [sys.executable, "-m", "testbed", "regress"]
PLAIN = {**os.environ, "COLUMNS": "160", "NO_COLOR": "1", "TERM": "dumb"}
TRACKERS = ("rm-feldmann", "htg-mm")
SCENARIOS = ("following", "u-turn")
PART = [a for t in TRACKERS for a in ("--tracker", t)] + [a for c in SCENARIOS for a in ("--scenario", c)]


def call(*args):
    command = [*TESTBED, *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, env=PLAIN, timeout=600, check=False)


@pytest.fixture
def told(monkeypatch, command):
    """The same in this process and with one job, which is quick where all runs are there: status, stdout, stderr."""
    monkeypatch.setenv("COLUMNS", PLAIN["COLUMNS"])
    return lambda *args: command("regress", *args, *([] if "--jobs" in args else ["--jobs", "1"]))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with the runs of the part, and what the command said; one job: its own processes start slowly."""
    out = tmp_path_factory.mktemp("regress")
    return out, call(*PART, "--jobs", 1, "--out", out)


@pytest.mark.slow
def test_the_code_at_hand_is_as_good_as_the_baselines(tmp_path):
    part = [a for t in ("rm-feldmann", "rm-surface", "htg-mm", "htg-map") for a in ("--tracker", t)]
    done = call(*part, "--scenario", "cut-in", "--scenario", "u-turn", "--jobs", 1, "--out", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "16 runs made, 0 found, 0 failed" in done.stdout
    assert "8 results compared with baselines: 8 good" in done.stdout


@pytest.fixture
def easier(tmp_path):
    """Baselines whose GOSPA of one tracker in one scenario was 20 % better."""

    def better(entry):
        entry["gospa"]["values"] = [0.8 * value for value in entry["gospa"]["values"]]

    return edited(tmp_path / "easier.json", lambda f: better(f["trackers"]["htg-mm"]["scenarios"]["following"]))


def edited(path, change):
    found = json.loads(COMMITTED.read_text())
    change(found)
    path.write_text(json.dumps(found))
    return path


def test_runs_repeat_their_committed_numbers(runs):
    _, done = runs
    assert done.returncode == 0, done.stdout + done.stderr
    assert "8 runs made, 0 found, 0 failed" in done.stdout
    assert "4 results compared with baselines: 4 good" in done.stdout


def test_a_worse_filter_fails_with_its_numbers_its_xml_and_its_log(told, runs, easier, tmp_path):
    out, _ = runs
    done = told(*PART, "--out", out, "--baselines", easier, "--junit", tmp_path / "deep" / "j.xml")
    assert done.status == 1, done.err
    assert "0 runs made, 8 found" in done.out
    (row,) = [line for line in done.out.splitlines() if "GOSPA" in line]
    assert row.split()[:2] == ["htg-mm,", "following"]
    (failed,) = [
        case for case in ElementTree.parse(tmp_path / "deep" / "j.xml").iter("testcase") if len(case.findall("failure"))
    ]
    assert (failed.get("classname"), failed.get("name")) == ("regress.htg-mm", "following")
    (log,) = (out / "logs").glob("*.rrd")
    assert log.stat().st_size > 100_000
    assert f"testbed review {log}" in done.out
    assert "following_htg-mm" in log.name


def test_what_got_better_is_told_and_passes(told, runs, tmp_path):
    def worse(entry):
        entry["gospa"]["values"] = [1.2 * value for value in entry["gospa"]["values"]]

    hard = edited(tmp_path / "b.json", lambda f: worse(f["trackers"]["rm-feldmann"]["scenarios"]["u-turn"]))
    status, said, _ = told(*PART, "--out", runs[0], "--baselines", hard)
    assert status == 0, said
    assert "better than the baselines" in said
    assert "regress --update" in said


def test_what_has_no_baseline_and_what_has_nothing_else_is_told_and_passes(told, runs, tmp_path):
    def change(found):
        found["trackers"]["old-filter"] = found["trackers"]["htg-mm"]
        found["trackers"]["rm-feldmann"]["scenarios"].pop("following")

    status, said, _ = told(*PART, "--out", runs[0], "--baselines", edited(tmp_path / "b.json", change))
    assert status == 0, said
    assert "new, without a baseline: rm-feldmann (following)" in said
    assert "gone, with a baseline: old-filter" in said


def test_results_without_any_baseline_are_no_pass_and_say_what_makes_them(told, runs, tmp_path):
    def change(found):
        for tracker in found["trackers"].values():
            for scenario in SCENARIOS:
                tracker["scenarios"].pop(scenario, None)

    bare = edited(tmp_path / "bare.json", change)
    status, said, _ = told(*PART, "--out", runs[0], "--baselines", bare)
    assert status == 1, said
    assert f"`testbed regress --update --baselines {bare} --tracker rm-feldmann" in said


def test_strict_fails_where_one_result_has_no_baseline(told, runs, tmp_path):
    known = edited(tmp_path / "b.json", lambda f: f["trackers"]["rm-feldmann"]["scenarios"].pop("following"))
    status, said, _ = told(*PART, "--out", runs[0], "--baselines", known, "--strict")
    assert status == 1, said
    assert "without a baseline: rm-feldmann (following)" in said


def test_the_filter_of_a_user_is_run_again_after_a_change_and_its_recordings_stay(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = (ROOT / "docs" / "examples" / "own_filter.py").read_text()
    part = {"baselines": tmp_path / "b.json", "update": True, "settings": Settings(duration=1.0)}
    made = []
    for changed in ("", "EXTRA = 1\n"):
        (tmp_path / "changing_filter.py").write_text(source + changed)
        study = Regress(("following",), ("changing_filter:Kalman",), (0,), out=str(tmp_path / "out"), **part)
        tally = execute(study, Engine(1))
        made.append((tally.done, [path.stat().st_mtime_ns for path in (tmp_path / "out" / "recordings").iterdir()]))
    assert made[0] == made[1] == (1, made[0][1])
    assert execute(study, Engine(1)).found == 1


def test_an_update_of_a_part_makes_it_pass_and_leaves_the_rest(told, runs, easier):
    before = json.loads(easier.read_text())
    status, said, _ = told(
        "--tracker", "htg-mm", "--scenario", "following", "--out", runs[0], "--baselines", easier, "--update"
    )
    assert status == 0, said
    assert "- htg-mm, changed in 1 of " in said
    after = json.loads(easier.read_text())
    changed = [
        (tracker, scenario)
        for tracker, entry in after["trackers"].items()
        for scenario, cell in entry["scenarios"].items()
        if cell["gospa"]["values"] != before["trackers"][tracker]["scenarios"][scenario]["gospa"]["values"]
    ]
    assert changed == [("htg-mm", "following")]
    assert told(*PART, "--out", runs[0], "--baselines", easier)[0] == 0


def test_a_first_update_counts_what_is_new(told, runs, tmp_path):
    status, said, _ = told(*PART, "--out", runs[0], "--baselines", tmp_path / "first.json", "--update")
    assert status == 0, said
    assert "- 4 new: " in said


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["--tracker", "htg-mapp"], "did you mean 'htg-map'?"),
        (["--scenario", "cutin"], "did you mean 'cut-in'?"),
        (["--tracker", "htg-map", "--tracker", "htg-map"], "trackers must differ"),
        (["--jobs", "0"], "jobs must be 1 or more"),
        (["--baselines", "no/such.json"], "make it with `testbed regress --update`"),
        (["--junit", "."], "junit: cannot write .: it is a directory"),
        (["--junit", "/proc/none/j.xml"], "junit: cannot write to /proc/none"),
        (["--out", "/proc/none"], "out: cannot write to /proc/none"),
    ],
)
def test_a_wrong_argument_is_one_sentence_before_the_long_run(told, args, sentence, tmp_path):
    status, said, complaint = told(*args, *([] if "--out" in args else ["--out", tmp_path / "runs"]))
    assert status == 2
    assert sentence in complaint
    assert len(complaint.strip().splitlines()) == 1
    assert said == ""


def test_a_folder_of_something_else_is_left_alone(told, tmp_path):
    (tmp_path / "rows").mkdir()
    (tmp_path / "rows" / "mine").touch()
    status, _, complaint = told("--out", tmp_path)
    assert status == 2
    assert "choose another directory" in complaint
    assert (tmp_path / "rows" / "mine").exists()


def test_the_help_has_examples(told):
    done = told("--help")
    assert done.status == 0
    assert "testbed regress --update --tracker htg-map" in done.out


def test_a_scenario_of_the_user_and_one_of_highway_env_have_baselines_of_their_own(tmp_path):
    scenarios = ("docs.examples.own_scenario:scenario", "highway-v0:vehicles_count=2,duration=1")
    suite = Regress.of(
        scenarios, ("rm-koch",), update=True, baselines=tmp_path / "none.json", out=str(tmp_path / "runs")
    )
    key = ("rm-koch", scenarios[1])
    old = NONE._replace(values={key: {}, ("rm-koch", "gone"): {}})
    assert orphans(old, suite) == [("rm-koch", "gone")]
    check(suite, Engine())


def test_the_fault_matrix_has_every_kind_and_can_be_run():
    assert {str(fault).split(":")[k] for text in FAULTS for fault in faults_of(text) for k in (0, 1)} >= set(KINDS)
    Regress().check()
    assert Regress().complete
    assert not Regress.of(["cut-in"], None).complete


def test_baselines_of_faults_that_are_no_longer_in_the_matrix_are_gone():
    values = {("rm-koch", f"cut-in+{fault}"): {} for fault in (FAULTS[0], "drop:0.9")}
    assert orphans(NONE._replace(values=values), Regress()) == [("rm-koch", "cut-in+drop:0.9")]


def test_a_fault_is_held_beside_the_scenario_without_it():
    assert Regress.of(["cut-in"], None, ["drop:.2"]).scenarios == ("cut-in", "cut-in+drop:0.2")
    assert set(Regress.of(["cut-in"], None, FAULTS).scenarios) == {"cut-in", *CASES[-len(FAULTS) :]}
    with pytest.raises(ValueError, match="must read"):
        Regress.of(["cut-in"], None, ["front:outtage:1:2"])

"""JUnit XML of findings made by hand."""

from xml.etree import ElementTree

import numpy as np
import pandas as pd

from testbed.experiments.baselines import NONE, Update, merge
from testbed.experiments.regress import Findings, Regress, examine, suites, worst_run
from testbed.experiments.report import junit
from testbed.experiments.run import FAILED, Outcome
from testbed.experiments.store import Results
from testbed.experiments.study import Tally
from testbed.experiments.tolerated import OVERALL, TOLERANCES, tolerated
from tests.testbed.experiments import made_suites

BASE = made_suites.make(4)
KEY, BROKEN, NEW = ("a", "scenario-3"), ("b", "scenario-0"), ("b", "scenario-9")
FAULTY = made_suites.changed(BASE, KEY, "gospa", BASE[KEY]["gospa"] + [0.5, 2.0])


def findings(new=FAULTY, failed=None, without=()):
    return Findings(list(BASE), tolerated(new, BASE), failed or {}, without, [], {KEY: 1.5})


def read(tmp_path, what):
    junit.write("regress", list(suites(what)), tmp_path / "j.xml")
    return ElementTree.parse(tmp_path / "j.xml").getroot()


def test_every_scenario_of_every_tracker_is_a_case(tmp_path):
    root = read(tmp_path, findings())
    assert [suite.get("name") for suite in root] == ["a", "b"]
    names = [case.get("name") for case in root[0]]
    assert names == [*made_suites.SCENARIOS, OVERALL]
    assert (root[0].get("tests"), root[0].get("failures"), root[1].get("failures")) == ("25", "1", "0")
    assert root[0].get("time") == "1.500"


def test_a_failure_has_the_numbers(tmp_path):
    root = read(tmp_path, findings())
    (case,) = [case for case in root.iter("testcase") if case.find("failure") is not None]
    assert (case.get("classname"), case.get("name")) == ("regress.a", "scenario-3")
    before = BASE[KEY]["gospa"].mean()
    assert f"GOSPA [m]: {before:.4g} -> {before + 1.25:.4g}, worse by 1.25" in case.find("failure").get("message")


def test_tracebacks_with_any_characters_still_parse(tmp_path):
    trace = "Traceback\n  <file> & \x1b[31m\x00 …\nValueError: told ]]> \ud800"
    root = read(tmp_path, findings(failed={BROKEN: trace}))
    (error,) = root.iter("error")
    assert error.get("message") == "ValueError: told ]]> ?"
    assert "<file> & ?[31m? …" in error.text
    assert root.get("errors") == "1"


def test_what_is_new_is_skipped_and_what_is_not_measured_any_more_fails(tmp_path):
    gone = made_suites.changed(BASE, KEY, "rmse_length", [np.nan, 1.0])
    root = read(tmp_path, findings(gone, without=[NEW]))
    assert root.get("skipped") == "1"
    (failure,) = root.iter("failure")
    assert "nothing measured any more" in failure.get("message")


def test_the_worst_run_is_the_seed_that_moved_most():
    baselines = merge(NONE, BASE, Update("", {}), ())
    assert worst_run(findings(), FAULTY, baselines) == (KEY, 1)


def test_the_worst_run_of_a_loss_everywhere_is_where_it_is_largest():
    new = BASE
    for k, c in enumerate(made_suites.SCENARIOS):
        new = made_suites.changed(new, ("a", c), "lost", BASE["a", c]["lost"] + [0.4, 0.41 if k == 7 else 0.4])
    what = findings(new)
    assert what.worse[0].scenario == OVERALL
    assert worst_run(what, new, merge(NONE, BASE, Update("", {}), ())) == (("a", "scenario-7"), 1)


def test_a_run_that_failed_is_a_failure_with_its_traceback(tmp_path):
    suite = Regress(("cut-in",), ("htg-mm", "htg-map"), out=str(tmp_path))
    gone = suite.run("cut-in", "htg-map", 1)
    made = [run for run in suite.work() if run != gone]
    ran = [suite.columns(run) for run in made]
    spans = pd.DataFrame([{"phase": "all", **run, **dict.fromkeys(TOLERANCES, 1.0)} for run in ran])
    results = Results(suite, spans, [gone], {run: {"seconds": {"tracking": 2.0}} for run in made})
    report = Tally(failed=[Outcome(gone.name, FAILED, "Traceback: told")])
    what = examine(results, report, NONE)
    assert what.failed == {("htg-map", "cut-in"): "Traceback: told"}
    assert not what.passed
    assert what.seconds["htg-mm", "cut-in"] == 4.0
    assert what.new == [("htg-mm", "cut-in")]  # nothing is said of a baseline for what failed
    assert [error.text for error in read(tmp_path, what).iter("error")] == ["Traceback: told"]


def test_no_run_at_all_is_a_failure_of_all(tmp_path):
    suite = Regress(("cut-in",), ("htg-mm",), out=str(tmp_path))
    what = examine(Results.read(suite), Tally(), NONE)
    assert set(what.failed) == {("htg-mm", "cut-in")}


def test_answers():
    assert findings(BASE).passed
    assert not findings().passed
    assert not findings(BASE, failed={BROKEN: "trace"}).passed

"""The page of a study of regret, from tables made by hand."""

import pandas as pd
import pytest

from testbed.experiments.pairs import MEASURES, scored
from testbed.experiments.regret import Judged, Regret, suites
from testbed.experiments.report.page import render
from testbed.experiments.report.regret import TABLE, find, page_of
from testbed.experiments.run import FAILED, Outcome
from testbed.experiments.store import Results
from testbed.experiments.study import Tally
from tests.testbed.experiments.report.pages import ODD, Page, check_links

ERRORS = {"gospa": 1.0, "rmse_position": 0.5}


def made(study, crashed=()):
    """Results, and pairs, in which every tracker is a tenth of a second worse than the one before."""
    drives, pairs = [], []
    for run in study.work():
        cost = 0.1 * study.conditions.index(run.condition) + 0.01 * run.seed
        driven = dict.fromkeys(MEASURES, 0.0) | {"progress": 100.0 - 240 * cost, "ttc_min": 10.0}  # score: 1 - cost
        key = {"scenario": run.scenario, "planner": run.planner, "condition": run.condition, "seed": run.seed}
        drives.append({"phase": "all", **key, **driven, **ERRORS, "cpu": 1.0})
        for reference in ("truth", "in-view"):
            if run.condition not in ("truth", reference):
                row = dict.fromkeys([*MEASURES, *TABLE], 0.0) | {"parted": 1.0, "parting": "then"}
                row["collisions"] = float(run.seed in crashed)
                pairs.append({"reference": reference, **key, **row})
    return Results(study, pd.DataFrame(drives)), pd.DataFrame(pairs)


def written(study, tmp_path, tally=None):
    results, pairs = made(study)
    path = tmp_path / "page.html"
    found = find(*scored(results.runs.drop(columns="phase"), pairs))
    path.write_text(render(page_of(results, found, tally or Tally())))
    page = Page(path)
    check_links(page)
    return page


@pytest.mark.parametrize(("planners", "trackers", "seeds"), [(1, 1, 1), (2, 2, 2), (1, 2, 1)])
def test_few_drives_read_like_sentences_and_say_that_no_interval_can_be_trusted(tmp_path, planners, trackers, seeds):
    names = ("idm", "mpc")[:planners], ("rm-koch", "rm-feldmann")[:trackers], tuple(range(seeds))
    page = written(Regret(("probe-brake",), *names, out=str(tmp_path)), tmp_path)
    assert not ODD.search(page.text)
    assert page.text.index("can be trusted") < page.text.index("tracks of rm-koch")
    assert not {"attribution", "doses", "figures", "runs"} & set(page.ids)
    assert ("Regret of rm-koch" in page.text) == (trackers == 1)
    assert ("The worst pairs" in page.text) == (planners * trackers > 1)


def test_enough_seeds_are_no_caveat_and_failures_are_said_with_their_reason(tmp_path):
    study = Regret(("probe-brake",), ("idm",), ("rm-koch",), (0, 1, 2), out=str(tmp_path))
    page = written(study, tmp_path, Tally(failed=[Outcome("probe-brake_idm", FAILED, "Traceback\nValueError: odd")]))
    assert "can be trusted" not in page.text
    assert "1 failed: ValueError: odd" in page.by_section["runs"]
    assert "With idm tracks of rm-koch cost score in brake." in page.by_section["verdict"]


def test_a_collision_that_the_truth_avoids_fails_its_case_in_junit(tmp_path):
    study = Regret(("probe-brake",), ("idm",), ("rm-koch",), (0, 1, 2), out=str(tmp_path))
    results, pairs = made(study, crashed=(1, 2))
    drives, pairs = scored(results.runs.drop(columns="phase"), pairs)
    found = Judged(drives, pairs, find(drives, pairs), {})
    driven, extra = suites(found, Tally(failed=[Outcome("lost", FAILED, "why")]))
    (case,) = driven.cases
    assert (case.kind, case.failure) == ("collision", "collides on 2 of 3 seeds on which the truth does not: 1, 2")
    assert case.output.startswith("drive score: -0.205 [")
    assert [(c.name, c.error) for c in extra.cases] == [("lost", "why")]

"""`testbed regret`: its drives, the self-test of the attribution, and the command as a user meets it."""

import re
from xml.etree.ElementTree import parse

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.evaluation.intervals import NO_INTERVAL, Interval
from testbed.experiments.command import execute
from testbed.experiments.drives import Curves, DriveWatch
from testbed.experiments.engine import Engine
from testbed.experiments.episode import episode
from testbed.experiments.pairs import Cell, Drive, curves
from testbed.experiments.regret import Limit, Regret, drives
from testbed.experiments.statistics import Change
from testbed.experiments.store import Results, Store, content
from testbed.log import reader
from tests.testbed.command_line.refused import refused


def made(condition, planner="idm", scenario="probe-passing"):
    """Curves, measures and decisions of a short drive."""
    study = Regret((scenario,), (planner,), ("rm-koch",), (200,), duration=2.0, warm_up=0.0)
    watch = DriveWatch(study.run(Drive(scenario, planner, condition, 200)))
    kept = watch.kept(episode(study.run(Drive(scenario, planner, condition, 200)), [watch]))
    return Curves.of(kept.table), {**kept.spans[0], **kept.more}


@pytest.fixture(scope="module")
def tracked():
    return made("rm-feldmann")


def test_with_all_groups_from_the_tracker_the_drive_is_that_of_the_tracker_bit_for_bit(tracked):
    found, meta = made("rm-feldmann:EGV")
    assert content(found.table()) == content(tracked[0].table())
    assert meta["decisions"] == tracked[1]["decisions"]
    assert content(made("rm-feldmann:V")[0].table()) != content(tracked[0].table())


def test_a_tracker_is_scored_in_its_own_drive(tracked):
    own, meta = tracked
    assert 0 < meta["gospa"] < 20
    assert len(meta["decisions"]) == len(meta["times"]) == 10
    assert len(own.drive.time) == len(own.action) == 31
    assert meta["progress"] == pytest.approx(np.hypot(*(own.pose[-1] - own.pose[0])[:2]), rel=1e-3)


def test_a_fault_of_the_radar_reaches_the_tracker_and_not_the_truth(tracked):
    blind = made("rm-feldmann+outage:0:9")[1]
    assert blind["missed_percent"] == 100.0
    assert tracked[1]["missed_percent"] < 50.0


def test_errors_put_into_what_is_in_view_change_the_drive():
    plain = made("in-view", scenario="probe-brake:gap=26")[0]
    wrong = made("in-view+near_edge=-3", scenario="probe-brake:gap=26")[0]
    assert plain.discrepancy[-1] == 0.0
    assert wrong.discrepancy[-1] > 1.0
    assert ": near edge -2." in wrong.cause[-1] or ": near edge -3." in wrong.cause[-1]
    assert wrong.drive.speed[-1] < plain.drive.speed[-1]


def test_a_planner_with_actions_of_its_own_drives():
    own, meta = made("in-view", "mpc")
    assert len(meta["decisions"][0]) == 2
    assert own.drive.speed[-1] > 10


def test_results_read_back_what_was_driven(tmp_path):
    study = Regret(("probe-brake",), ("idle",), ("rm-koch",), (3,), duration=0.4, out=str(tmp_path))
    assert execute(study, Engine()).done == 3
    gone, first = study.work()[2], study.work()[0]
    Store(study).path(gone).unlink()
    results = Results.read(study)
    assert [run.condition for run in results.missing] == ["rm-koch"]
    assert drives(results)["condition"].tolist() == ["truth", "in-view"]
    watch = DriveWatch(first)
    episode(first, [watch])
    assert content(curves(results, first).table()) == content(watch.curves.table())


ASKED = ["regret", "probe-brake", "--planner", "idle", "--tracker", "rm-koch", "--seeds", "0:3", "--duration", "0.4"]

WHOLE = [*ASKED, "--attribute", "--inject", "velocity_lag=0.5"]


def refused_here(out, *args):
    """The sentence with which `testbed regret` is refused that writes to a folder."""
    return refused("regret", "probe-brake", "--out", out, *args)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["probe-brak"], "did you mean 'probe-brake'?"),
        (["probe-brake:gab=3"], "probe-brake has no parameter gab; it has gap"),
        (["probe-brake:gap=300"], "gap must be a number from"),
        (["probe-brake:gap"], "has 'gap' where a parameter is due; write NAME:key=value"),
        (["--planner", "imd"], "did you mean 'idm'?"),
        (["--planner", "truth"], "planner truth has no regret"),
        (["--tracker", "htg-mapp"], "did you mean 'htg-map'?"),
        (["--tracker", "in-view"], "in-view is no tracker"),
        (["--inject", "lag=1"], "names are velocity_lag"),
        (["--inject", "latency=1", "--inject", "latency=1"], "inject must differ"),
        (["--radar", "frnt"], "did you mean 'front'?"),
        (["--jobs", "0"], "jobs must be 1 or more"),
        (["probe-brake"], "scenarios must differ"),
        (["--limit", "colisions=0"], "no limit 'colisions'; did you mean 'collisions'?"),
        (["--limit", "collisions=-1"], "limit must be NAME=VALUE with a number from 0 on"),
        (["--limit", "score"], "limit must be NAME=VALUE with a number from 0 on"),
    ],
)
def test_wrong_input_is_one_sentence(tmp_path, args, sentence):
    assert sentence in refused_here(tmp_path, *args)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A small study: its folder and what the command said."""
    out = tmp_path_factory.mktemp("regret")
    done = CliRunner().invoke(app, [*WHOLE, "--junit", str(out / "regret.xml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out, done


def test_the_drives_are_in_one_table_and_the_same_command_finds_them(first):
    out, done = first
    assert "31 runs made, 0 found, 0 failed" in done.output  # 3 x (truth, in-view, tracker, 6 subsets, 1 dose) + 1
    table = pd.read_parquet(out / "drives.parquet")
    assert len(table) == 31
    assert table["drive_value"].notna().all()
    again = CliRunner().invoke(app, [*WHOLE, "--out", str(out)])
    assert "0 runs made, 31 found, 0 failed" in again.output


def test_a_limit_decides_about_the_exit_status_and_the_case(tmp_path):
    out, xml = str(tmp_path / "out"), tmp_path / "limits.xml"
    asked = ["regret", "probe-brake", "--tracker", "rm-koch", "--seeds", "200", "--duration", "5", "--out", out]
    for limit, status in (("score=1", 0), ("score=0", 1)):
        done = CliRunner().invoke(app, [*asked, "--limit", limit, "--junit", str(xml)])
        assert done.exit_code == status, done.output
        assert ("than the truth, allowed 0" in done.output) == (status == 1)
        assert (f"within the limits: {limit}" in done.output) == (status == 0)
        cases = list(parse(xml).getroot().iter("testcase"))
        assert any(case.find("failure[@type='limit']") is not None for case in cases) == (status == 1)


@pytest.mark.parametrize(
    ("measure", "change", "exceeded"),
    [("collisions", 0.1, True), ("collisions", -0.1, False), ("drive_value", 0.3, False), ("drive_value", -0.3, True)],
)
def test_a_limit_counts_what_is_worse_than_on_the_truth(measure, change, exceeded):
    cell = Cell("probe", "idm", "t", measure, Change(Interval(change, -1, 1), NO_INTERVAL, NO_INTERVAL, 9, 0))
    assert bool(Limit(measure, 0.05).exceeded(cell)) == exceeded
    assert not Limit("tit", 0.0).exceeded(cell)


def test_drives_of_other_settings_are_refused(first):
    assert "holds runs with duration 0.4, wanted is None" in refused_here(first[0])


def test_the_page_has_all_its_parts_and_its_links_lead_somewhere(first):
    out, done = first
    page = (out / "report.html").read_text()
    ids = set(re.findall(r'id="([^"]+)"', page))
    links = re.findall(r'(?:href|src)="([^"]+)"', page)
    assert {"overview", "total", "tracking", "sensing", "attribution", "doses", "worst"} <= ids
    assert [link for link in links if link.startswith("#") and link[1:] not in ids] == []
    assert [link for link in links if not link.startswith("#") and not (out / link).exists()] == []
    assert "existence" in page
    assert "velocity_lag=0.5" in page


def test_junit_has_a_case_a_scenario_and_the_self_test(first):
    out, _ = first
    root = parse(out / "regret.xml").getroot()
    assert [suite.get("name") for suite in root] == ["idle rm-koch", "idle in-view+velocity_lag=0.5", "drives"]
    assert [case.get("name") for case in root[0]] == ["probe-brake"]
    assert [case.get("classname") for case in root[2]] == ["regret.self-test"]
    assert root[2].get("failures") == "0"


def test_the_worst_pair_is_one_log_with_both_drives_on_one_timeline(first):
    (log,) = (first[0] / "logs").glob("*rm-koch*.rrd")
    assert reader.complete(log)
    drawn = {path.strip("/") for path in reader.entity_paths(log)}
    assert {"truth/world/truth/contour", "tracks/world/trackers/tracks/extent"} <= drawn
    curves = reader.scalars(log, "drive/speed/**")
    assert [len(steps) for steps, _ in curves.values()] == [22, 22]  # 1.4 s at 15 Hz, with the first
    assert reader.span(log) == (0.0, pytest.approx(1.4))

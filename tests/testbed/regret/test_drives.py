"""Drives under conditions: files, the self-test of the attribution, and that errors reach the planner."""

import numpy as np
import pytest

from testbed.experiments.rows import content
from testbed.experiments.run import DONE, FAILED, FOUND
from testbed.regret.drives import FOLDER, drive, drive_path, driven
from testbed.regret.results import Results
from testbed.regret.study import Settings, Study, Task

SHORT = Settings(duration=2.0, warm_up=0.0)


def made(condition, planner="idm", scenario="probe-passing"):
    return driven(Task(scenario, planner, condition, 200), SHORT)


@pytest.fixture(scope="module")
def tracked():
    return made("rm-feldmann")


def test_with_all_groups_from_the_tracker_the_drive_is_that_of_the_tracker_bit_for_bit(tracked):
    curves, meta = made("rm-feldmann:EGV")
    assert content(curves.table()) == content(tracked[0].table())
    assert meta["decisions"] == tracked[1]["decisions"]
    assert content(made("rm-feldmann:V")[0].table()) != content(tracked[0].table())


def test_a_tracker_is_scored_in_its_own_drive(tracked):
    curves, meta = tracked
    assert 0 < meta["tracking"]["gospa"] < 20
    assert len(meta["decisions"]) == len(meta["times"]) == 10
    assert len(curves.drive.time) == len(curves.action) == 31
    assert meta["measures"]["progress"] == pytest.approx(np.hypot(*(curves.pose[-1] - curves.pose[0])[:2]), rel=1e-3)


def test_a_fault_of_the_radar_reaches_the_tracker_and_not_the_truth(tracked):
    blind = made("rm-feldmann+outage:0:9")[1]["tracking"]
    assert blind["missed_percent"] == 100.0
    assert tracked[1]["tracking"]["missed_percent"] < 50.0


def test_errors_put_into_what_is_in_view_change_the_drive():
    plain = made("in-view", scenario="probe-brake:gap=26")[0]
    wrong = made("in-view+near_edge=-3", scenario="probe-brake:gap=26")[0]
    assert plain.discrepancy[-1] == 0.0
    assert wrong.discrepancy[-1] > 1.0
    assert ": near edge -2." in wrong.cause[-1] or ": near edge -3." in wrong.cause[-1]
    assert wrong.drive.speed[-1] < plain.drive.speed[-1]


def test_a_planner_with_actions_of_its_own_drives():
    curves, meta = made("in-view", "mpc")
    assert len(meta["decisions"][0]) == 2
    assert curves.drive.speed[-1] > 10


def test_a_drive_is_made_once_and_again_where_its_file_is_damaged(tmp_path):
    (tmp_path / FOLDER).mkdir()
    task = Task("probe-brake", "idle", "truth", 3)
    settings = Settings(duration=0.4)
    assert drive(task, settings, tmp_path).status == DONE
    assert drive(task, settings, tmp_path).status == FOUND
    path = drive_path(task, tmp_path)
    path.write_bytes(path.read_bytes()[:-100])
    again = drive(task, settings, tmp_path)
    assert again.status == DONE
    assert "is damaged" in again.note
    assert drive(task._replace(scenario="nowhere"), settings, tmp_path).status == FAILED


def test_results_read_back_what_was_driven(tmp_path):
    (tmp_path / FOLDER).mkdir()
    study = Study(("probe-brake",), ("idle",), ("rm-koch",), (3,), Settings(duration=0.4), out=str(tmp_path))
    for task in study.tasks[:2]:
        drive(task, study.settings, tmp_path)
    results = Results(study)
    assert [t.condition for t in results.missing] == ["rm-koch"]
    assert results.table["condition"].tolist() == ["truth", "in-view"]
    curves, _ = driven(study.tasks[0], study.settings)
    assert content(results.curves(study.tasks[0]).table()) == content(curves.table())

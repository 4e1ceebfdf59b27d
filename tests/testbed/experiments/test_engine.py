"""Many processes do what one does, and killed ones stop nothing."""

import pytest

from testbed.experiments.engine import Engine, check, perform
from testbed.experiments.run import DONE, FAILED
from tests.testbed.experiments.orders import DIES, DIES_ONCE, FAILS, orders, status, work


def test_two_processes_give_the_outcomes_of_one(tmp_path):
    tasks = orders(tmp_path, t3=FAILS)
    one, two = (list(perform(work, tasks, Engine(jobs))) for jobs in (1, 2))
    assert sorted(one) == sorted(two)
    assert [o.note for o in two if o.status == FAILED] == ["ZeroDivisionError of t3"]


def test_a_task_whose_process_was_killed_is_done_again(tmp_path):
    outcomes = list(perform(work, orders(tmp_path, t2=DIES_ONCE), Engine(2)))
    assert status(outcomes) == {f"t{k}": DONE for k in range(8)}
    assert (tmp_path / "t2").exists()


@pytest.mark.slow
def test_a_task_that_kills_process_after_process_is_reported_and_the_others_are_done(tmp_path):
    outcomes = list(perform(work, orders(tmp_path, t1=DIES, t2=DIES_ONCE), Engine(2)))
    assert status(outcomes) == {f"t{k}": FAILED if k == 1 else DONE for k in range(8)}
    assert "its process was killed again and again" in next(o.note for o in outcomes if o.name == "t1")
    assert (tmp_path / "t2").exists()


def test_an_iterator_that_is_closed_early_leaves_the_rest(tmp_path):
    outcomes = perform(work, orders(tmp_path), Engine(1))
    first = next(outcomes)
    outcomes.close()
    assert first.status == DONE
    assert list(outcomes) == []


def test_nothing_to_do_is_nothing_done():
    assert list(perform(work, [], Engine(2))) == []


@pytest.mark.parametrize("jobs", [0, -2])
def test_a_number_of_jobs_that_cannot_be_is_refused(jobs):
    with pytest.raises(ValueError, match=f"jobs must be 1 or more, or -1 for all cores, got {jobs}"):
        check(Engine(jobs))

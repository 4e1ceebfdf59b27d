"""Many processes do what one does, and killed ones, here or on a cluster, stop nothing."""

import gc
import os
import signal
import socket
from pathlib import Path
from typing import NamedTuple

import pytest
from distributed import LocalCluster

from testbed.compare.runs.engine import Engine, check, cluster, perform
from testbed.compare.runs.tasks import DONE, FAILED, Outcome

FINE, FAILS, DIES_ONCE, DIES = "fine", "fails", "dies once", "dies"


class Order(NamedTuple):
    """A task that the tests give."""

    name: str
    fate: str = FINE


def work(order, folder):
    """What an order asks for; a marker remembers that its process was killed once."""
    marker = Path(folder) / order.name
    if order.fate == DIES or (order.fate == DIES_ONCE and not marker.exists()):
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if order.fate == FAILS:
        return Outcome(order.name, FAILED, f"ZeroDivisionError of {order.name}")
    return Outcome(order.name, DONE, f"{folder}/{order.name}")


def orders(folder, **fates):
    """Eight tasks, of which some have a fate."""
    names = [f"t{k}" for k in range(8)]
    return [(Order(name, fates.get(name, FINE)), str(folder)) for name in names]


def status(outcomes):
    found = [outcome.name for outcome in outcomes]
    assert len(set(found)) == len(found)
    return {outcome.name: outcome.status for outcome in outcomes}


@pytest.fixture(scope="module")
def local_cluster():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as made:
        yield made


@pytest.fixture
def collected():
    """Collect garbage after the test: a client that found no scheduler closes itself then.

    Where that happens while another client starts, both wait for the same lock of dask for good.
    """
    yield
    gc.collect()


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


def test_a_cluster_gives_the_outcomes_of_one_process(tmp_path, local_cluster):
    engine = Engine(dask=local_cluster.scheduler_address)
    tasks = orders(tmp_path, t3=FAILS)
    with cluster(engine):
        there = list(perform(work, tasks, engine))
    assert sorted(there) == sorted(perform(work, tasks, Engine(1)))


def test_a_killed_worker_of_a_cluster_is_replaced_and_its_task_done_again(tmp_path, local_cluster):
    engine = Engine(dask=local_cluster.scheduler_address)
    with cluster(engine):
        outcomes = list(perform(work, orders(tmp_path, t4=DIES_ONCE), engine))
    assert status(outcomes) == {f"t{k}": DONE for k in range(8)}
    assert (tmp_path / "t4").exists()


@pytest.mark.slow
def test_a_task_that_kills_worker_after_worker_of_a_cluster_is_reported(tmp_path, local_cluster):
    engine = Engine(dask=local_cluster.scheduler_address)
    with cluster(engine):
        outcomes = list(perform(work, orders(tmp_path, t4=DIES), engine))
    assert status(outcomes) == {f"t{k}": FAILED if k == 4 else DONE for k in range(8)}


def closed_port():
    """Address at which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.mark.parametrize("find", [closed_port, lambda: "nowhere", lambda: "tcp://127.0.0.1:port"])
@pytest.mark.usefixtures("collected")
def test_a_cluster_that_does_not_answer_is_told(find):
    address = find()
    with (
        pytest.raises(OSError, match=r"dask: no scheduler answers at '.*' \(.*\); is the cluster running\?"),
        cluster(Engine(dask=address)),
    ):
        pass


@pytest.mark.usefixtures("collected")
def test_a_cluster_without_workers_is_told():
    with LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=50) as empty:
        address = empty.scheduler_address
        with (
            pytest.raises(OSError, match=f"dask: the cluster at '{address}' has no workers; start `dask worker"),
            cluster(Engine(dask=address)),
        ):
            pass


@pytest.mark.parametrize("jobs", [0, -2])
def test_a_number_of_jobs_that_cannot_be_is_refused(jobs):
    with pytest.raises(ValueError, match=f"jobs must be 1 or more, or -1 for all cores, got {jobs}"):
        check(Engine(jobs))

"""A cluster does what one process does, without a folder in common, and says in a sentence what it lacks."""

import gc
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from distributed import Client, LocalCluster

from testbed.evaluation.metric import COSTS
from testbed.experiments.cluster import Folder, carried, connected, difference, environment, modules_in
from testbed.experiments.command import calculated, execute
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.engine import Engine, check, perform
from testbed.experiments.report import logs
from testbed.experiments.run import DONE, FAILED, Outcome, Run
from testbed.experiments.store import RECORDINGS, ROWS, RUNS, Results, Store
from tests.testbed.experiments.naps import Naps
from tests.testbed.experiments.orders import DIES, DIES_ONCE, FAILS, FINE, Order, orders, status, work

ROOT = Path(__file__).resolve().parents[3]
WANTED = Comparison(("xia2020-lane",), ("rm-koch", "rm-feldmann"), (0, 1), Settings("front", duration=1.0))


@pytest.fixture(scope="module")
def engine():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as made:
        yield Engine(dask=made.scheduler_address)


@pytest.fixture
def collected():
    """Collect garbage after the test: a client that found no scheduler closes itself then.

    Where that happens while another client starts, both wait for the same lock of dask for good.
    """
    yield
    gc.collect()


def test_a_cluster_gives_the_outcomes_of_one_process(tmp_path, engine):
    tasks = orders(tmp_path, t3=FAILS)
    assert sorted(perform(work, tasks, engine)) == sorted(perform(work, tasks, Engine(1)))


def test_a_killed_worker_of_a_cluster_is_replaced_and_its_task_done_again(tmp_path, engine):
    outcomes = list(perform(work, orders(tmp_path, t4=DIES_ONCE), engine))
    assert status(outcomes) == {f"t{k}": DONE for k in range(8)}
    assert (tmp_path / "t4").exists()


@pytest.mark.slow
def test_a_task_that_kills_worker_after_worker_of_a_cluster_is_reported(tmp_path, engine):
    outcomes = list(perform(work, orders(tmp_path, t4=DIES), engine))
    assert status(outcomes) == {f"t{k}": FAILED if k == 4 else DONE for k in range(8)}
    assert "KilledWorker" in next(o.note for o in outcomes if o.name == "t4")


def test_a_cluster_whose_work_was_left_early_does_other_work(tmp_path, engine):
    left = perform(work, orders(tmp_path), engine)
    assert next(left).status == DONE
    left.close()
    assert status(list(perform(work, orders(tmp_path), engine))) == {f"t{k}": DONE for k in range(8)}


def louder(order, folder):
    """Write the text of a file in capitals beside it; other files of its folder must not be there."""
    inside = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    if inside != [f"in/{order.name}"]:
        return Outcome(order.name, FAILED, f"found {inside}")
    (folder / "out" / order.name).write_text((folder / "in" / order.name).read_text().upper())
    return Outcome(order.name, DONE)


def test_files_that_a_task_reads_and_makes_travel_and_no_others(tmp_path, engine):
    for name in ("in", "out"):
        (tmp_path / name).mkdir()
    tasks = orders(tmp_path)
    for order, _ in tasks:
        (tmp_path / "in" / order.name).write_text(f"text of {order.name}")
    (tmp_path / "out" / "t5").mkdir()  # nothing can be written in its place
    outcomes = list(perform(louder, tasks, engine, lambda order, folder: [folder / "in" / order.name]))
    assert status(outcomes) == {f"t{k}": FAILED if k == 5 else DONE for k in range(8)}
    assert "cannot write" in next(o.note for o in outcomes if o.name == "t5")
    assert {p.name: p.read_text() for p in (tmp_path / "out").iterdir() if p.is_file()} == {
        f"t{k}": f"TEXT OF T{k}" for k in range(8) if k != 5
    }


def assert_same_results(a, b):
    """Rows and measures to the bit, but for wall times."""
    for run in a.work():
        one, two = (Store(c).table(run) for c in (a, b))
        assert one.equals(two, check_metadata=True), run
    frames = [Results.read(c).spans.drop(columns=list(COSTS)) for c in (a, b)]
    pd.testing.assert_frame_equal(*frames, check_exact=True)


def test_a_cluster_gives_the_rows_and_logs_of_one_process_also_where_files_are_damaged(tmp_path, engine):
    here, there = (replace(WANTED, out=str(tmp_path / name)) for name in ("here", "there"))
    assert execute(here, Engine(1)).done == execute(there, engine).done == 4
    assert_same_results(here, there)
    store, (damaged, _, _, last) = Store(there), there.work()
    store.path(damaged).write_bytes(b"")
    store.recording_path(damaged).write_bytes(b"")
    store.path(last).unlink()
    intact = store.recording_path(last)
    before = intact.read_bytes()
    tally = execute(there, engine)
    assert (tally.done, tally.found) == (2, 2)
    assert intact.read_bytes() == before, "recorded again, with other wall times"
    assert [o.note.startswith(f"{store.path(damaged)} is damaged") for o in tally.redone] == [True]
    assert_same_results(here, there)
    results = Results.read(there)
    found = logs.picks(results)
    assert [o.status for o in logs.write(results, engine)] == [DONE] * 4
    assert all(logs.log_path(pick, store.out).stat().st_size > 1000 for pick in found)


def test_a_cluster_does_a_study_of_anything_and_calculations(tmp_path, engine):
    study = Naps(bad=(3,), out=str(tmp_path))
    tally = execute(study, engine)
    assert (tally.done, [outcome.name for outcome in tally.failed]) == (5, ["nap3"])
    assert all(Store(study).is_made(work) for work in study.work() if work.k != 3)
    assert list(calculated(divmod, [(7, 2), (9, 4)], engine)) == [(3, 1), (2, 1)]


def test_a_worker_of_another_environment_does_nothing():
    wanted = environment() | {"numpy": "1.0"}
    outcome, files = carried(work, (Order("t0", FINE, ""),), Folder("", (), {}), wanted)
    assert outcome.status == FAILED
    assert outcome.note.startswith(f"its worker has numpy {environment()['numpy']}, here is 1.0; install the same")
    assert files == {}
    assert difference(wanted, {}).startswith("Python None, here is 3.")


def test_a_worker_without_the_module_of_a_user_does_nothing_and_says_so(tmp_path, monkeypatch):
    (tmp_path / "my_tracker.py").write_text("from trackers import RandomMatrix\n\ntuned = RandomMatrix()\n")
    (tmp_path / "my_worker.py").write_text("act = min\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    runs = [
        Run("cut-in", source=name, planner="my_worker:act:a=1") for name in ("rm-koch", "my_tracker:tuned:sigma=0.3")
    ]
    tasks = [(run, tmp_path) for run in runs]
    assert modules_in(tasks[:1]) == ("my_worker",)
    modules = modules_in(tasks)
    assert modules == ("my_tracker", "my_worker")
    assert modules_in([(Order("my_tracker:tuned+covariance=4", FINE, ""), tmp_path)]) == ("my_tracker",)
    wanted = environment(modules)
    (tmp_path / "my_tracker.py").unlink()
    environment.cache_clear()
    outcome, files = carried(work, (Order("t0", FINE, ""),), Folder("", (), {}), wanted, modules)
    assert (outcome.status, files) == (FAILED, {})
    assert outcome.note == (
        "its worker has not found the module my_tracker; install its package there, or start the worker in its folder"
    )
    (tmp_path / "my_tracker.py").write_text("from trackers import RandomMatrix\n\ntuned = RandomMatrix(sigma=1.0)\n")
    environment.cache_clear()
    outcome, _ = carried(work, (Order("t0", FINE, ""),), Folder("", (), {}), wanted, modules)
    assert outcome.note.startswith("its worker has the module my_tracker ")


def closed_port():
    """Address at which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.mark.parametrize("find", [closed_port, lambda: "nowhere", lambda: "tcp://127.0.0.1:port"])
@pytest.mark.usefixtures("collected")
def test_a_cluster_that_does_not_answer_is_one_sentence(find):
    sentence = r"dask: no scheduler answers at '.*' \(.*\); is the cluster running\?"
    with pytest.raises(OSError, match=sentence), connected(find(), timeout=0.5):
        pass


@pytest.mark.parametrize(
    ("workers", "threads", "sentence"),
    [(0, 1, "has no workers; start `dask worker inproc://.* --nthreads 1`"), (1, 2, "must have one thread, got 2")],
)
@pytest.mark.usefixtures("collected")
def test_a_cluster_that_cannot_do_the_work_is_one_sentence(workers, threads, sentence):
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=threads,
            processes=False,
            dashboard_address=":0",
            silence_logs=50,
        ) as made,
        pytest.raises(OSError, match=f"dask: .*{sentence}"),
    ):
        check(Engine(dask=made.scheduler_address))


@contextmanager
def dask(folder, *args, code=ROOT):
    """A process of `dask ARGS` that works in a folder of its own, and imports our packages from `code`."""
    folder.mkdir()
    command = [sys.executable, "-m", "dask", *map(str, args)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(code)}, **quiet)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


@contextmanager
def real_cluster(folder, code=(ROOT, ROOT)):
    """Address of a scheduler, and its workers, each a process without a nanny in a folder of its own."""
    known = folder / "scheduler.json"
    where = ["--scheduler-file", known, "--no-dashboard"]
    with ExitStack() as stack:
        stack.enter_context(dask(folder / "scheduler", "scheduler", "--port", 0, *where))
        workers = [
            stack.enter_context(
                dask(folder / f"worker{k}", "worker", "--nthreads", 1, "--no-nanny", *where, code=place)
            )
            for k, place in enumerate(code)
        ]
        deadline = time.monotonic() + 120
        while not known.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        address = json.loads(known.read_text())["address"]
        with Client(address, set_as_default=False, timeout=60) as client:
            client.wait_for_workers(len(workers), timeout=120)
        yield address, workers


def compare(comparison, address, folder):
    """The process of `testbed compare --dask ADDRESS` in a folder."""
    command = [sys.executable, "-m", "testbed", "compare", *comparison.scenarios, "--dask", address]
    command += [part for tracker in comparison.trackers for part in ("--tracker", tracker)]
    command += ["--seeds", ",".join(map(str, comparison.seeds)), "--radar", comparison.settings.radar]
    command += ["--duration", str(comparison.settings.duration), "--out", Path(comparison.out).name]
    env = {**os.environ, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", "TERM": "dumb"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=folder, env=env, **pipes)


def when_half_way(comparison, process):
    """Wait until some runs are made; returns how many."""
    rows = Path(comparison.out) / ROWS
    deadline = time.monotonic() + 300
    while not (made := len(list(rows.glob("*.parquet")))) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    return made


@pytest.mark.slow
def test_the_command_on_a_real_cluster_that_loses_a_worker_gives_the_tables_of_one_process(tmp_path):
    there = replace(WANTED, seeds=tuple(range(6)), settings=Settings("front", duration=4.0), out=str(tmp_path / "out"))
    here = replace(there, out=str(tmp_path / "here"))
    with real_cluster(tmp_path) as (address, workers):
        process = compare(there, address, tmp_path)
        made = when_half_way(there, process)
        workers[0].kill()
        output, errors = process.communicate(timeout=300)
    assert 0 < made < 12
    assert process.returncode == 0, errors
    assert "12 runs made, 0 found, 0 failed" in output
    assert "Traceback" not in errors
    execute(here, Engine(1))
    assert_same_results(here, there)
    out = Path(there.out)
    assert len(pd.read_parquet(out / RUNS)) == len(Results.read(here).spans)
    assert {path.name for path in (out / RECORDINGS).iterdir()} == {f"xia2020-lane_front_seed{k}.npz" for k in range(6)}
    picked = {logs.log_path(pick, out).name for pick in logs.picks(Results.read(there))}
    assert {path.name for path in (out / logs.FOLDER).glob("*.rrd")} == picked
    assert len(picked) == 6
    page = (out / "report.html").read_text()
    assert all(name.replace("+", "%2B") in page for name in picked)
    assert [list((tmp_path / f"worker{k}").iterdir()) for k in (0, 1)] == [[], []]


@pytest.mark.slow
def test_ctrl_c_on_a_real_cluster_leaves_whole_files_and_the_same_command_goes_on(tmp_path):
    comparison = replace(WANTED, seeds=tuple(range(6)), out=str(tmp_path / "out"))
    with real_cluster(tmp_path) as (address, _):
        process = compare(comparison, address, tmp_path)
        when_half_way(comparison, process)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=300)
        assert process.returncode == 130, errors
        assert "interrupted: tables of the runs made so far; the same command makes the rest" in output
        assert "Traceback" not in errors
        tally = execute(comparison, Engine(dask=address))
    assert (tally.found + tally.done, tally.failed) == (12, [])
    assert tally.found > 0


@pytest.mark.slow
def test_a_worker_with_other_code_or_without_ours_is_one_sentence(tmp_path):
    other, none = tmp_path / "other code", tmp_path / "no code"
    for package in ("scenarios", "sensors", "testbed", "trackers"):
        shutil.copytree(ROOT / package, other / package)
    with (other / "trackers" / "scan.py").open("a") as file:
        file.write("MORE = 1\n")
    none.mkdir()
    (none / "testbed.py").touch()
    for k, (code, sentence) in enumerate(
        ((other, "has the code of the testbed .*, here is"), (none, "cannot run this package .*; install it there"))
    ):
        folder = tmp_path / f"cluster{k}"
        folder.mkdir()
        with (
            real_cluster(folder, code=(ROOT, code)) as (address, _),
            pytest.raises(OSError, match=f"dask: the worker tcp://.* {sentence}"),
        ):
            check(Engine(dask=address))

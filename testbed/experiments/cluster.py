"""Tasks on the workers of a Dask cluster, which need no folder in common with this machine or with each other.

A task goes to a worker with the files that it reads; its outcome comes back with the files that it made, and only this
process writes into the folder. A folder that all machines share is not used: a worker cannot tell it from another
folder of the same name.
"""

import logging
import platform
import re
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any, NamedTuple

from testbed.experiments.identity import CATALOGUES, code_digest, own_module, own_modules, project_digest
from testbed.experiments.run import DONE, FAILED, Outcome
from testbed.files import versions, write_atomic

CONNECT_TIMEOUT = 5  # [s] for a cluster to answer
NO_WORKERS = 60.0  # [s] without any worker before the work is given up; a killed one is replaced within seconds
CHECK_WORKERS = 5.0  # [s] without a finished task before it is asked whether there are workers

NOT_FOUND = "not found"
ENTRY = re.compile(r"[\w.-]+(:[\w.]+(?=$|[:+]))?")  # NAME or MODULE:OBJECT, without what is behind it

_one_at_a_time = threading.Lock()  # highway-env keeps state in its classes, which threads of a worker share

Files = dict[str, bytes]  # path relative to the folder of a task -> content


class Folder(NamedTuple):
    """What a task needs of its folder."""

    name: str  # its path on this machine
    folders: tuple[str, ...]  # in it
    files: Files


@contextmanager
def connected(address: str, modules: tuple[str, ...] = (), timeout: float = CONNECT_TIMEOUT) -> Iterator[Any]:
    """A client of the cluster, whose workers are known to run the code at hand, and that of modules of the user.

    timeout [s]: for the scheduler to answer.

    Raises:
        ValueError: dask is not installed here.
        OSError: no scheduler answers; it has no workers; one of them has several threads, other code or versions.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ValueError("dask is not installed; install the extra with `pip install -e '.[dask]'`") from None
    with _silent():
        try:
            client = Client(address, timeout=timeout, set_as_default=False)
        except (OSError, ValueError, MemoryError) as error:  # the last where something else answers
            raise OSError(f"dask: no scheduler answers at {address!r} ({error}); is the cluster running?") from None
        with client:
            _check_workers(client, address, modules)
            yield client


@contextmanager
def _silent() -> Iterator[None]:
    """No tracebacks from dask's client while it lasts: what they are about is said in a sentence here."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


def _check_workers(client: Any, address: str, modules: tuple[str, ...]) -> None:
    threads = client.nthreads()
    if not threads:
        raise OSError(f"dask: the cluster at {address!r} has no workers; start `dask worker {address} --nthreads 1`")
    if max(threads.values()) > 1:
        raise OSError(
            f"dask: workers must have one thread, got {max(threads.values())}; start them with `--nthreads 1`"
        )
    for worker, found in client.run(environment, modules, on_error="return").items():
        if isinstance(found, Exception):
            raise OSError(f"dask: the worker {worker} cannot run this package ({found}); install it there")
        if found != environment(modules):
            raise OSError(f"dask: the worker {worker} has {difference(environment(modules), found)}")


@cache
def environment(modules: tuple[str, ...] = ()) -> dict[str, str]:
    """What must be the same on all machines, so that runs do not depend on where they were made: name -> version.

    Of `modules` of the user, a digest; "not found" where one cannot be imported.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    own = {f"the module {m}": code_digest(own_modules(m).values()) if own_modules(m) else NOT_FOUND for m in modules}
    return {"Python": python, **versions(), "the code of the testbed": project_digest(), **own}


def modules_in(tasks: Sequence[tuple[Any, ...]]) -> tuple[str, ...]:
    """The modules of users that do the tasks, and those that names in them, or in what is in them, stand for."""
    texts = {text for task in tasks for part in task for text in _texts(part)}
    found = {own_module(match[0], what) for text in texts if (match := ENTRY.match(text)) for what in CATALOGUES}
    found |= {getattr(part, "function", type(part)).__module__ for task in tasks for part in task}
    return tuple(sorted(m for m in found if m is not None and own_modules(m)))


def _texts(part: Any) -> Iterator[str]:
    if isinstance(part, str):
        yield part
    elif isinstance(part, tuple) or hasattr(part, "__dict__"):
        for value in part if isinstance(part, tuple) else vars(part).values():
            yield from _texts(value)


def difference(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """The first thing that differs between two environments, and what to do about it."""
    name = next(name for name in here if there.get(name) != here[name])
    if there.get(name) == NOT_FOUND:
        return f"not found {name}; install its package there, or start the worker in its folder"
    return f"{name} {there.get(name)}, here is {here[name]}; install the same versions there, and start it again"


def perform(
    function: Callable[..., Outcome],
    tasks: Sequence[tuple[Any, ...]],
    address: str,
    reads: Callable[..., Sequence[Path]],
) -> Generator[Outcome]:
    """Outcomes in the order in which they are finished, as `engine.perform` has it.

    As many tasks are under way as there are workers, so whoever else uses the cluster gets a turn, and a task that
    kills its workers takes no other with it. The cluster gives the task of a killed worker to another one, four times.

    Raises:
        OSError: the connection to the scheduler was lost, or there are no workers any more.
    """
    if not tasks:
        return
    modules = modules_in(tasks)
    wanted = environment(modules)
    with connected(address, modules) as client:
        waiting, running = deque(tasks), dict[Any, tuple[Any, ...]]()
        finished: SimpleQueue[Any] = SimpleQueue()
        try:
            while waiting or running:
                while waiting and len(running) < max(1, len(client.nthreads())):
                    task = waiting.popleft()
                    future = client.submit(carried, function, *_parcel(task, reads), wanted, modules, pure=False)
                    running[future] = task
                    future.add_done_callback(finished.put)
                future = _next(finished, client, address)
                yield _received(future, running.pop(future), address)
        finally:
            client.cancel(list(running))


def _next(finished: SimpleQueue[Any], client: Any, address: str) -> Any:
    """The next future that is finished."""
    none_since = None
    while True:
        try:
            return finished.get(timeout=CHECK_WORKERS)
        except Empty:
            if client.nthreads():
                none_since = None
                continue
            none_since = none_since or monotonic()
            if monotonic() - none_since > NO_WORKERS:
                raise OSError(
                    f"dask: the cluster at {address!r} has lost all its workers; start some, "
                    "and the same command makes the rest"
                ) from None


def _parcel(task: tuple[Any, ...], reads: Callable[..., Sequence[Path]]) -> tuple[tuple[Any, ...], Folder]:
    """A task without its folder, and what of that it needs."""
    *what, out = task
    files = {path.relative_to(out).as_posix(): path.read_bytes() for path in reads(*task) if path.is_file()}
    return tuple(what), Folder(str(out), tuple(path.name for path in out.iterdir() if path.is_dir()), files)


def carried(
    function: Callable[..., Outcome],
    what: tuple[Any, ...],
    folder: Folder,
    wanted: dict[str, str],
    modules: tuple[str, ...] = (),
) -> tuple[Outcome, Files]:
    """On a worker: the outcome of a task in a copy of its folder, and the files that it made or changed there."""
    if (here := environment(modules)) != wanted:  # it joined after the others were checked
        return Outcome(what[0].name, FAILED, f"its worker has {difference(wanted, here)}"), {}
    with _one_at_a_time, TemporaryDirectory(prefix="testbed-") as name:
        copy = Path(name)
        for inner in folder.folders:
            (copy / inner).mkdir()
        for path, content in folder.files.items():
            (copy / path).write_bytes(content)
        outcome = function(*what, copy)
        found = {p.relative_to(copy).as_posix(): p.read_bytes() for p in sorted(copy.rglob("*")) if p.is_file()}
    if outcome.status == DONE:  # a note about a file of the folder; that of a failure may be about this machine
        outcome = outcome._replace(note=outcome.note.replace(name, folder.name))
    return outcome, {path: content for path, content in found.items() if folder.files.get(path) != content}


def _received(future: Any, task: tuple[Any, ...], address: str) -> Outcome:
    """The outcome of a task, with its files in its folder."""
    *what, out = task
    if future.cancelled():
        raise OSError(f"dask: the connection to {address!r} was lost; the same command makes the rest")
    error = future.exception()
    if error is not None:
        return Outcome(what[0].name, FAILED, f"{type(error).__name__}: {error}")
    outcome, files = future.result()
    try:
        for path, content in files.items():
            write_atomic(Path(out) / path, content)
    except OSError as failure:
        return Outcome(outcome.name, FAILED, str(failure))
    return outcome

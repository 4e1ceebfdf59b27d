"""Calls of the command line, each in a forked process of its own with bounds of time and memory.

The processes are forked from one that has imported everything, so a call takes milliseconds, and one that hangs, that
takes all memory or that kills its process harms nobody.
"""

import multiprocessing
import os
import resource
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from testbed import cli

ENOUGH = 0.7  # [s] after which a call that goes on has accepted its input
START = 300.0  # [s] for the imports, on a busy machine
DEADLINE = 20.0  # [s] after which a call that cannot be ended hangs
ROOM = 3 << 30  # [bytes] of address space that a call may take
LONGEST = 700  # characters of a sentence
STATUSES = (0, 1, 2, 130, 143)
AT_WORK = 250  # status of a call that was ended because it has begun its work


class Call(NamedTuple):
    """A command line, called in a folder with the files that the project has made."""

    args: tuple[str, ...]
    files: tuple[tuple[str, bytes], ...] = ()  # that take the place of those that were made
    encoding: str = "utf-8"  # of stdout and stderr
    stdout: str = "stdout"
    seconds: float = ENOUGH  # after which it is at work

    def __str__(self) -> str:
        return f"testbed {' '.join(repr(a) if len(a) < 60 else repr(a[:50]) + '...' for a in self.args)}"


class Outcome(NamedTuple):
    """How a call ended."""

    call: Call
    status: int | None  # None: it had to be killed
    err: str
    seconds: float

    @property
    def fault(self) -> str | None:
        """What is wrong with it."""
        lines = [line for line in self.err.replace("\r", "\n").splitlines() if line.strip()]
        last = lines[-1] if lines else ""
        if self.status is None:
            return f"does not end within {DEADLINE:g} s"
        if "Traceback" in self.err:
            return f"traceback, {last[:200]}"
        if self.status not in (*STATUSES, AT_WORK):
            return f"exit status {self.status}, {last[:200]!r}"
        if "Warning" in self.err or "Exception ignored" in self.err:
            return f"a warning, {' '.join(lines)[:200]!r}"
        if self.status == 2 and not (last.startswith("testbed: ") and len(last) <= LONGEST):
            return f"no sentence, {last[:200]!r}"
        if self.status == 2 and sum("testbed: " in line for line in lines) > 1:
            return f"more than one sentence, {' '.join(lines)[:200]!r}"
        return None


class Reply(NamedTuple):
    """What the process that makes calls says after each."""

    status: int | None
    goes_on: bool
    err: str


def outcomes(calls: Sequence[Call], template: Path, scratch: Path) -> list[Outcome]:
    """How the calls end, each in a new copy of the folder `template`."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["__main__", "tests.fuzz.preloaded"])
    found: list[Outcome] = []
    while len(found) < len(calls):
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=work, args=(calls[len(found) :], template, scratch, sender))
        process.start()
        sender.close()
        goes_on = receiver.poll(START)
        assert goes_on, "the process that makes calls does not start"
        receiver.recv()
        while goes_on and len(found) < len(calls):
            start = time.monotonic()
            try:
                reply = (
                    receiver.recv() if receiver.poll(calls[len(found)].seconds + DEADLINE) else Reply(None, False, "")
                )
            except EOFError:  # it was killed
                process.join()
                reply = Reply(process.exitcode, False, (scratch / "stderr").read_text(errors="replace"))
            goes_on = reply.goes_on
            found.append(Outcome(calls[len(found)], reply.status, reply.err, time.monotonic() - start))
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)  # with what it has started
        process.join()
    return found


def work(calls: Sequence[Call], template: Path, scratch: Path, sender: Connection) -> None:
    """Make calls in this process until one has begun its work; send the status of each, and whether it goes on."""
    os.setsid()
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + ROOM, size + ROOM))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    def end(number: int, frame: object) -> None:
        """End the process of a call that goes on; an exception could be raised where it does harm."""
        sender.send(Reply(AT_WORK, False, (scratch / "stderr").read_text(errors="replace")))
        os._exit(0)

    signal.signal(signal.SIGALRM, end)
    sender.send(None)
    for call in calls:
        os.chdir("/")
        shutil.rmtree(scratch, ignore_errors=True)
        shutil.copytree(template, scratch / "cwd", symlinks=True, copy_function=shutil.copyfile)
        for name, content in call.files:
            path = scratch / "cwd" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            path.write_bytes(content)
        os.mkfifo(scratch / "cwd" / "fifo.json")
        os.chdir(scratch / "cwd")
        _redirect(call, scratch)
        status = _status(call)
        reply = Reply(status, status == 2, (scratch / "stderr").read_text(errors="replace"))
        sender.send(reply)
        if not reply.goes_on:
            break
    os._exit(0)


def _redirect(call: Call, folder: Path) -> None:
    """Give the standard streams of this process to files of a folder."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    for number, path in enumerate(("/dev/null", folder / call.stdout, folder / "stderr")):
        os.dup2(os.open(path, flags if number else os.O_RDONLY, 0o644), number)
    options = {"encoding": call.encoding, "closefd": False}
    sys.stdout = open(1, "w", **options)  # noqa: SIM115
    sys.stderr = open(2, "w", errors="backslashreplace", buffering=1, **options)  # noqa: SIM115


class Ending:
    """Around a call: stores its exit status; a traceback goes where Python puts it."""

    status = 0

    def __enter__(self) -> "Ending":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, SystemExit):
            self.status = error.code if isinstance(error.code, int) else int(error.code is not None)
        elif error is not None:
            self.status = 1
            traceback.print_exception(error)
        return True


def _status(call: Call) -> int:
    """Exit status of a call."""
    sys.argv = ["testbed", *call.args]
    with Ending() as ending:
        signal.setitimer(signal.ITIMER_REAL, call.seconds)
        try:
            cli.main()
        finally:
            sys.stdout.flush()
    signal.setitimer(signal.ITIMER_REAL, 0)
    sys.stderr.flush()
    return ending.status

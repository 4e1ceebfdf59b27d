"""Whether logs can be read to their end.

rerun ends the whole process at some damaged blocks, and may take any amount of memory for others. So a log that comes
from elsewhere is first read in a process of its own, with a limit of memory and of time: this file is its program.
"""

import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

MEMORY = 4_000_000_000  # [bytes] of address space, and so many times the size of the log beside:
TIMES = 8
REFUSED = 3  # exit status of the program where rerun says what is wrong
SECONDS, SPEED = 60.0, 1e6  # [s] that reading may take, and [bytes/s] of a slow disk


def damage(logs: Sequence[Path]) -> tuple[Path, str] | None:
    """The first of the logs that cannot be read to its end, and why, or None."""
    size = sum(log.stat().st_size for log in logs)
    command = [sys.executable, "-P", "-W", "ignore", __file__, *map(str, logs)]
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=SECONDS + size / SPEED)
    except subprocess.TimeoutExpired as late:
        read, reason = late.stdout or b"", f"it takes more than {late.timeout:.0f} s"
    else:
        if done.returncode == 0:
            return None
        read, reason = done.stdout, "a block cannot be decoded"
        if done.returncode == REFUSED:
            reason = " ".join(done.stderr.decode(errors="replace").split())
    return logs[read.count(b"\n")], reason


def read_through(log: Path) -> None:
    """Read the footer, if there is one, and every block; raises RuntimeError or ValueError where that is impossible."""
    from rerun.chunk import RrdReader

    reader = RrdReader(log)
    try:
        reader.store()
    except RuntimeError as error:  # a run that was killed leaves no footer
        if "footer" not in str(error):
            raise
    for _ in reader.stream().to_chunks():
        pass


def limit_memory(size: int) -> None:
    """Limit the address space of this process, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    for name in sys.argv[1:]:
        limit_memory(MEMORY + TIMES * Path(name).stat().st_size)
        try:
            read_through(Path(name))
        except (RuntimeError, ValueError) as error:  # ValueError: there is no recording in it
            print(str(error).removeprefix(f"Failed to read RRD file at {name}: "), file=sys.stderr)
            sys.exit(REFUSED)
        print(flush=True)

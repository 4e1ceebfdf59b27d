"""Open review logs in the viewer, or make a picture of one without a display."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from testbed.files import check_target
from testbed.log.reader import complete, span
from testbed.log.screenshot import existing, render, viewer_command


def check(logs: Sequence[str | Path], png: str | Path | None = None, at: float | None = None) -> None:
    """Raise ValueError or OSError, in one sentence, for what cannot be shown."""
    if not logs:
        raise ValueError("review needs at least one log; `testbed run` with --log full writes one")
    for log in logs:
        readable(log)
    if png is None:
        if at is not None:
            raise ValueError(f"a time, --at {at:g}, goes with --screenshot only; the viewer has a time line")
        return
    if len(logs) > 1:
        raise ValueError(f"a screenshot shows one log, got {len(logs)}; call once for each")
    if Path(png).suffix.lower() != ".png":
        raise ValueError(f"a screenshot is a .png file, got {png}")
    check_target(Path(png))
    first, last = span(logs[0])
    if at is not None and not first <= at <= last:
        raise ValueError(f"--at must lie within the run, {first:g} to {last:g} s, got {at:g} s")


def readable(log: str | Path) -> None:
    """Raise FileNotFoundError or ValueError, in one sentence, for a file that is missing or no log."""
    try:
        complete(existing(log))
    except RuntimeError as error:
        raise ValueError(f"{log} is not a review log; give the .rrd file of a run ({error})") from None


def review(logs: Sequence[str | Path], web: bool = False) -> int:
    """Show logs with their layout in place until the viewer is closed; returns its exit status."""
    check(logs)
    for log in logs:
        if not complete(log):
            print(f"{log}: {unfinished_hint(log)}", file=sys.stderr)
    if not web and not has_display():
        raise OSError("there is no display; use --web for a browser or --screenshot PNG for a picture")
    with subprocess.Popen(viewer_command(logs, web)) as viewer:
        try:
            return viewer.wait()
        except KeyboardInterrupt:
            viewer.terminate()
            return 0


def screenshot(log: str | Path, png: str | Path, at: float | None = None) -> list[str]:
    """Render a log at `at` [s], by default in the middle of the run; returns the viewer's error reports."""
    check([log], png, at)
    return render(log, png, middle(log) if at is None else at)


def unfinished_hint(log: str | Path) -> str:
    """What to do with a log of a run that was killed."""
    path = Path(log)
    repaired = path.with_name(f"{path.stem}-repaired.rrd")
    return f"the run was interrupted, the log ends there; `rerun rrd optimize {path} -o {repaired}` closes the file"


def middle(log: str | Path) -> float:
    """Time [s] in the middle of a run."""
    first, last = span(existing(log))
    return (first + last) / 2


def has_display() -> bool:
    """Whether a window can be opened: everywhere but on Linux without a display server."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))

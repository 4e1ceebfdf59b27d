"""Open review logs in the viewer, or make a picture of one without a display."""

import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from testbed.files import check_target
from testbed.log.focus import write_focused
from testbed.log.intact import damage
from testbed.log.reader import complete, span
from testbed.log.screenshot import existing, render, viewer_command


def check(
    logs: Sequence[str | Path],
    png: str | Path | None = None,
    at: float | None = None,
    view: str | None = None,
    focus: int | None = None,
) -> None:
    """Raise ValueError or OSError, in one sentence, for what cannot be shown."""
    if not logs:
        raise ValueError("review needs at least one log; `testbed run` with --log full writes one")
    readable(*logs)
    if focus is not None:
        only(logs, "--focus")
    if png is None:
        if at is not None:
            raise ValueError(f"a time, --at {at:g}, goes with --screenshot only; the viewer has a time line")
        if view is not None:
            raise ValueError(f"--view {view!r} goes with --screenshot only; the viewer shows all views")
        return
    only(logs, "a screenshot")
    if Path(png).suffix.lower() != ".png":
        raise ValueError(f"a screenshot is a .png file, got {png}")
    check_target(Path(png))
    first, last = span(logs[0])
    if at is not None and not first <= at <= last:
        raise ValueError(f"--at must lie within the run, {first:g} to {last:g} s, got {at:g} s")


def only(logs: Sequence[str | Path], what: str) -> str | Path:
    """The one log that `what` shows; ValueError for several."""
    if len(logs) != 1:
        raise ValueError(f"{what} shows one log, got {len(logs)}; call once for each")
    return logs[0]


def readable(*logs: str | Path) -> None:
    """Raise FileNotFoundError or ValueError, in one sentence, for files that are missing, no logs or damaged."""
    if found := damage([existing(log) for log in logs]):
        log, reason = found
        raise ValueError(
            f"{log} is not a review log, or is damaged ({reason}); give the .rrd file of a run, or save what can be "
            f"read of it: {_rescue(log)}"
        )


def review(
    logs: Sequence[str | Path],
    web: bool = False,
    png: str | Path | None = None,
    at: float | None = None,
    view: str | None = None,
    focus: int | None = None,
) -> int:
    """Show logs with their layout in place until the viewer is closed; returns its exit status.

    With `png`, a picture of one log is rendered instead, at `at` [s], by default in the middle of the run, of all of it
    or of the view of a name. `focus` is the vehicle of one log whose page comes first. Raises OSError or ValueError as
    `check` does, or where there is no such vehicle.
    """
    check(logs, png, at, view, focus)
    with TemporaryDirectory() as folder:
        shown = logs if focus is None else [write_focused(logs[0], focus, Path(folder) / Path(logs[0]).name)]
        if png is not None:
            render(shown[0], png, middle(logs[0]) if at is None else at, view=view)
            return 0
        for log in logs:
            if not complete(log):
                print(f"{log}: {unfinished_hint(log)}", file=sys.stderr)
        return _show(shown, web)


def _show(logs: Sequence[str | Path], web: bool) -> int:
    """Open the viewer, and wait until it is closed."""
    if not web and not has_display():
        raise OSError("there is no display; use --web for a browser or --screenshot PNG for a picture")
    with subprocess.Popen(viewer_command(logs, web)) as viewer:
        try:
            return viewer.wait()
        except KeyboardInterrupt:
            viewer.terminate()
            return 0


def unfinished_hint(log: str | Path) -> str:
    """What to do with a log of a run that was killed."""
    return f"the run was interrupted, the log ends there; {_rescue(Path(log))} closes the file"


def _rescue(log: Path) -> str:
    repaired = log.with_name(f"{log.stem}-repaired.rrd")
    return f"`{shlex.join(['rerun', 'rrd', 'optimize', str(log), '-o', str(repaired)])}`"


def middle(log: str | Path) -> float:
    """Time [s] in the middle of a run."""
    first, last = span(existing(log))
    return (first + last) / 2


def has_display() -> bool:
    """Whether a window can be opened: everywhere but on Linux without a display server."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))

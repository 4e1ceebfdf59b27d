"""Open review logs in the viewer, with a vehicle in focus if wanted, or make a picture of one without a display."""

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from testbed.files import check_target
from testbed.log import paths
from testbed.log.intact import damage
from testbed.log.modes import modes_of
from testbed.log.reader import Columns, complete, properties, span
from testbed.log.record import RoadGeometry, RunMeta
from testbed.log.screenshot import existing, render, viewer_command
from testbed.log.writer import in_focus


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
    if len(logs) > 2:
        raise ValueError(f"a screenshot shows one log, or two side by side, got {len(logs)}; leave some out")
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
    """Show logs with their layout in place until the viewer is closed; returns its exit status. Two go into one.

    With `png`, a picture of one log is rendered instead, at `at` [s], by default in the middle of the run, of all of it
    or of the view of a name. `focus` is the vehicle of one log whose page comes first. Raises OSError or ValueError as
    `check` does, or where there is no such vehicle.
    """
    check(logs, png, at, view, focus)
    with TemporaryDirectory() as folder:
        shown = logs if focus is None else [write_focused(logs[0], focus, Path(folder) / Path(logs[0]).name)]
        if len(logs) == 2:
            from testbed.log.both import write as write_both

            shown = [write_both(logs, Path(folder) / "both.rrd")]
        if png is not None:
            render(shown[0], png, middle(logs[0]) if at is None else at, view=view)
            return 0
        for log in logs:
            if not complete(log):
                print(f"{log}: {unfinished_hint(log)}", file=sys.stderr)
        return _show(shown, web)


def _show(logs: Sequence[str | Path], web: bool) -> int:
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


def write_focused(log: str | Path, focus: int, path: Path) -> Path:
    """Write a copy of a log whose pages of single objects begin with a vehicle, and return where.

    Raises:
        OSError: the log cannot be opened.
        ValueError: the log is damaged, of several drives, or has no such vehicle.
    """
    import rerun as rr
    from rerun.chunk import RrdReader

    layout = focused(log, focus)
    source = RrdReader(log)
    copy = rr.RecordingStream(paths.APPLICATION, recording_id=source.recordings()[0].recording_id)
    copy.save(path, default_blueprint=layout)
    copy.send_chunks(source.stream())
    copy.disconnect()
    return path


def focused(log: str | Path, focus: int) -> Any:
    """The layout of a log with a vehicle in focus; raises as `write_focused`."""
    from testbed.log.blueprint import layout

    columns, groups = Columns(log), properties(log)
    trackers = tuple(str(groups.get("run", {}).get("trackers", "")).split())
    if not trackers:
        raise ValueError(f"--focus: the log {log} is of several drives, or of none with a tracker; leave --focus out")
    there = columns.vehicles()
    if focus not in there:
        known = ", ".join(map(str, there)) or "none"
        raise ValueError(f"--focus: the log {log} has no vehicle {focus}; it has {known}")
    meta = RunMeta("", "", 0, "", trackers, "", {}, {})
    pages = in_focus(focus, json.loads(str(groups.get("tables", {}).get("moments", "[]"))))
    full = bool(columns.entities(paths.TRUTH_CONTOUR))
    return layout(meta, _metrics(columns, trackers), pages, _road(columns), full, modes_of(trackers), True)


def _metrics(columns: Columns, trackers: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    there = [entity.split("/")[1:] for entity in columns.entities("metrics/")]
    return {name: tuple(metric for metric, leaf in there if leaf == paths.plain(name)) for name in trackers}


def _road(columns: Columns) -> RoadGeometry:
    """What the layout asks of a road, its lines; dashes stand for the lines between lanes."""
    component = "LineStrips2D:strips"
    edges, dashes, surface = (
        tuple(np.array(line) for line in columns.static(entity, component))
        for entity in (paths.ROAD_EDGES, paths.ROAD_LANES, paths.ROAD_SURFACE)
    )
    return RoadGeometry(edges, dashes, surface)

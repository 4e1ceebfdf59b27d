"""A copy of a log with another vehicle in focus: the same content, and the layout that a run writes, made anew."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from testbed.log import paths
from testbed.log.modes import modes_of
from testbed.log.reader import Columns, properties
from testbed.log.record import RoadGeometry, RunMeta
from testbed.log.writer import in_focus


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
    """Tracker -> names of the metrics that it has."""
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

"""Detections of vehicles with the boxes they came from, read back from a review log of level full."""

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from testbed.log import paths
from testbed.log.layers import NOSE
from testbed.log.reader import properties, rows
from trackers.geometry import to_frame

HUGE = 1e7  # [m] that no place of a run reaches
TRUE = ("contour", "volume")  # kinds of detections that come from a vehicle

Box = tuple[NDArray, NDArray]  # pose (3,), size (2,)


class LoggedDetections(NamedTuple):
    """N detections of vehicles and the boxes of those vehicles."""

    radar: str  # name of the rig
    step: NDArray  # (N,) int
    xy: NDArray  # (N, 2) [m] world
    sensor: NDArray  # (N,) int, of the rig
    platform: NDArray  # (N, 3) pose of the ego
    object: NDArray  # (N,) int
    kind: NDArray  # (N,) text, class of the object
    pose: NDArray  # (N, 3) of the object
    size: NDArray  # (N, 2) [m] of the object


def read_detections(path: str | Path) -> LoggedDetections:
    """Every true detection of a log; raises ValueError, in one sentence, for one that is damaged or has no geometry."""
    try:
        found = _read(path)
    except (pa.ArrowException, LookupError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"data: the log {path} is damaged, or not that of a run ({error})") from None
    if found is None:
        raise ValueError(f"data: the log {path} has no detections of vehicles; record it with --log full")
    for name in ("xy", "platform", "pose", "size"):
        if not (np.abs(getattr(found, name)) < HUGE).all():
            raise ValueError(f"data: the log {path} is damaged: {name} has numbers that are not finite or are absurd")
    if (found.size <= 0).any():
        raise ValueError(f"data: the log {path} is damaged: a vehicle has the size {found.size.min():g} m")
    return found


def _read(path: str | Path) -> LoggedDetections | None:
    kinds, boxes, ego = _kinds(path), _boxes(path), _platforms(path)
    parts = []
    for kind in TRUE:
        for row in rows(path, paths.detections(kind)):
            step, xy, sensor = row.get(paths.STEP), row.get("Points2D:positions"), row.get("radar:sensor")
            if step is None or not xy:
                continue
            ids = row["radar:object_id"]
            own = [boxes[step][i] for i in ids]
            columns = (
                np.full(len(ids), step),
                np.array(xy, float),
                np.array(sensor),
                np.tile(ego[step], (len(ids), 1)),
            )
            truth = (np.array(ids), np.array([kinds[i] for i in ids]), *(np.array(c) for c in zip(*own, strict=True)))
            parts.append((*columns, *truth))
    if not parts:
        return None
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return LoggedDetections(str(properties(path)["run"]["radar"]), *joined)


def _kinds(path: str | Path) -> dict[int, str]:
    """Class of each object, from the names that the viewer shows."""
    kinds = {}
    for row in rows(path, paths.TRUTH_CONTOUR):
        for entry in _flat(row.get("AnnotationContext:context")):
            info = entry["class_description"]["info"]
            kinds[info["id"] - 1] = info["label"].rpartition(" ")[2]
    return kinds


def _boxes(path: str | Path) -> dict[int, dict[int, Box]]:
    """Step -> object -> box: centre and length from the arrow of the heading, width from the outlines."""
    outlines: dict[int, dict[int, list]] = {}
    for row in rows(path, paths.TRUTH_CONTOUR):
        if row.get(paths.STEP) is not None and row.get("truth:object_id"):
            points: dict[int, list] = defaultdict(list)
            for i, strip in zip(row["truth:object_id"], row["LineStrips2D:strips"], strict=True):
                points[i] += strip
            outlines[row[paths.STEP]] = points
    found: dict[int, dict[int, Box]] = defaultdict(dict)
    for row in rows(path, paths.TRUTH_HEADING):
        step = row.get(paths.STEP)
        if step not in outlines:
            continue
        arrows = zip(outlines[step].items(), row["Arrows2D:origins"], row["Arrows2D:vectors"], strict=True)
        for (i, outline), origin, vector in arrows:
            pose = np.array([*origin, np.arctan2(vector[1], vector[0])])
            across = to_frame(pose, np.array(outline))[:, 1]
            size = np.array([2 * (np.hypot(*vector) - NOSE), 2 * np.abs(across).max()])
            found[step][i] = (pose, size)
    return found


def _platforms(path: str | Path) -> dict[int, NDArray]:
    """Step -> pose (3,) of the ego."""
    found = {}
    for row in rows(path, paths.EGO):
        if row.get(paths.STEP) is not None and row.get("Transform3D:translation"):
            x, y, _ = row["Transform3D:translation"][0]
            *_, sine, cosine = row["Transform3D:quaternion"][0]
            found[row[paths.STEP]] = np.array([x, y, 2 * np.arctan2(sine, cosine)])
    return found


def _flat(values: list | None) -> list:
    """Entries of a list of lists of any depth."""
    if values is None:
        return []
    return [e for v in values for e in (_flat(v) if isinstance(v, list) else [v])]

"""Detections of vehicles with the boxes they came from, read back from a review log of level full."""

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from testbed.log import paths
from testbed.log.layers import NOSE
from testbed.log.reader import Columns, properties
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
    columns = Columns(path)
    kinds = {i: name.rpartition(" ")[2] for i, name in columns.names().items()}
    boxes, ego = _boxes(columns), _platforms(columns)
    parts = []
    for kind in TRUE:
        entity = paths.detections(kind)
        sensors, owners = columns.numbers(entity, "radar:sensor"), columns.numbers(entity, "radar:object_id")
        for step, xy in columns.points(entity, "Points2D:positions").items():
            if not len(xy):
                continue
            ids = owners[step].tolist()
            platform = np.tile(ego[step], (len(ids), 1))
            pose, size = (np.array(column) for column in zip(*(boxes[step][i] for i in ids), strict=True))
            names = np.array([kinds[i] for i in ids])
            parts.append((np.full(len(ids), step), xy, sensors[step], platform, np.array(ids), names, pose, size))
    if not parts:
        return None
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return LoggedDetections(str(properties(path)["run"]["radar"]), *joined)


def _boxes(columns: Columns) -> dict[int, dict[int, Box]]:
    """Step -> object -> box: centre and length from the arrow of the heading, width from the outlines."""
    owners, outlines = columns.numbers(paths.TRUTH_CONTOUR, "truth:object_id"), columns.strips(paths.TRUTH_CONTOUR)
    arrows = columns.points(paths.TRUTH_HEADING, "Arrows2D:vectors")
    found: dict[int, dict[int, Box]] = defaultdict(dict)
    for step, origins in columns.points(paths.TRUTH_HEADING, "Arrows2D:origins").items():
        parts: dict[int, list[NDArray]] = defaultdict(list)
        for i, outline in zip(owners[step].tolist(), outlines[step], strict=True):
            parts[i].append(outline)
        for (i, outline_parts), origin, arrow in zip(parts.items(), origins, arrows[step], strict=True):
            pose = np.array([*origin, np.arctan2(arrow[1], arrow[0])])
            across = to_frame(pose, np.concatenate(outline_parts))[:, 1]
            found[step][i] = pose, np.array([2 * (np.hypot(*arrow) - NOSE), 2 * np.abs(across).max()])
    return found


def _platforms(columns: Columns) -> dict[int, NDArray]:
    """Step -> pose (3,) of the ego."""
    turn = columns.points(paths.EGO, "Transform3D:quaternion")
    return {
        step: np.array([*place[0, :2], 2 * np.arctan2(*turn[step][0, 2:])])
        for step, place in columns.points(paths.EGO, "Transform3D:translation").items()
    }

"""The lanes of a recording: the map that trackers get, and the lines that the log draws."""

import numpy as np
from numpy.typing import NDArray

from testbed.log.record import RoadGeometry
from testbed.replay.loaded import Loaded
from trackers.geometry import perpendicular
from trackers.multi.road import RoadMap

SHARED = 0.5  # [m] between the border of a lane and that of its neighbour, up to which they are one line


def lanes_of(table: Loaded | None) -> tuple[RoadMap, RoadGeometry]:
    """Map and lines of the lanes, empty without a table; ValueError, in one sentence, where a lane is no line."""
    if table is None or not table.rows:
        return RoadMap.of([]), RoadGeometry()
    names = table["lane"]
    starts = np.flatnonzero(np.append(True, names[1:] != names[:-1]))
    xy = np.stack([table["x"], table["y"]], -1)
    centres = np.split(xy, starts[1:])
    width = table["width"][starts]
    for start, centre in zip(starts.tolist(), centres, strict=True):
        if (centre == centre[0]).all() or names[start] in names[:start]:
            raise table.fault("lane", start, f"lane {str(names[start])!r} is not one line of two places or more",
                              "put its points below each other, in the direction of travel")  # fmt: skip
    road = RoadMap.of([(centre, float(w)) for centre, w in zip(centres, width, strict=True)])
    return road, _drawn(centres, width)


def _drawn(centres: list[NDArray], width: NDArray) -> RoadGeometry:
    """Surfaces and lines; a border that two lanes share is dashed, and drawn once."""
    borders = [side for c, w in zip(centres, width.tolist(), strict=True) for side in _borders(c, w / 2)]
    inner, edges = [], []
    for k, line in enumerate(borders):
        near = [j for j, other in enumerate(borders) if j // 2 != k // 2 and _beside(line, other)]
        if not near:
            edges.append(line)
        elif min(near) > k:
            inner.append(line)
    return RoadGeometry(tuple(edges), tuple(inner), tuple(centres), tuple((width / 2).tolist()))


def _borders(centre: NDArray, half: float) -> tuple[NDArray, NDArray]:
    step = np.gradient(centre, axis=0)
    across = perpendicular(step / np.maximum(np.hypot(*step.T), 1e-9)[:, None])
    return centre - half * across, centre + half * across


def _beside(line: NDArray, other: NDArray) -> bool:
    """Whether the middle of a line lies on the other."""
    middle = (line[(len(line) - 1) // 2] + line[len(line) // 2]) / 2
    a, step = other[:-1], np.diff(other, axis=0)
    t = np.clip(((middle - a) * step).sum(-1) / np.maximum((step**2).sum(-1), 1e-12), 0, 1)
    return bool(np.hypot(*(a + t[:, None] * step - middle).T).min() <= SHARED)

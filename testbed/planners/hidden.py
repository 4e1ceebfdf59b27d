"""What of a path was never seen: hidden behind others from now and from all but a few of the places before.

A view is where was looked from and the boxes of the tracks then; nothing of the truth. Equations:
docs/methods/planners.md.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from testbed.planners.prediction import SPACING, LanePath
from trackers.geometry import perpendicular, rotation, unit

LONG, WIDE = 4.5, 1.9  # [m] of the car that is looked for: it is hidden where all of its width is
TIMES = 3  # views in which a place must have been in sight: who stands there has a track by then
LOOKS = WIDE * np.array([-0.5, 0.0, 0.5])  # [m] across a path, of the points that are looked at


class View(NamedTuple):
    """What could be seen at one instant."""

    eye: NDArray  # (2,) [m] front of the ego
    pose: NDArray  # (N, 3) x, y [m], heading [rad] of the boxes of the tracks
    size: NDArray  # (N, 2) [m]


def view_of(ego: Vehicle, vehicles: Sequence[Vehicle]) -> View:
    """The view of an ego among the vehicles of its belief road."""
    boxes = [v for v in vehicles if v is not ego]
    pose = np.array([(*v.position, v.heading) for v in boxes], float).reshape(-1, 3)
    size = np.array([(v.LENGTH, v.WIDTH) for v in boxes], float).reshape(-1, 2)
    return View(ego.position + ego.LENGTH / 2 * unit(ego.heading), pose, size)


def in_sight(view: View, points: NDArray) -> NDArray:
    """Which points (..., 2) are in sight (...) bool: no box lies between them and the eye.

    A point in a box is in sight unless another box hides it: who is there has been seen.
    """
    back = rotation(view.pose[:, 2])  # (N, 2, 2)
    start = ((view.eye - view.pose[:, :2])[:, None] @ back)[:, 0]  # (N, 2)
    ends = (points[..., None, :] - view.pose[:, :2])[..., None, :] @ back  # (..., N, 1, 2)
    way, half = ends[..., 0, :] - start, view.size / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - start) / way, (half - start) / way  # where the ray is in each slab
    enters, leaves = np.fmin(a, b).max(-1), np.fmax(a, b).min(-1)
    return ~((enters < leaves) & (leaves > 0) & (leaves < 1)).any(-1)  # (PLAN.15)


def first_unseen(path: LanePath, views: Sequence[View], start: float, end: float) -> float:
    """Where on a path, between two places [m] along it, a car may stand that was not in sight; inf: nowhere.

    In sight it must have been in `TIMES` of the views, or in all of fewer: one alone may be from before there was a
    track of what hides it. The last view is that of now.
    """
    part = (path.arc >= start) & (path.arc <= end)
    side = perpendicular(unit(path.heading[part]))
    points = path.points[part, None] + LOOKS[:, None] * side[:, None]  # (P, 3, 2)
    missing = np.full(len(points), min(TIMES, len(views)))
    for view in reversed(views):
        rows = np.flatnonzero(missing)
        if not len(rows):
            break
        missing[rows] -= in_sight(view, points[rows]).any(-1)
    unseen = missing > 0
    need = max(int(LONG // SPACING), 1)
    run = np.convolve(unseen, np.ones(need, int), "valid") == need if len(unseen) >= need else np.zeros(0, bool)
    return float(path.arc[part][run.argmax()]) if run.any() else np.inf

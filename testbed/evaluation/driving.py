"""How the ego drove: collisions, distances, times to collision, progress and braking, measured on scenes alone.

Every rigid body counts for itself: a bent articulated truck is two boxes, not the box around both. Equations:
docs/methods/metrics.md, "The drive".
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sensors.scene import Bodies, Ego, Scene
from testbed.evaluation.metrics import areas
from trackers.geometry import box_corners, compose, point_velocity, rotation, to_frame, unit

FAR = 1e4  # [m] end of the corridor ahead, farther than any road


class BodyBoxes(NamedTuple):
    """Bounding boxes of B bodies."""

    pose: NDArray  # (B, 3) centre x, y [m], heading [rad]
    size: NDArray  # (B, 2) length, width [m]
    velocity: NDArray  # (B, 2) [m/s] of the centre


def body_boxes(bodies: Bodies) -> BodyBoxes:
    """The box around each outline, along the body's heading."""
    if not bodies.outline:
        return BodyBoxes(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 2)))
    counts = [len(outline) for outline in bodies.outline]
    first, owner = np.cumsum([0, *counts[:-1]]), np.repeat(np.arange(len(counts)), counts)
    local = to_frame(bodies.pose[owner], np.concatenate(bodies.outline)[:, None])[:, 0]
    low, high = np.minimum.reduceat(local, first), np.maximum.reduceat(local, first)
    shift = np.concatenate([(low + high) / 2, np.zeros((len(counts), 1))], -1)
    pose = compose(bodies.pose, shift)
    lever = (pose - bodies.pose)[:, :2]
    return BodyBoxes(pose, high - low, point_velocity(bodies.velocity, bodies.yaw_rate, lever))


def box_distance(ego: Ego, boxes: BodyBoxes) -> NDArray:
    """Shortest distances (B,) [m] from the ego's box to the others, 0 where they touch."""
    own, others = areas(box_corners(ego.pose, ego.size)), areas(box_corners(boxes.pose, boxes.size))
    return shapely.distance(own, others)  # (MET.20)


def headway_time(ego: Ego, boxes: BodyBoxes) -> NDArray:
    """Time to collision (B,) [s] along the ego's heading: bumper distance over closing speed, inf where it opens.

    Hayward (1972), for what reaches into the straight corridor, as wide as the ego, ahead of its front bumper.
    """
    front, half_width = ego.size / 2
    local = areas(to_frame(ego.pose, box_corners(boxes.pose, boxes.size)))
    ahead = shapely.clip_by_rect(local, front, -half_width, FAR, half_width)
    gap = np.where(shapely.area(ahead) > 0, shapely.bounds(ahead)[:, 0] - front, np.inf)
    closing = (ego.velocity - boxes.velocity) @ unit(ego.pose[2])
    return np.divide(gap, closing, out=np.full(len(gap), np.inf), where=closing > 0)  # (MET.21)


def contact_time(ego: Ego, boxes: BodyBoxes) -> NDArray:
    """Time to collision (B,) [s] in the plane: first contact of the boxes at constant velocity and heading.

    By separating axes: along each of the four box normals the projections overlap for an interval of time; boxes touch
    while all four do. 0 for boxes that touch now, inf for those that never will.
    """
    d, v = boxes.pose[:, :2] - ego.pose[:2], boxes.velocity - ego.velocity
    own = np.broadcast_to(rotation(ego.pose[2]), (len(d), 2, 2))
    other = rotation(boxes.pose[:, 2])
    axes = np.concatenate([own.mT, other.mT], -2)  # (B, 4, 2) unit normals
    reach = np.abs(axes @ (own * ego.size / 2)).sum(-1) + np.abs(axes @ (other * boxes.size[:, None] / 2)).sum(-1)
    d, v = (axes @ d[..., None])[..., 0], (axes @ v[..., None])[..., 0]  # (B, 4)
    with np.errstate(divide="ignore", invalid="ignore"):
        start, end = (-d - np.sign(v) * reach) / v, (-d + np.sign(v) * reach) / v  # (MET.22)
    still, apart = v == 0, np.abs(d) > reach
    start = np.where(still, np.where(apart, np.inf, -np.inf), start).max(-1)
    end = np.where(still, np.inf, end).min(-1)
    return np.where((start <= end) & (end >= 0), np.maximum(start, 0.0), np.inf)  # (MET.22)


class DriveFrame(NamedTuple):
    """The ego at one frame; distances and times to the worst body, inf without one."""

    distance: float  # [m] box to box
    ttc: float  # [s] `headway_time`
    ttc_plane: float  # [s] `contact_time`
    speed: float  # [m/s] along the heading
    acceleration: float  # [m/s^2] change of speed since the frame before, NaN at the first and in a crash


@dataclass
class DriveEvaluator:
    """Measures of the ego's drive: call `step` once a frame, then `summary`."""

    harsh: float = -4.0  # [m/s^2] braking below this is harsh
    released: float = -2.0  # [m/s^2] it ends above this; in between it goes on
    _frames: list[DriveFrame] = field(default_factory=list, init=False, repr=False)
    _time: list[float] = field(default_factory=list, init=False, repr=False)
    _last: Ego | None = field(default=None, init=False, repr=False)
    _progress: float = field(default=0.0, init=False, repr=False)
    _collisions: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        """Refuse thresholds without hysteresis."""
        if not self.harsh < self.released:
            raise ValueError(f"released must lie above harsh, got {self.released} and {self.harsh} m/s^2; swap them")

    def step(self, scene: Scene) -> DriveFrame:
        """Measures at one scene; scenes come in the order of time. Raises ValueError otherwise."""
        if self._time and scene.time <= self._time[-1]:
            raise ValueError(
                f"scene.time must grow, got {scene.time} s after {self._time[-1]} s; one evaluator for each run"
            )
        ego, boxes, last = scene.ego, body_boxes(scene.bodies), self._last
        speed, acceleration = float(ego.velocity @ unit(ego.pose[2])), np.nan
        if last is not None:
            ahead = unit(last.pose[2])
            self._progress += float((ego.pose[:2] - last.pose[:2]) @ ahead)  # (MET.23)
            if not ego.crashed:
                acceleration = (speed - float(last.velocity @ ahead)) / (scene.time - self._time[-1])
        self._collisions += bool(ego.crashed and (last is None or not last.crashed))
        frame = DriveFrame(
            distance=_smallest(box_distance(ego, boxes)),
            ttc=_smallest(headway_time(ego, boxes)),
            ttc_plane=_smallest(contact_time(ego, boxes)),
            speed=speed,
            acceleration=acceleration,
        )
        self._frames.append(frame)
        self._time.append(scene.time)
        self._last = ego
        return frame

    def summary(self) -> dict[str, float | int]:
        """The drive in one flat row; inf where no body was ever near, NaN where nothing was measured."""
        frames = np.array(self._frames, float).reshape(-1, len(DriveFrame._fields))
        distance, ttc, plane, speed, acceleration = frames.T
        elapsed = self._time[-1] - self._time[0] if self._time else 0.0
        return {
            "elapsed": elapsed,
            "collisions": self._collisions,
            "ttc_min": _smallest(ttc),
            "ttc_plane_min": _smallest(plane),
            "distance_min": _smallest(distance),
            "distance_min_at": self._time[int(distance.argmin())] if np.isfinite(distance).any() else np.nan,
            "progress": self._progress,
            "speed_mean": self._progress / elapsed if elapsed > 0 else np.nan,
            "speed_max": float(np.max(speed)) if len(speed) else np.nan,
            "deceleration_max": abs(float(np.fmin.reduce(acceleration, initial=0.0))),
            "harsh_braking": count_onsets(acceleration, self.harsh, self.released),
        }


def _smallest(values: NDArray) -> float:
    """Least of the values, inf of none."""
    return float(np.min(values, initial=np.inf))


def count_onsets(value: NDArray, below: float, above: float) -> int:
    """How often the series value (F,) falls below one threshold after having been above the other; NaN changes nothing.

    >>> count_onsets(np.array([0.0, -5.0, -3.0, -5.0, -1.0, -4.5]), below=-4.0, above=-2.0)
    2
    """
    crossed = np.where(value < below, 1, np.where(value > above, 0, -1))
    states = np.concatenate([[0], crossed[crossed >= 0]])
    return int((np.diff(states) > 0).sum())

"""How the ego drove: collisions, risk ahead, progress, braking and comfort, measured on scenes alone.

Every rigid body counts for itself: a bent articulated truck is two boxes, not the box around both. Equations:
docs/methods/metrics.md, "The drive".
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from scenarios.corridor import NEAR, drive_value, gap_ahead, time_to_collision
from sensors.scene import Bodies, Ego, Scene, local_boxes
from testbed.evaluation.metrics import box_areas
from trackers.batch import Memoised
from trackers.geometry import box_corners, compose, point_velocity, rotation, unit

LONGEST = 10.0  # [s] a longer time to collision or headway counts as this, and so does none
SAME = 0.05  # two actions within this are one decision: continuous ones span -1 to 1, others are whole numbers
NEAR_CRASH, FAR = 0.95, 3.0  # [s] least times to collision that are worth nothing, and all, of their part of a score
COMFORTABLE, HARD = 4.05, 8.0  # [m/s^2] hardest brakings that are worth all, and nothing, of theirs
LEAST_AIM = 1.0  # [m] a shorter way on the truth is as good as none
HARDEST = 20.0  # [m/s^2] DRAC is cut at this: one near miss would else rule every mean


class BodyBoxes(NamedTuple):
    """Bounding boxes of B bodies."""

    pose: NDArray  # (B, 3) centre x, y [m], heading [rad]
    size: NDArray  # (B, 2) length, width [m]
    velocity: NDArray  # (B, 2) [m/s] of the centre


def body_boxes(bodies: Bodies) -> BodyBoxes:
    """The box around each outline, along the body's heading."""
    low, high = local_boxes(bodies)
    shift = np.concatenate([(low + high) / 2, np.zeros((len(low), 1))], -1)
    pose = compose(bodies.pose, shift)
    lever = (pose - bodies.pose)[:, :2]
    return BodyBoxes(pose, high - low, point_velocity(bodies.velocity, bodies.yaw_rate, lever))


def box_distance(ego: Ego, boxes: BodyBoxes) -> NDArray:
    """Shortest distances (B,) [m] from the ego's box to the others, 0 where they touch."""
    return shapely.distance(box_areas(ego.pose, ego.size), box_areas(boxes.pose, boxes.size))  # (MET.20)


def headway_time(ego: Ego, boxes: BodyBoxes) -> NDArray:
    """Time to collision (B,) [s] along the ego's heading: bumper distance over closing speed, inf where it opens.

    Hayward (1972), for what reaches into the straight corridor, as wide as the ego, ahead of its front bumper.
    """
    return time_to_collision(*ahead(ego, boxes))  # (MET.21)


def ahead(ego: Ego, boxes: BodyBoxes) -> tuple[NDArray, NDArray]:
    """Gap (B,) [m] from the front bumper, inf outside the corridor ahead, and closing speed (B,) [m/s]."""
    gap = gap_ahead(ego.pose, ego.size, box_corners(boxes.pose, boxes.size))
    return gap, (ego.velocity - boxes.velocity) @ unit(ego.pose[2])


def deceleration_needed(gap: NDArray, closing: NDArray) -> NDArray:
    """Deceleration rate to avoid a crash, DRAC (...) [m/s^2], at most `HARDEST`, of gaps [m] and closing speeds [m/s].

    Almqvist, Hyden, Risser (1991): the constant braking with which the gap is used up as the speeds become equal.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = closing**2 / (2 * gap)
    return np.where(closing > 0, np.minimum(needed, HARDEST), 0.0)  # (MET.25)


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
    gap: float  # [m] to what is nearest in the corridor ahead
    headway: float  # [s] the same, over the ego's speed
    drac: float  # [m/s^2] `deceleration_needed`, 0 without a body that closes


def drive_frame(scene: Scene, last: Scene | None) -> DriveFrame:
    """The ego at one scene; `last` is the one before, from which the acceleration follows."""
    ego, now = scene.ego, _alone(scene)
    if last is None or ego.crashed:
        return now
    before = float(last.ego.velocity @ unit(last.ego.pose[2]))
    return now._replace(acceleration=(now.speed - before) / (scene.time - last.time))


def _drive_alone(scene: Scene) -> DriveFrame:
    """The ego at one scene, whatever was before."""
    ego, boxes = scene.ego, body_boxes(scene.bodies)
    gap, closing = ahead(ego, boxes)
    nearest, speed = _smallest(gap), float(ego.velocity @ unit(ego.pose[2]))
    return DriveFrame(
        distance=_smallest(box_distance(ego, boxes)),
        ttc=_smallest(time_to_collision(gap, closing)),
        ttc_plane=_smallest(contact_time(ego, boxes)),
        speed=speed,
        acceleration=np.nan,
        gap=nearest,
        headway=nearest / speed if speed > 0 else np.inf,
        drac=float(deceleration_needed(gap, closing).max(initial=0.0)),
    )


_alone = Memoised(_drive_alone)  # the environment's `info` and the evaluator ask for the same scene


class DriveCurves(NamedTuple):
    """A drive over its F frames: the time, and each field of `DriveFrame`, (F,)."""

    time: NDArray  # [s]
    distance: NDArray  # [m]
    ttc: NDArray  # [s]
    ttc_plane: NDArray  # [s]
    speed: NDArray  # [m/s]
    acceleration: NDArray  # [m/s^2]
    gap: NDArray  # [m]
    headway: NDArray  # [s]
    drac: NDArray  # [m/s^2]

    @property
    def dt(self) -> NDArray:
        """Time (F,) [s] since the frame before, 0 at the first."""
        return np.diff(self.time, prepend=self.time[:1])

    @property
    def braking(self) -> NDArray:
        """Braking (F,) [m/s^2], 0 where the ego does not brake, at the first frame and in a crash."""
        return np.maximum(0.0, -np.nan_to_num(self.acceleration))

    @property
    def value(self) -> NDArray:
        """Rate (F,) of the drive value."""
        return drive_value(self.speed, self.ttc, self.braking)


class DriveRecord(NamedTuple):
    """One drive of at least one frame, as its metrics read it."""

    curves: DriveCurves
    progress: float  # [m] along the heading
    collisions: int
    harsh: float  # [m/s^2] braking below this is harsh
    released: float  # [m/s^2] it ends above this
    off_road: float = 0.0  # [s] with the centre on no lane

    @property
    def closest(self) -> float:
        """Time [s] of the least distance, NaN where no body was ever near."""
        distance = self.curves.distance
        return float(self.curves.time[int(distance.argmin())]) if np.isfinite(distance).any() else np.nan

    @property
    def speed_mean(self) -> float:
        """Progress over time [m/s], NaN of a single frame."""
        elapsed = float(self.curves.time[-1] - self.curves.time[0])
        return self.progress / elapsed if elapsed > 0 else np.nan


class Driven(NamedTuple):
    """One of two drives that are compared."""

    curves: DriveCurves
    decisions: Sequence[Any]


def drive_score(drive: Mapping[str, Any], aim: NDArray | float) -> NDArray:
    """Score (...) in [0, 1] of drives, from their metrics by key; `aim` (...) [m] is the progress on the truth.

    The form of nuPlan's and NAVSIM's scores: what must not happen multiplies, what is good is weighed and added, and
    going farther than on the truth earns nothing. Time to collision and comfort are graded. NaN where `aim` is.
    """
    p, ttc, braking = (np.asarray(drive[key], float) for key in ("progress", "ttc_min", "deceleration_max"))
    progress = np.clip(p / np.maximum(aim, LEAST_AIM), 0.0, 1.0)  # (MET.40)
    time = np.clip((ttc - NEAR_CRASH) / (FAR - NEAR_CRASH), 0.0, 1.0)  # (MET.41)
    comfort = np.clip((HARD - braking) / (HARD - COMFORTABLE), 0.0, 1.0)  # (MET.42)
    allowed = (np.asarray(drive["collisions"]) == 0) & (np.asarray(drive.get("off_road", 0.0)) == 0)
    score = (5 * progress + 5 * time + 2 * comfort) / 12
    return np.where(np.isnan(aim), np.nan, np.where(allowed, score, 0.0))  # (MET.43)


def time_integrated(curves: DriveCurves) -> float:
    """Time to collision below `NEAR`, integrated over time [s^2]."""
    return float((np.maximum(0.0, NEAR - np.minimum(curves.ttc, LONGEST)) * curves.dt).sum())  # (MET.26)


def rms_jerk(acceleration: NDArray, dt: NDArray) -> float:
    """Root mean square [m/s^3] of the change of the three-frame mean of the acceleration (F,) [m/s^2], dt (F,) [s].

    0 for fewer than four frames that have one.
    """
    known = np.isfinite(acceleration)
    if known.sum() < 4:
        return 0.0
    smooth = np.convolve(acceleration[known], np.full(3, 1 / 3), "valid")
    return float(np.sqrt(np.mean((np.diff(smooth) / dt[known][3:]) ** 2)))  # (MET.27)


def extra_braking(drive: DriveCurves, other: DriveCurves) -> float:
    """Braking [m/s] of a drive beyond that of the other at equal times: integral of what is harder.

    Both begin at the same time, with the same frames; after the end of the shorter nothing is compared.
    """
    n = min(len(drive.time), len(other.time))
    return float((np.maximum(0.0, drive.braking[:n] - other.braking[:n]) * drive.dt[:n]).sum())  # (MET.29)


def speed_difference(drive: DriveCurves, other: DriveCurves) -> float:
    """Root mean square over time [m/s] of the difference of the speeds of two drives, as far as both go."""
    n = min(len(drive.time), len(other.time))
    return float(np.sqrt(np.mean((drive.speed[:n] - other.speed[:n]) ** 2)))


def changed_decisions(actions: Sequence[Any], others: Sequence[Any], within: float = 0.0) -> float:
    """Share of the decisions of two drives that differ, as far as both go; 0 without any.

    Continuous actions that differ by no more than `within` are one decision.

    >>> changed_decisions([1, 1, 0, 2], [1, 0, 0])
    0.3333333333333333
    """
    pairs = list(zip(actions, others, strict=False))
    return sum(not np.allclose(a, b, rtol=0.0, atol=within) for a, b in pairs) / len(pairs) if pairs else 0.0


def _smallest(values: NDArray) -> float:
    return float(values.min(initial=np.inf))


def count_onsets(value: NDArray, below: float, above: float) -> int:
    """How often the series value (F,) falls below one threshold after having been above the other; NaN changes nothing.

    >>> count_onsets(np.array([0.0, -5.0, -3.0, -5.0, -1.0, -4.5]), below=-4.0, above=-2.0)
    2
    """
    crossed = np.where(value < below, 1, np.where(value > above, 0, -1))
    states = np.concatenate([[0], crossed[crossed >= 0]])
    return int((np.diff(states) > 0).sum())

"""Prescribed courses: tables of motion at 100 Hz, made by integration, to be followed exactly.

The heading is the course (no crab angle). Accelerations and yaw rates pass from one value to the next linearly, over
`onset` and `ramp` seconds. A positive yaw rate and a positive shift turn to the right: y points there.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenarios.paths import SmoothPath
from trackers.geometry import cross, dot, rotation, unit

COLUMNS = ("t", "x", "y", "heading", "vx", "vy", "yaw_rate")  # [s], [m], [m], [rad] unwrapped, [m/s], [m/s], [rad/s]
T, X, Y, HEADING, VX, VY, YAW_RATE = range(7)
RATE = 100  # [Hz]


class CourseTable:
    """A course over time, rows with the columns of `COLUMNS`, read between them.

    Between the rows a cubic through both states and rates (Hermite); past the last row straight on. Immutable.
    """

    def __init__(self, rows: ArrayLike) -> None:
        rows = np.array(rows, float)
        if rows.ndim != 2 or rows.shape[1] != len(COLUMNS) or len(rows) < 2:
            raise ValueError(
                f"table must be (K >= 2, 7): {', '.join(COLUMNS)}; got {rows.shape}; add the rates of the trajectory"
            )
        if not np.isfinite(rows).all() or (np.diff(rows[:, T]) <= 0).any():
            raise ValueError(f"table must be finite and increase in t, got {len(rows)} rows that do not; sort them")
        rows[:, HEADING] = np.unwrap(rows[:, HEADING])
        rows.flags.writeable = False
        self.rows = rows

    def __deepcopy__(self, memo: dict) -> "CourseTable":
        return self

    @property
    def start(self) -> float:
        """Time [s] of the first row."""
        return float(self.rows[0, T])

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration [m/s^2] of the course: how much of a maneuver it is."""
        rate = np.diff(self.rows[:, VX : VY + 1], axis=0) / np.diff(self.rows[:, T])[:, None]
        return float(np.hypot(rate[:, 0], rate[:, 1]).max())

    def at(self, t: float) -> tuple[NDArray, NDArray]:
        """Pose (3,) x, y [m], heading [rad] and its rate (3,) at time t [s]; t before the start is the start."""
        times = self.rows[:, T]
        t = max(t, self.start)
        if t >= times[-1]:
            pose, rate = self.rows[-1, 1:4], self.rows[-1, 4:] * [1, 1, 0]
            return pose + (t - times[-1]) * rate, rate
        k = int(np.searchsorted(times, t, side="right")) - 1
        h = times[k + 1] - times[k]
        u = (t - times[k]) / h
        (p, v), (q, w) = (np.split(self.rows[j, 1:], 2) for j in (k, k + 1))
        d = (q - p) / h
        pose = p + h * u * (v + u * (3 * d - 2 * v - w + u * (v + w - 2 * d)))
        rate = v + u * (2 * (3 * d - 2 * v - w) + 3 * u * (v + w - 2 * d))
        return pose, rate


class Segment(NamedTuple):
    """A stretch of time with constant demand."""

    duration: float  # [s]
    acceleration: float = 0.0  # [m/s^2] along the course
    yaw_rate: float = 0.0  # [rad/s]


class Push(NamedTuple):
    """A stretch of time with an acceleration that is constant on the axes of the world, or with a turn."""

    duration: float  # [s]
    acceleration: tuple[float, float] = (0.0, 0.0)  # [m/s^2] along x and y, 0 in a turn
    yaw_rate: float = 0.0  # [rad/s] with which the velocity turns


class Shift(NamedTuple):
    """A quintic change of lateral offset: rest to rest, continuous acceleration."""

    start: float  # [s]
    duration: float  # [s]
    distance: float  # [m] to the right


def _demand(t: NDArray, durations: Sequence[float], values: Sequence[float], onset: float) -> NDArray:
    """Piecewise constant demand at times t, averaged over the last `onset` seconds: the integral is kept exactly."""
    ends = np.concatenate([[0.0], np.cumsum(durations)])
    total = np.concatenate([[0.0], np.cumsum(np.multiply(durations, values))])
    window = max(onset, 1.0 / RATE)
    return (np.interp(t, ends, total) - np.interp(t - window, ends, total)) / window


def _cumulative(f: NDArray, start: float = 0.0) -> NDArray:
    """Running trapezoidal integral (n,) of samples at `RATE`."""
    return start + np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / (2 * RATE))])


def speed_profile(t: NDArray, speed: float, segments: Sequence[Segment], onset: float = 0.5) -> NDArray:
    """Speeds (n,) [m/s] at times t (n,); a vehicle that brakes to standstill stays there."""
    a = _demand(t, [g.duration for g in segments], [g.acceleration for g in segments], onset)
    v = _cumulative(a, speed)
    return v - np.minimum(np.minimum.accumulate(v), 0.0)  # so that a later acceleration starts from rest


def integrate(
    start: ArrayLike, speed: float, segments: Sequence[Segment], ramp: float = 1.0, onset: float = 0.5
) -> NDArray:
    """Course (n, 7) from a pose (3,) x, y [m], heading [rad] at a speed [m/s] through the segments.

    It is longer than the segments by the larger of `ramp` and `onset`, when the last demand has faded.
    """
    check_segments(segments)
    x, y, heading = np.asarray(start, float)
    durations = [g.duration for g in segments]
    n = round((sum(durations) + max(ramp, onset)) * RATE)
    fine = np.arange(2 * n + 1) / (2 * RATE)  # half steps: Simpson's rule for the position
    t = fine[::2]
    v = speed_profile(t, speed, segments, onset)
    yaw_rate = _demand(t, durations, [g.yaw_rate for g in segments], ramp)
    course = _cumulative(yaw_rate, heading)
    v_mid = (v[1:] + v[:-1]) / 2 - np.diff(np.gradient(v, 1 / RATE)) / (8 * RATE)
    c_mid = (course[1:] + course[:-1]) / 2 - np.diff(yaw_rate) / (8 * RATE)
    rate, mid = v[:, None] * unit(course), v_mid[:, None] * unit(c_mid)
    step = (rate[1:] + 4 * mid + rate[:-1]) / (6 * RATE)
    xy = np.array([x, y]) + np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    return np.column_stack([t, xy, course, rate, yaw_rate])


def pushed(start: ArrayLike, velocity: ArrayLike, pushes: Sequence[Push], onset: float = 0.5) -> NDArray:
    """Course (n, 7) from a point (2,) [m] at a velocity (2,) [m/s]; the body always points along the velocity."""
    for push in pushes:
        if not push.duration > 0 or (push.yaw_rate and any(push.acceleration)):
            raise ValueError(f"pushes must last longer than 0 s and either accelerate or turn, got {push}")
    durations = [p.duration for p in pushes]
    t = np.arange(round((sum(durations) + onset) * RATE) + 1) / RATE
    a = np.stack([_demand(t, durations, [p.acceleration[k] for p in pushes], onset) for k in range(2)], -1)
    w = _demand(t, durations, [p.yaw_rate for p in pushes], onset)
    turn = rotation(_cumulative(w))  # of the velocity that the accelerations alone would give
    back = (turn.mT @ a[..., None])[..., 0]
    straight = np.stack([_cumulative(back[:, k], v) for k, v in enumerate(velocity)], -1)  # type: ignore[arg-type]
    v = (turn @ straight[..., None])[..., 0]
    xy = np.stack([_cumulative(v[:, k], x) for k, x in enumerate(start)], -1)  # type: ignore[arg-type]
    heading = np.unwrap(np.arctan2(v[:, 1], v[:, 0]))
    return np.column_stack([t, xy, heading, v, w + cross(v, a) / dot(v, v)])


def follow_lane(
    path: SmoothPath,
    s: float,
    speed: float,
    segments: Sequence[Segment] = (),
    shifts: Sequence[Shift] = (),
    lateral: float = 0.0,
    duration: float = 25.0,
    onset: float = 0.5,
) -> NDArray:
    """Course (n, 7) along a path from arc length s [m], with a profile of speed and of lateral offset.

    The speed is that at the vehicle's own offset, and stays after the segments, whose yaw rate must be 0.
    """
    check_segments(segments)
    if any(g.yaw_rate for g in segments):
        raise ValueError("segments of follow_lane turn with the lane; leave yaw_rate at 0 or use integrate()")
    t = np.arange(round(duration * RATE) + 1) / RATE
    v = speed_profile(t, speed, segments, onset)
    d, d_rate = _offsets(t, shifts, lateral)
    arc = _cumulative(v, s)
    for _ in range(4):  # s' = v / (1 - curvature d): contraction by |d| times the change of curvature, 1e-3 a round
        stretch = 1.0 - path.curvature(arc) * d
        arc = _cumulative(v / stretch, s)
    course = np.unwrap(path.heading(arc)) + np.arctan2(d_rate, np.where(v > 0, v, 1.0))
    rate = np.hypot(v, d_rate)[:, None] * unit(course)
    yaw_rate = np.gradient(course, 1 / RATE, edge_order=2)
    return np.column_stack([t, path.position(arc, d), course, rate, yaw_rate])


def _offsets(t: NDArray, shifts: Sequence[Shift], lateral: float) -> tuple[NDArray, NDArray]:
    """Lateral offset (n,) [m] and its rate (n,) [m/s]."""
    d, rate = np.full_like(t, lateral), np.zeros_like(t)
    for start, duration, distance in shifts:
        u = np.clip((t - start) / duration, 0.0, 1.0)
        d += distance * u**3 * (10 - 15 * u + 6 * u**2)
        rate += distance / duration * 30 * u**2 * (1 - u) ** 2
    return d, rate


def peak_lateral_acceleration(table: NDArray) -> float:
    """Largest speed times yaw rate [m/s^2] of a course."""
    return float(np.abs(np.hypot(table[:, VX], table[:, VY]) * table[:, YAW_RATE]).max())


def check(table: NDArray, max_lateral: float) -> None:
    """Refuse a course (n, 7) that does not stay below the lateral acceleration [m/s^2]."""
    peak = peak_lateral_acceleration(table)
    if peak >= max_lateral:
        raise ValueError(f"course peaks at {peak:.2f} m/s^2 across, allowed is {max_lateral}; drive slower or wider")


def check_segments(segments: Sequence[Segment]) -> None:
    """Refuse segments that do not advance in time."""
    for g in segments:
        if not g.duration > 0:
            raise ValueError(f"segments must last longer than 0 s, got {g}; leave the segment out")

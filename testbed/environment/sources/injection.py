"""Known errors put into tracks one at a time, to see which the drive answers to: dose and response.

docs/methods/regret.md, section 4. An error of size zero changes no bit. Random errors are drawn for each object and
scan from the seed of the run, so they do not depend on what the ego does.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.perception import TrackerLike, TruthBased, advance, on_road
from trackers.estimate import Estimate
from trackers.geometry import rotation, unit, wrap_angle
from trackers.multi.road import RoadMap
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

ERROR_STREAM = 3  # spawn key of the seed of a run; `testbed.environment.wrapper` has those of radar and belief
LOST_FOR = 1.0  # [s] that a lost track is missing
VELOCITY_TIME, LATERAL_TIME = (
    0.5,
    1.0,
)  # [s] correlation times of the noise on velocity, and of lateral and heading noise
NOISES = 6  # vx, vy, lateral position, lateral velocity, heading: five coloured, and one white for losses


@dataclass(frozen=True)
class Errors:
    """Sizes of the injected errors; 0 means none, for the covariance 1."""

    velocity_lag: float = 0.0  # [s] time constant of a first-order lag of the velocity
    velocity_noise: float = 0.0  # [m/s] standard deviation of each component
    lateral_velocity: float = 0.0  # [m/s] standard deviation, across the heading
    lateral_position: float = 0.0  # [m] standard deviation, across the heading
    heading: float = 0.0  # [rad] standard deviation
    near_edge: float = 0.0  # [m] by which the edge nearest to the ego is too far, negative: too near
    length: float = 0.0  # [m] by which the box is too long, its near edge kept
    birth_delay: float = 0.0  # [s] after which an object gets its track
    loss_rate: float = 0.0  # [1/s] of tracks that are lost for `LOST_FOR`
    latency: float = 0.0  # [s] age of what is reported, compensated with the velocity of then
    covariance: float = 1.0  # factor of all variances; no estimate changes

    def __post_init__(self) -> None:
        for name, value in self.sizes.items():
            if not isfinite(value):
                raise ValueError(f"{name} must be finite, got {value}")
            if value < 0 and name not in ("near_edge", "length"):
                raise ValueError(f"{name} must not be negative, got {value}")
        if self.covariance == 0:
            raise ValueError("covariance must be positive, got 0; 1 leaves the variances as they are")

    @property
    def sizes(self) -> dict[str, float]:
        """Those that differ from none."""
        return {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}

    def __str__(self) -> str:
        return "+".join(f"{name}={value:g}" for name, value in self.sizes.items())


NONE = Errors()


def parse_errors(text: str) -> Errors:
    """The errors of a text `NAME=VALUE`, or several joined by `+`.

    >>> parse_errors("velocity_lag=0.5+loss_rate=0.3").loss_rate
    0.3
    """
    known = [f.name for f in fields(Errors)]
    found: dict[str, float] = {}
    for part in text.split("+"):
        name, equals, value = part.partition("=")
        if name not in known or not equals:
            raise ValueError(f"an injected error reads NAME=VALUE, got {part!r}; names are {', '.join(known)}")
        if name in found:
            raise ValueError(f"the injected error {name} is given twice in {text!r}; drop one")
        try:
            found[name] = float(value)
        except ValueError:
            raise ValueError(f"the injected error {name} must be a number, got {value!r}") from None
    return Errors(**found)


class ObjectPast(NamedTuple):
    """What is remembered of one object."""

    since: float  # [s] when it was there first
    velocity: NDArray  # (2,) [m/s] behind the lag
    noise: NDArray  # (NOISES - 1,) coloured, of unit variance
    lost_until: float  # [s]


class InjectionState(NamedTuple):
    """The state of the source, and the past of what it reports."""

    source: Any
    tracker: TrackerLike | None  # with the map of the episode, where the source is one
    objects: Mapping[int, ObjectPast]
    past: tuple[tuple[float, Tracks], ...]  # time [s] and tracks, oldest first, as far as the latency reaches
    scans: int


@dataclass(frozen=True)
class Injected:
    """A source of tracks whose tracks get errors before the planner sees them."""

    source: TrackerLike | TruthBased
    errors: Errors
    seed: int = 0  # of the run

    def start_on(self, road: RoadMap) -> InjectionState:
        """The source at its start, without a past."""
        if isinstance(self.source, TruthBased):
            return InjectionState(self.source.start_on(road), None, {}, (), 0)
        tracker = on_road(self.source, road)
        assert tracker is not None  # only the name "truth" stands for none
        return InjectionState(tracker.start(), tracker, {}, (), 0)

    def step_on_truth(
        self, state: InjectionState, scan: Scan, scene: Scene, origin: Origin
    ) -> tuple[InjectionState, Tracks, StepInfo]:
        """One step of the source, then the errors: latency, then those of each object, then what is missing."""
        if isinstance(self.source, TruthBased):
            source, tracks, info = self.source.step_on_truth(state.source, scan, scene, origin)
        else:
            assert state.tracker is not None
            source, info = state.tracker.step(state.source, scan, scene.dt)
            tracks = source
        past = (*state.past, (scene.time, tracks)) if self.errors.latency else ()
        past = past[_latest(past, scene.time - self.errors.latency) :]
        if past:
            tracks = _delayed(*past[0], scene.time)
        objects = {
            i: _remembered(state.objects.get(i), v, self._draw(i, state.scans), scene, self.errors)
            for i, v in zip(tracks.id.tolist(), tracks.estimate.velocity, strict=True)
        }
        estimate = disturb(tracks.estimate, [objects[i] for i in tracks.id.tolist()], scene.ego.pose, self.errors)
        state = InjectionState(source, state.tracker, {**state.objects, **objects}, past, state.scans + 1)
        tracks = tracks._replace(estimate=estimate)
        return state, self._present(tracks, objects, scene.time), info

    def _draw(self, number: int, scan: int) -> NDArray:
        """Standard normal numbers (NOISES,) of an object at a scan."""
        return np.random.default_rng([self.seed, ERROR_STREAM, number, scan]).standard_normal(NOISES)

    def _present(self, tracks: Tracks, objects: Mapping[int, ObjectPast], time: float) -> Tracks:
        """Without the tracks that are late or lost."""
        e = self.errors
        if not (e.birth_delay or e.loss_rate):
            return tracks
        own = [objects[i] for i in tracks.id.tolist()]
        return tracks.rows(np.array([time >= o.since + e.birth_delay and time >= o.lost_until for o in own], bool))


def _latest(past: tuple[tuple[float, Tracks], ...], time: float) -> int:
    """Index of the last entry not later than a time [s], or 0."""
    return max((k for k, (then, _) in enumerate(past) if then <= time + 1e-9), default=0)


def _delayed(then: float, tracks: Tracks, now: float) -> Tracks:
    """Tracks of the past predicted to the present with their own velocities, as a tracker reports them."""
    return tracks._replace(estimate=advance(tracks.estimate, now - then))


def _remembered(past: ObjectPast | None, velocity: NDArray, draw: NDArray, scene: Scene, errors: Errors) -> ObjectPast:
    """The past of an object after one more scan."""
    if past is None:
        return ObjectPast(scene.time, velocity.copy(), draw[:-1], -np.inf)
    keep = np.exp(-scene.dt / np.array([VELOCITY_TIME] * 2 + [LATERAL_TIME] * 3))
    noise = keep * past.noise + np.sqrt(1 - keep**2) * draw[:-1]  # (RGT.4)
    lag = errors.velocity_lag
    lagged = velocity + np.exp(-scene.dt / lag) * (past.velocity - velocity) if lag else velocity  # (RGT.3)
    lost_until = past.lost_until
    if scene.time >= lost_until and ndtr(draw[-1]) < 1 - np.exp(-errors.loss_rate * scene.dt):
        lost_until = scene.time + LOST_FOR
    return ObjectPast(past.since, lagged, noise, lost_until)


def disturb(estimate: Estimate, own: list[ObjectPast], ego: NDArray, errors: Errors) -> Estimate:
    """Estimates (T) with the errors of their objects; ego (3,) is its pose."""
    if not own:
        return estimate
    e = errors
    noise, lagged = np.stack([o.noise for o in own]), np.stack([o.velocity for o in own])
    pose, velocity, size = estimate.pose.copy(), estimate.velocity.copy(), estimate.size.copy()
    across = unit(pose[:, 2] + np.pi / 2)
    if e.velocity_lag:
        velocity = lagged
    if e.velocity_noise:
        velocity = velocity + e.velocity_noise * noise[:, :2]
    if e.lateral_velocity:
        velocity = velocity + e.lateral_velocity * noise[:, 3:4] * across
    if e.lateral_position:
        pose[:, :2] += e.lateral_position * noise[:, 2:3] * across
    if e.near_edge:
        pose[:, :2] += e.near_edge * line_of_sight(pose, size, ego)  # (RGT.6)
    if e.length:
        pose, size = resize_keep_edge(pose, size, size + np.array([e.length, 0.0]), ego)
    if e.heading:
        pose[:, 2] = wrap_angle(pose[:, 2] + e.heading * noise[:, 4])
    moved = estimate._replace(pose=pose, velocity=velocity, size=size)
    return scaled(moved, e.covariance) if e.covariance != 1 else moved


def near_side(pose: NDArray, size: NDArray, ego: NDArray) -> NDArray:
    """The point of T boxes that is nearest to the ego, (T, 2) along the axes of each box, in halves of its size.

    pose (T, 3), size (T, 2) [m], ego (3,). At most 1: the front, or the positive side; less beside.
    """
    local = (rotation(pose[:, 2]).mT @ (ego[:2] - pose[:, :2])[..., None])[..., 0]
    return np.clip(local / (size / 2), -1, 1)  # (RGT.5)


def line_of_sight(pose: NDArray, size: NDArray, ego: NDArray) -> NDArray:
    """Unit vectors (T, 2) from the ego to the nearest points of T boxes; arguments as in `near_side`."""
    offset = (rotation(pose[:, 2]) @ (near_side(pose, size, ego) * size / 2)[..., None])[..., 0]
    away = pose[:, :2] + offset - ego[:2]
    return away / np.maximum(np.hypot(*away.T), 1e-9)[:, None]


def resize_keep_edge(pose: NDArray, size: NDArray, new: NDArray, ego: NDArray) -> tuple[NDArray, NDArray]:
    """Poses (T, 3) and sizes (T, 2) [m] of boxes that take a new size (T, 2) and keep the point nearest to the ego.

    A size is at least .3 m.
    """
    new = np.maximum(new, 0.3)
    shift = near_side(pose, size, ego) * (size - new) / 2
    pose = pose.copy()
    pose[:, :2] += (rotation(pose[:, 2]) @ shift[..., None])[..., 0]  # (RGT.7)
    return pose, new


def scaled(estimate: Estimate, factor: float) -> Estimate:
    """The estimates with all variances multiplied by a factor."""
    root = np.sqrt(factor)
    stds = {name: root * getattr(estimate, name) for name in ("size_std", "heading_std", "yaw_rate_std")}
    stds["edge_std"] = root * estimate.edges
    return estimate._replace(cov=factor * estimate.cov, **stds)

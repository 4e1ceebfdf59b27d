"""Truth in view with some groups of errors taken from a tracker, so that a drive shows what each group costs.

Groups: E existence (missing objects, false tracks), G geometry (pose, size), V motion (velocity, yaw rate). With no
group the planner gets what is in view, with all three exactly the tracks. docs/methods/regret.md, section 3.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.perception import TrackerLike, on_road, truth_tracks
from testbed.environment.sources.in_view import InView, LastSeen
from trackers.batch import take
from trackers.estimate import Estimate
from trackers.multi.road import RoadMap
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

EXISTENCE, GEOMETRY, MOTION = GROUPS = "EGV"
GROUP_NAMES = {EXISTENCE: "existence", GEOMETRY: "geometry", MOTION: "motion"}
GATE = 4.0  # [m] between centres; of long objects half the length and
GATE_BEYOND = 1.5  # [m]


def subsets() -> tuple[str, ...]:
    """All subsets of the groups: "", "E", "G", ..., "EGV", each before those that contain it.

    >>> subsets()
    ('', 'E', 'G', 'V', 'EG', 'EV', 'GV', 'EGV')
    """
    found = ["".join(g for k, g in enumerate(GROUPS) if i >> k & 1) for i in range(2 ** len(GROUPS))]
    return tuple(sorted(found, key=len))


class SubstitutionState(NamedTuple):
    """A tracker and what it is compared with."""

    tracker: TrackerLike  # with the map of the episode
    tracks: Tracks
    seen: LastSeen


@dataclass(frozen=True)
class Substituted:
    """A tracker of which the planner gets some groups of errors only; all else is the truth in view."""

    tracker: TrackerLike
    groups: str  # of "EGV", in any order
    in_view: InView = field(default_factory=InView)

    def __post_init__(self) -> None:
        if not set(self.groups) <= set(GROUPS) or len(set(self.groups)) < len(self.groups):
            raise ValueError(f"groups must be some of the letters E, G, V, each once, got {self.groups!r}")

    def start_on(self, road: RoadMap) -> SubstitutionState:
        """No tracks, and nothing seen."""
        tracker = on_road(self.tracker, road)
        assert tracker is not None  # only the name "truth" stands for none
        return SubstitutionState(tracker, tracker.start(), self.in_view.start_on(road))

    def step_on_truth(
        self, state: SubstitutionState, scan: Scan, scene: Scene, origin: Origin
    ) -> tuple[SubstitutionState, Tracks, StepInfo]:
        """One step of the tracker, and its tracks mixed with the truth."""
        own, own_info = state.tracker.step(state.tracks, scan, scene.dt)
        seen, ideal, ideal_info = self.in_view.step_on_truth(state.seen, scan, scene, origin)
        mixed = mix(truth_tracks(scene), ideal, own, self.groups)
        return state._replace(tracks=own, seen=seen), mixed, own_info if EXISTENCE in self.groups else ideal_info


def mix(truth: Tracks, ideal: Tracks, own: Tracks, groups: str) -> Tracks:
    """Tracks for the planner.

    With existence they are those of the tracker, unreported ones and false ones included; without, the objects in view.
    A track and an object that match exchange what the groups say.

    Args:
        truth: all N objects of the scene, as tracks.
        ideal: those in view.
        own: the tracks of the tracker.
        groups: those that are taken from the tracker.
    """
    own_geometry, own_motion = GEOMETRY in groups, MOTION in groups
    if EXISTENCE in groups:
        partner = match(own, truth)
        rows, known = np.flatnonzero(partner >= 0), partner[partner >= 0]
        estimate = _exchanged(own.estimate, rows, take(truth.estimate, known), not own_geometry, not own_motion)
        return own._replace(estimate=estimate)
    reported = own.reported
    partner = match(ideal, reported)
    rows, known = np.flatnonzero(partner >= 0), partner[partner >= 0]
    return ideal._replace(
        estimate=_exchanged(ideal.estimate, rows, take(reported.estimate, known), own_geometry, own_motion)
    )


def match(tracks: Tracks, others: Tracks) -> NDArray:
    """Row of `others` that belongs to each of T tracks, (T,) int, -1 for none.

    The least sum of distances between centres among the pairs within the gate, (RGT.2); reported tracks come before
    unreported ones, which get what is left.
    """
    partner = np.full(len(tracks.id), -1)
    free = np.arange(len(others.id))
    for rows in (np.flatnonzero(tracks.existence > 0.5), np.flatnonzero(tracks.existence <= 0.5)):
        pairs = _assign(take(tracks.estimate, rows), take(others.estimate, free))
        for row, column in pairs:
            partner[rows[row]] = free[column]
        free = np.delete(free, [column for _, column in pairs])
    return partner


def _assign(a: Estimate, b: Estimate) -> list[tuple[int, int]]:
    """Pairs of rows of two sets of estimates; estimates that are not finite have no pair."""
    distance = np.hypot(*np.moveaxis(a.pose[:, None, :2] - b.pose[None, :, :2], -1, 0))
    length = np.fmin(a.size[:, None, 0], b.size[None, :, 0])
    gate = np.maximum(GATE, length / 2 + GATE_BEYOND)  # (RGT.2)
    near = distance <= gate
    outside = 1e3 * (1.0 + len(a.pose) + len(b.pose))  # more than all distances within gates together
    rows, columns = linear_sum_assignment(np.where(near, distance, outside))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if near[i, j]]


def _exchanged(base: Estimate, rows: NDArray, other: Estimate, geometry: bool, motion: bool) -> Estimate:
    """`base` with geometry, motion or both of some rows replaced by those of `other`, which has one entry a row.

    Covariances go with their groups; those between position and velocity are zero where the groups are of two sources.
    Contour and class probabilities belong to geometry, and are dropped where sources mix.
    """
    if not len(rows) or not (geometry or motion):
        return base
    found: dict[str, Any] = {}
    cov = base.cov.copy()
    blocks = [(slice(0, 2), geometry), (slice(2, 4), motion)]
    for part, taken in blocks:
        if taken:
            cov[rows, part, part] = other.cov[:, part, part]
    cov[rows, :2, 2:] = other.cov[:, :2, 2:] if geometry and motion else 0.0
    cov[rows, 2:, :2] = other.cov[:, 2:, :2] if geometry and motion else 0.0
    names: Iterable[str] = ("pose", "size", "size_std", "heading_std") if geometry else ()
    names = (*names, *(("velocity", "yaw_rate", "yaw_rate_std") if motion else ()))
    for name in names:
        found[name] = getattr(base, name).copy()
        found[name][rows] = getattr(other, name)
    if geometry:
        found |= {"contour": None, "class_probability": None, "edge_std": base.edges.copy()}
        found["edge_std"][rows] = other.edges
    return base._replace(cov=cov, **found)

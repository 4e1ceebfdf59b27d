"""Reidentification: a vehicle that appears where one that was lost should be by now gets its id back.

Equations: docs/methods/life-cycle-of-tracks.md, section 5.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import concatenate, keep, take
from trackers.estimate import Estimate
from trackers.geometry import rotation, wrap_angle
from trackers.linalg import quadratic
from trackers.multi.road import RoadMap
from trackers.parameters import check_numbers


class LostTracks(NamedTuple):
    """D confirmed tracks that died."""

    id: NDArray  # (D,) int
    hits: NDArray  # (D,) int
    age: NDArray  # (D,) [s] since death
    estimate: Estimate  # (D,) at death, moved since
    state: Any  # the filter's, leading axis D, as at death


@dataclass(frozen=True)
class Reidentification:
    """How long a lost vehicle is remembered, and how far from its predicted motion it may appear again."""

    span: float = 8.0  # [s]
    least_hits: int = 8  # of a track that is remembered
    most: int = 50  # tracks remembered, the latest
    hidden: float = np.inf  # [s] that no sensor should have seen a track, from which on it is sought like a lost one
    wander: tuple[float, float] = (1.5, 0.3)  # [m/s in a second] of its velocity, along and across, growing as sqrt(t)
    sudden: tuple[float, float] = (2.0, 0.5)  # [m/s] error of the velocity of a track that got lost
    misplaced: tuple[float, float] = (1.5, 1.0)  # [m] error of its place along and across
    newcomers: float = 1e-3  # [1/m^2] density of vehicles that no track has held, where one is born
    newcomer_speed: float = 5.0  # [m/s] standard deviation of their speed among the traffic
    sure: float = 0.5  # least probability of being the remembered one
    longer: float = 1.5  # [m] by which a cell may be longer than the remembered vehicle

    def __post_init__(self) -> None:
        check_numbers(self, positive=("most", "newcomer_speed"), unlimited=("hidden",))

    def remember(self, lost: LostTracks | None, died: LostTracks) -> LostTracks:
        """The memory with the tracks that died and had been seen often enough."""
        died = take(died, died.hits >= self.least_hits)
        both = died if lost is None else concatenate([lost, died])
        return take(both, np.arange(max(0, len(both.id) - self.most), len(both.id)))

    def predict(self, lost: LostTracks, dt: float, road: RoadMap | None) -> LostTracks:
        """The memory after dt [s]: vehicles drive on at their speed, and turn as their lane does."""
        known = lost.age + dt < self.span
        lost = lost if known.all() else keep(lost, known)
        e = lost.estimate
        if not len(lost.id):
            return lost
        pose, velocity, cov = e.pose.copy(), e.velocity, e.cov.copy()
        pose[:, :2] += velocity * dt  # (LIFE.24)
        if road is not None:
            depth, course = road.locate(np.concatenate([e.pose[:, :2], pose[:, :2]]))
            (inside, still), (before, after) = depth.reshape(2, -1), course.reshape(2, -1)
            along = np.abs(np.cos(before - e.pose[:, 2])) > 0.7
            turn = np.where((inside > 0) & (still > 0) & along, wrap_angle(after - before), 0.0)
            if turn.any():
                pose[:, 2] += turn
                velocity = (rotation(turn) @ velocity[..., None])[..., 0]
        F = _transition(dt)
        M = rotation(pose[:, 2])
        cov = F @ cov @ F.T
        cov[:, 2:, 2:] += (M * np.square(self.wander)) @ M.mT * dt  # (LIFE.25)
        return lost._replace(age=lost.age + dt, estimate=e._replace(pose=pose, velocity=velocity, cov=cov))

    def match(self, lost: LostTracks, born: Estimate, length: NDArray) -> NDArray:
        """Row (B,) of the memory that each birth is, -1 for none; length (B,) [m] is that of its cell.

        The filter's covariance at birth is that of the place and the velocity of `born` (B,).
        """
        B, D = len(length), len(lost.id)
        if not B or not D:
            return np.full(B, -1)
        old = lost.estimate
        x, y = (np.concatenate([e.pose[:, :2], e.velocity], -1) for e in (born, old))
        M = rotation(old.pose[:, 2])
        spread = np.zeros((D, 4, 4))
        spread[:, 2:, 2:] = (M * np.square(self.sudden)) @ M.mT
        spread[:, :2, :2] = spread[:, 2:, 2:] * (lost.age**2)[:, None, None] + (M * np.square(self.misplaced)) @ M.mT
        S = born.cov[:, None] + (old.cov + spread)  # (B, D, 4, 4)
        log_density = -0.5 * (quadratic(x[:, None] - y, S) + np.linalg.slogdet(2 * np.pi * S)[1])  # (LIFE.26)
        fresh = (
            np.log(self.newcomers)
            - 0.5 * np.linalg.slogdet(2 * np.pi * (born.cov[:, 2:, 2:] + self.newcomer_speed**2 * np.eye(2)))[1]
        )  # (LIFE.27)
        ratio = np.exp(np.clip(log_density - fresh[:, None], -50, 50))
        ratio *= length[:, None] < old.size[:, 0] + self.longer
        rivals = 1 + ratio.sum(1, keepdims=True) + ratio.sum(0) - ratio
        best = ratio.argmax(1)
        p = (ratio / rivals)[np.arange(B), best]  # (LIFE.28)
        return np.where(p > self.sure, best, -1)


@lru_cache(maxsize=8)
def _transition(dt: float) -> NDArray:
    """Transition (4, 4) of place and velocity over dt [s]; steps have few lengths."""
    F = np.eye(4) + dt * np.eye(4, k=2)
    F.flags.writeable = False
    return F

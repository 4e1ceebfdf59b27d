"""The road as the ego and those about it drive it, where there is no map.

Equations: docs/methods/life-cycle-of-tracks.md, section 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import to_frame, unit, wrap_angle
from trackers.multi.road import ALONG, SHARPEST

STEP, LENGTH = 10.0, 195.0  # [m] between the poses of the ego that are kept, and how far back they go
ROLLING = 1.0  # [m/s] of the ego, above which its yaw rate says how its way bends
FAST = 8.0  # [m/s] of others, above which their heading is that of the road
HEADING = 0.02  # [rad] of the road at the ego, from that of the ego
ACROSS, SLOW = 2.0, 15.0  # [m/s^2] of the ego where its road bends as roads do, at its speed [m/s] or this one
WINDING = 200.0  # [m] of road in which that bend changes by as much
ASIDE = (0.005, 0.1)  # [rad] least and most of the ego on the road
ASLANT = 0.1  # [rad] of others on it
CROSSING = 3.0  # standard deviations beyond which others are not on it


class Way(NamedTuple):
    """The road as a line of which the curvature walks at random, from where the ego is ahead and back."""

    driven: NDArray  # (K, 3) poses of the ego, the present one last
    speed: float  # [m/s] of the ego along its heading
    place: NDArray = np.zeros(0)  # (N,) [m] along it, of headings that are known
    weight: NDArray = np.zeros(0)  # (N,) [1/rad] of how they deviate from that of the ego
    information: NDArray = np.zeros((0, 0))  # (N, N) [1/rad^2]
    travelled: NDArray = np.zeros(1)  # (K,) [m] places of the poses of the ego

    @classmethod
    def of(cls, platform: NDArray) -> "Way":
        """That of a platform (6,) as in a scan: straight on, and nothing else is known."""
        return cls(platform[None, :3], _speed(platform))

    def followed(self, platform: NDArray, others: Estimate) -> "Way":
        """That of the platform (6,) after it drove this one, from where others (T,) drive."""
        trail = self.driven
        if len(trail) > 1 and np.hypot(*(trail[-1, :2] - trail[-2, :2])) < 0.99 * STEP:
            trail = trail[:-1]
        driven = np.concatenate([trail, platform[None, :3]])
        driven = driven[_travelled(driven) > -LENGTH]
        if len(self.driven) == 1 or len(driven) == 1:
            driven = _arc(platform)
        driven[:, 2] = np.unwrap(driven[:, 2])
        return Way(driven, _speed(platform), travelled=_travelled(driven))._among(others)

    def _among(self, others: Estimate) -> "Way":
        place, guess = self._project(others.pose[:, :2])
        off = guess + wrap_angle(2 * (others.pose[:, 2] - guess)) / 2 - self.driven[-1, 2]
        var = others.heading_std**2 + ASLANT**2
        along = off**2 < CROSSING**2 * (self._covariance(place, place) + var)
        row = np.flatnonzero(along & (np.hypot(*others.velocity.T) > FAST))
        place = np.append(self.travelled, place[row])
        off = np.append(self.driven[:, 2] - self.driven[-1, 2], off[row])
        var = np.append(np.full(len(self.driven), self._aside**2), var[row])
        information = np.linalg.inv(self._covariance(place[:, None], place) + np.diag(var))
        return self._replace(place=place, weight=information @ off, information=information)  # (LIFE.52)

    def direction(self, xy: NDArray) -> NDArray:
        """Direction (M,) [rad] of the road at points (M, 2)."""
        if not len(self.place):  # with a map in each step
            return np.full(len(xy), self.driven[-1, 2])
        return self._heading(self._project(xy)[0])

    def direction_std(self, xy: NDArray) -> NDArray:
        """Standard deviation (M,) [rad] of the direction at points (M, 2)."""
        place, _ = self._project(xy)
        k = self._covariance(place[:, None], self.place)
        return np.sqrt(
            np.maximum(self._covariance(place, place) - ((k @ self.information) * k).sum(-1), 0)
        )  # (LIFE.52)

    def curvature(self, pose: NDArray) -> NDArray:
        """Curvature (M,) [1/m] of the road that bodies at pose (M, 3) drive along, positive to the left, else 0."""
        place, _ = self._project(pose[:, :2])
        along = np.cos(self._heading(place) - pose[:, 2])
        k = self._slope(place[:, None], self.place)
        c = k @ self.weight  # (LIFE.52)
        var = self._sharp**2 * (1 + np.abs(place) / WINDING) - ((k @ self.information) * k).sum(-1)  # (LIFE.52)
        sure = np.maximum(1 - var / np.maximum(c**2, 1e-12), 0.0)  # (LIFE.56)
        return np.where(np.abs(along) > ALONG, np.sign(along) * sure * c, 0.0)

    def _heading(self, s: NDArray) -> NDArray:
        """Direction (M,) [rad] of the road at places s (M,) [m]."""
        return np.asarray(self.driven[-1, 2] + self._covariance(s[:, None], self.place) @ self.weight)  # (LIFE.52)

    def _project(self, xy: NDArray) -> tuple[NDArray, NDArray]:
        """Places (M,) [m] of points (M, 2) along the way, and heading (M,) [rad] of the ego where it was nearest."""
        near = ((xy[:, None] - self.driven[:, :2]) ** 2).sum(-1).argmin(1)
        at = self.driven[near]
        x, y = to_frame(at, xy[:, None])[:, 0].T
        beyond = ((near == len(self.driven) - 1) & (x > 0)) | ((near == 0) & (x < 0))
        return self.travelled[near] + np.where(beyond, np.copysign(np.hypot(x, y), x), x), at[:, 2]  # (LIFE.54)

    @property
    def _aside(self) -> float:
        """Standard deviation [rad] of the heading of the ego from the road, which at low speeds it may well leave."""
        least, most = ASIDE
        return float(np.clip(ACROSS / max(self.speed, ROLLING) ** 2, least, most))  # (LIFE.57)

    @property
    def _sharp(self) -> float:
        """Standard deviation [1/m] of the curvature."""
        return ACROSS / max(self.speed, SLOW) ** 2  # (LIFE.51)

    def _covariance(self, s: NDArray, t: NDArray) -> NDArray:
        """Covariance (...) [rad^2] of the directions at places s and t (...) [m]."""
        st, a, b = s * t, np.abs(s), np.abs(t)
        near, far = np.minimum(a, b), np.maximum(a, b)
        walk = (st > 0) * near**2 * (3 * far - near) / (6 * WINDING)
        return np.asarray(HEADING**2 + self._sharp**2 * (st + walk))  # (LIFE.51)

    def _slope(self, s: NDArray, t: NDArray) -> NDArray:
        """Covariance (...) [rad/m] of the curvatures at places s (...) [m] with the directions at t (...) [m]."""
        a, b = np.abs(s), np.abs(t)
        walk = np.where(s * t > 0, np.where(a < b, a * (2 * b - a), b**2) / (2 * WINDING), 0.0)
        return np.asarray(self._sharp**2 * (t + np.sign(s) * walk))  # (LIFE.52)


def _speed(platform: NDArray) -> float:
    return float(platform[3:5] @ unit(platform[2]))


def _travelled(driven: NDArray) -> NDArray:
    """Places (K,) [m] of poses (K, 3) that were driven, the last one at 0."""
    steps = np.hypot(*np.diff(driven[:, :2], axis=0).T)
    return np.append(-np.cumsum(steps[::-1])[::-1], 0.0)


def _arc(platform: NDArray) -> NDArray:
    """Poses (K, 3) of an ego that has always turned as the platform (6,) does: nothing is known of its way yet."""
    speed = _speed(platform)
    bend = np.clip(platform[5] / speed, -SHARPEST, SHARPEST) if speed > ROLLING else 0.0
    heading = platform[2] - bend * np.arange(0.0, LENGTH, STEP)[::-1]
    steps = STEP * np.sinc(bend * STEP / (2 * np.pi)) * unit((heading[1:] + heading[:-1]) / 2)
    back = np.concatenate([np.cumsum(steps[::-1], 0)[::-1], np.zeros((1, 2))])
    return np.concatenate([platform[:2] - back, heading[:, None]], -1)

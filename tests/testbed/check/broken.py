"""A filter that keeps all laws, and one for each law that breaks it the way a new user's would."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from trackers.estimate import Estimate
from trackers.filter import UpdateInfo
from trackers.linalg import symmetrize


class State(NamedTuple):
    m: np.ndarray  # (..., 4) x, y, vx, vy
    P: np.ndarray  # (..., 4, 4)
    first: Estimate


@dataclass(frozen=True)
class Centroid:
    """A Kalman filter of the mean of the detections."""

    accel_std: float = 2.0
    detection_std: float = 1.5

    def init(self, estimate):
        return State(np.concatenate([estimate.pose[..., :2], estimate.velocity], -1), estimate.cov, estimate)

    def predict(self, state, dt):
        F = np.eye(4) + dt * np.eye(4, k=2)
        G = np.vstack([dt**2 / 2 * np.eye(2), dt * np.eye(2)])
        P = symmetrize(F @ state.P @ F.T + self.accel_std**2 * G @ G.T)
        return state._replace(m=state.m @ F.T, P=P) if dt else state

    def update(self, state, scan):
        n, eps = self.innovation(state, scan)
        S = state.P[..., :2, :2] + self.detection_std**2 / np.maximum(n, 1)[..., None, None] * np.eye(2)
        K = np.where(n[..., None, None] > 0, state.P[..., :2] @ np.linalg.inv(S), 0.0)
        m = state.m + (K @ eps[..., None])[..., 0]
        P = symmetrize(state.P - K @ state.P[..., :2, :])
        some = n > 0
        m, P = np.where(some[..., None], m, state.m), np.where(some[..., None, None], P, state.P)
        return state._replace(m=m, P=P), UpdateInfo(n, eps, S)

    def innovation(self, state, scan):
        n = scan.mask.sum(-1)
        mean = np.where(scan.mask[..., None], scan.xy, 0.0).sum(-2) / np.maximum(n, 1)[..., None]
        return n, mean - state.m[..., :2]

    def estimate(self, state):
        pose = np.concatenate([state.m[..., :2], state.first.pose[..., 2:]], -1)
        return state.first._replace(pose=pose, velocity=state.m[..., 2:], cov=state.P)

    def shift(self, state, d):
        return state._replace(m=np.concatenate([state.m[..., :2] + d, state.m[..., 2:]], -1))

    def resize(self, state, size, size_std):
        return state._replace(first=state.first._replace(size=size, size_std=size_std))


class SharedRow(Centroid):
    """One covariance for all objects."""

    def init(self, estimate):
        return super().init(estimate)._replace(P=np.eye(4))


class NeedsOne(Centroid):
    """Looks at the largest covariance, which no objects do not have."""

    def predict(self, state, dt):
        state.P.max()
        return super().predict(state, dt)


class Shifted(Centroid):
    """Takes the rear of the box for its centre."""

    def estimate(self, state):
        e = super().estimate(state)
        return e._replace(pose=e.pose + np.array([0.5, 0.0, 0.0]))


class GrowsWithoutTime(Centroid):
    """Adds the same noise, however short the step."""

    def predict(self, state, dt):
        return super().predict(state, dt)._replace(P=state.P + 0.01 * np.eye(4))


class StandsStill(Centroid):
    """Forgets the transition of the mean."""

    def predict(self, state, dt):
        return super().predict(state, dt)._replace(m=state.m)


class MovesBlind(Centroid):
    """Divides by max(n, 1), and takes the mean of no detection, 0, for a place."""

    def update(self, state, scan):
        n, eps = self.innovation(state, scan)
        S = state.P[..., :2, :2] + self.detection_std**2 / np.maximum(n, 1)[..., None, None] * np.eye(2)
        K = state.P[..., :2] @ np.linalg.inv(S)
        m = state.m + (K @ eps[..., None])[..., 0]
        return state._replace(m=m, P=symmetrize(state.P - K @ state.P[..., :2, :])), UpdateInfo(n, eps, S)


class Deaf(Centroid):
    """Computes the innovation and leaves the mean where it was."""

    def update(self, state, scan):
        new, info = super().update(state, scan)
        return new._replace(m=state.m), info


class MeanOfAll(Centroid):
    """Takes a mean over all objects where it should be over the detections of one."""

    def innovation(self, state, scan):
        n, eps = super().innovation(state, scan)
        return n, eps - eps.reshape(-1, 2).mean(0) * (eps.ndim > 1)


class FirstCounts(Centroid):
    """Takes the first column of the scan for the nearest detection."""

    def innovation(self, state, scan):
        n, eps = super().innovation(state, scan)
        return n, eps if not scan.mask.shape[-1] else 0.9 * eps + 0.1 * (scan.xy[..., 0, :] - state.m[..., :2])


class PaddingLeaks(Centroid):
    """Multiplies by the mask: 0 * NaN is NaN."""

    def innovation(self, state, scan):
        n = scan.mask.sum(-1)
        return n, (scan.mask[..., None] * scan.xy).sum(-2) / np.maximum(n, 1)[..., None] - state.m[..., :2]


class AlongX(Centroid):
    """Allows for more noise along x, as if every object drove there."""

    def predict(self, state, dt):
        new = super().predict(state, dt)
        return new._replace(P=new.P + dt * np.diag([1.0, 0.0, 0.0, 0.0]))


class Unsymmetric(Centroid):
    """(I - K H) P, as the textbook has it."""

    def update(self, state, scan):
        n, eps = self.innovation(state, scan)
        S = state.P[..., :2, :2] + self.detection_std**2 / np.maximum(n, 1)[..., None, None] * np.eye(2)
        K = np.where(n[..., None, None] > 0, state.P[..., :2] @ np.linalg.inv(S), 0.0)
        m = state.m + (K @ eps[..., None])[..., 0]
        return state._replace(m=m, P=state.P - K @ state.P[..., :2, :]), UpdateInfo(n, eps, S)


class Overdone(Centroid):
    """Subtracts the correction ten times too often."""

    def update(self, state, scan):
        new, info = super().update(state, scan)
        return new._replace(P=new.P - 10 * (state.P - new.P)), info


class FromSpread(Centroid):
    """Weighs by the spread of the detections, which can be none."""

    def innovation(self, state, scan):
        n, eps = super().innovation(state, scan)
        if scan.mask.shape[-1] < 2:
            return n, eps
        spread = np.where(scan.mask[..., None], scan.xy, np.nan)
        spread = np.fmax.reduce(spread, -2) - np.fmin.reduce(spread, -2)
        return n, np.where(n[..., None] > 0, eps * spread / spread, 0.0)


class NeedsRates(Centroid):
    """Takes each range rate, measured or not."""

    def innovation(self, state, scan):
        n, eps = super().innovation(state, scan)
        rate = np.where(scan.mask, scan.polar[..., 2], 0.0).sum(-1)
        return n, eps + 0 * rate[..., None]


class WritesIntoState(Centroid):
    """Adds in place."""

    def update(self, state, scan):
        new, info = super().update(state, scan)
        state.m[...] = new.m
        return new, info


class Counts:
    """Keeps the number of its updates beside the state, and doubts the later ones."""

    def __init__(self):
        self.inner, self.calls = Centroid(), 0
        self.init, self.predict, self.estimate = self.inner.init, self.inner.predict, self.inner.estimate

    def update(self, state, scan):
        self.calls += 1
        return replace(self.inner, detection_std=1.5 + 0.01 * self.calls).update(state, scan)


class KeepsDict(Centroid):
    """Puts what it keeps into a dict."""

    def init(self, estimate):
        return super().init(estimate)._replace(first={"estimate": estimate})


class PlainTuple(Centroid):
    """Returns a tuple without names."""

    def init(self, estimate):
        return tuple(super().init(estimate))


class HalfShift(Centroid):
    """Forgets y."""

    def shift(self, state, d):
        return super().shift(state, d * [1.0, 0.0])


class ResizeForgets(Centroid):
    """Takes the size and not its spread."""

    def resize(self, state, size, size_std):
        return state._replace(first=state.first._replace(size=size))


class Faint(Centroid):
    """Raises within a scan of many detections."""

    def update(self, state, scan):
        if scan.mask.shape[-1] > 100:
            raise ZeroDivisionError("division by zero")
        return super().update(state, scan)

"""Your own filter: a constant-velocity Kalman filter of the centre, with a box of fixed size, tracks a cut-in.

Nothing is kept between calls, and the multi-object tracker calls a verb for all tracks at once: leading axes "...".

    testbed run cut-in --tracker own_filter:Kalman:accel_std=3    (in this folder)
"""

from dataclasses import dataclass
from typing import NamedTuple

import gymnasium as gym
import numpy as np

import testbed
from trackers import Estimate, Scan
from trackers.filter import UpdateInfo


class State(NamedTuple):
    """x, y [m], vx, vy [m/s], their covariance, and the first estimate, whose heading and size are kept."""

    m: np.ndarray  # (..., 4)
    P: np.ndarray  # (..., 4, 4)
    first: Estimate


@dataclass(frozen=True)
class Kalman:
    accel_std: float = 2.0  # [m/s^2] process noise
    detection_std: float = 1.5  # [m] of a detection around the centre: the body and the radar's noise

    def init(self, estimate: Estimate) -> State:
        return State(np.concatenate([estimate.pose[..., :2], estimate.velocity], -1), estimate.cov, estimate)

    def predict(self, state: State, dt: float) -> State:
        F = np.eye(4) + dt * np.eye(4, k=2)
        G = np.vstack([dt**2 / 2 * np.eye(2), dt * np.eye(2)])
        return state._replace(m=state.m @ F.T, P=F @ state.P @ F.T + self.accel_std**2 * G @ G.T)

    def update(self, state: State, scan: Scan) -> tuple[State, UpdateInfo]:
        n = scan.mask.sum(-1)  # (...) detections of each track; a scan with another mask for each of them
        z = np.where(scan.mask[..., None], scan.xy, 0.0).sum(-2) / np.maximum(n, 1)[..., None]
        eps = z - state.m[..., :2]  # (..., 2) innovation
        S = state.P[..., :2, :2] + self.detection_std**2 / np.maximum(n, 1)[..., None, None] * np.eye(2)
        K = np.where(n[..., None, None] > 0, state.P[..., :2] @ np.linalg.inv(S), 0.0)  # no detection: no change
        P = state.P - K @ state.P[..., :2, :]  # rounding makes it a little unsymmetric
        return state._replace(m=state.m + (K @ eps[..., None])[..., 0], P=(P + P.mT) / 2), UpdateInfo(n, eps, S)

    def estimate(self, state: State) -> Estimate:
        pose = np.concatenate([state.m[..., :2], state.first.pose[..., 2:]], -1)
        return state.first._replace(pose=pose, velocity=state.m[..., 2:], cov=state.P)


if __name__ == "__main__":
    env = gym.make("testbed/cut-in-v0", tracker=Kalman(), also=["rm-feldmann"], out="runs")
    env.reset(seed=0)
    for _ in range(20):  # 5 decisions a second
        env.step(testbed.PLANNERS["idm"].act(env))
    for name, row in env.recorder.close()["trackers"].items():  # also in runs/*.json; docs/results.md has the keys
        print(f"{name}: GOSPA {row['gospa']:.2f} m, position RMSE {row['rmse_position']:.2f} m")

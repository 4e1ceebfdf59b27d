"""A whole tracker of your own: association, birth and death are yours, and each track is a filter that keeps its state.

`start` clears what the tracker keeps; `step` takes a scan and returns all tracks as one batch, which is checked at each
step. filterpy_tracker.py and stonesoup_tracker.py do the same with what other libraries offer.

    testbed check tracker whole_tracker:Nearest    (in this folder)
"""

import gymnasium as gym
import numpy as np

import testbed
from trackers import Scan, StepInfo, Tracks, prior

GATE, SPREAD = 4.0, 1.5  # [m] of detections from a track; [m] of detections around the centre of a vehicle
START = np.diag([4.0, 4.0, 400.0, 25.0])  # [m^2], [m^2/s^2]


class Kalman:
    """Constant velocity; `predict` and `update` change the object."""

    def __init__(self, z):
        self.mean, self.covariance = np.array([*z, 0.0, 0.0]), START

    def predict(self, dt):
        F, G = np.eye(4) + dt * np.eye(4, k=2), np.vstack([dt**2 / 2 * np.eye(2), dt * np.eye(2)])
        self.mean, self.covariance = F @ self.mean, F @ self.covariance @ F.T + 9.0 * G @ G.T

    def update(self, z, R):
        P = self.covariance
        K = P[:, :2] @ np.linalg.inv(P[:2, :2] + R)
        self.mean, P = self.mean + K @ (z - self.mean[:2]), P - K @ P[:2]
        self.covariance = (P + P.T) / 2


class Nearest:
    """Each detection goes to the nearest track; what is left over and close together begins a track."""

    def start(self) -> Tracks:
        self.filters, self.rows, self.next_id = [], np.zeros((0, 4)), 0  # rows: id, existence, hits, age of each track
        return self.tracks()

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        for f in self.filters:
            f.predict(dt)
        self.rows[:, 3] += dt
        before, owner = self.rows[:, 0].astype(int), np.full(len(scan.mask), -1)
        moving = np.flatnonzero(scan.mask & ~(np.abs(scan.ground_rate) < 1.0))  # guard rails stand still
        xy = scan.xy[moving]
        places = np.array([f.mean[:2] for f in self.filters]).reshape(-1, 2)
        d = np.linalg.norm(xy[:, None] - places, axis=-1)  # (M, T)
        near = np.where(d.min(1, initial=np.inf) < GATE, d.argmin(1) if len(places) else 0, -1)
        owner[moving] = np.where(near < 0, -1, np.append(before, -1)[near])
        count = np.bincount(near[near >= 0], minlength=len(before))
        for i in np.flatnonzero(count):
            self.filters[i].update(xy[near == i].mean(0), SPREAD**2 / count[i] * np.eye(2))
        p = self.rows[:, 1]
        self.rows[:, 1] = np.where(count > 0, 1 - 0.5 * (1 - p), 0.8 * p)
        self.rows[:, 2] += count > 0
        self.keep(self.rows[:, 1] > 0.05)
        self.begin(xy[near < 0])
        none = np.full(len(before), np.nan)
        return self.tracks(), StepInfo(owner, before, none, count >= 0, count, 0 * count, none, ())

    def keep(self, alive):
        self.filters, self.rows = [f for f, kept in zip(self.filters, alive, strict=True) if kept], self.rows[alive]

    def begin(self, xy):
        while len(xy):
            group = np.linalg.norm(xy - xy[0], axis=-1) < GATE
            if group.sum() >= 3:
                self.filters.append(Kalman(xy[group].mean(0)))
                self.rows = np.vstack([self.rows, [self.next_id, 0.3, 1.0, 0.0]])
                self.next_id += 1
            xy = xy[~group]

    def tracks(self) -> Tracks:
        m = np.array([f.mean for f in self.filters]).reshape(-1, 4)
        P = np.array([f.covariance for f in self.filters]).reshape(-1, 4, 4)
        fast = np.linalg.norm(m[:, 2:], axis=-1) > 1.0  # a heading from a velocity needs one
        heading = np.where(fast, np.arctan2(m[:, 3], m[:, 2]), 0.0)
        estimate = prior(np.column_stack([m[:, :2], heading]), m[:, 2:])._replace(cov=P)  # a car's size
        ids, existence, hits, age = self.rows.T.copy()
        return Tracks(ids.astype(int), existence, hits.astype(int), age, existence > 0.5, None, estimate, self.next_id)


if __name__ == "__main__":
    env = gym.make("testbed/cut-in-v0", tracker=Nearest(), also=["rm-koch"], out="runs")
    env.reset(seed=0)
    for _ in range(20):  # 5 decisions a second
        env.step(testbed.PLANNERS["idm"].act(env))
    for name, row in env.recorder.close()["trackers"].items():
        print(f"{name}: GOSPA {row['gospa']:.2f} m, position RMSE {row['rmse_position']:.2f} m")

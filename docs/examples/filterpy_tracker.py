"""A tracker of points over filterpy (pip install filterpy==2.0.0): each track is its `KalmanFilter`.

Plots of a scan go to the tracks so that the sum of the distances is least; plots in three scans on end confirm a track,
more than ten without one end it.

    testbed benchmark run v1 --tracker filterpy_tracker:Points --first 1    (in this folder)
"""

import gymnasium as gym
import numpy as np
from filterpy.kalman import KalmanFilter
from plots import Plot, as_tracks, inside, plots_of, smoothed, step_info
from scipy.optimize import linear_sum_assignment

import testbed
from trackers import Scan, StepInfo, Tracks

GATE = 16.3  # squared Mahalanobis distance of three dimensions, 99.9 %


class Track(KalmanFilter):
    """Constant velocity, x, y [m], vx, vy [m/s], with what a life needs."""

    def __init__(self, number: int, plot: Plot):
        super().__init__(dim_x=4, dim_z=3)
        self.x, self.P = np.array([*plot.z[:2], *plot.velocity]), plot.covariance
        self.number, self.size, self.hits, self.missed, self.age = number, plot.size, 1, 0, 0.0

    def distance(self, plot: Plot) -> float:
        e, S = plot.z - plot.H @ self.x, plot.H @ self.P @ plot.H.T + plot.R
        return float(e @ np.linalg.solve(S, e))


class Points:
    def __init__(self, accel_std: float = 2.0):
        self.accel_std = accel_std  # [m/s^2]

    def start(self) -> Tracks:
        self.tracks, self.next_id = [], 0
        return self.report()

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        F, G = np.eye(4) + dt * np.eye(4, k=2), np.vstack([dt**2 / 2 * np.eye(2), dt * np.eye(2)])
        for t in self.tracks:
            t.predict(F=F, Q=self.accel_std**2 * G @ G.T)
            t.age, t.missed = t.age + dt, t.missed + 1
        plots, number = plots_of(scan)
        ids, taken = np.array([t.number for t in self.tracks], int), np.full(len(self.tracks), -1)
        d = np.array([[t.distance(p) for p in plots] for t in self.tracks]).reshape(len(ids), len(plots))
        for i, k in zip(*linear_sum_assignment(np.minimum(d, GATE)), strict=True):
            if d[i, k] < GATE:
                t, taken[i] = self.tracks[i], k
                t.update(plots[k].z, R=plots[k].R, H=plots[k].H)
                t.size, t.hits, t.missed = smoothed(t.size, plots[k].size), t.hits + 1, 0
        self.tracks = [t for t in self.tracks if t.missed <= (10 if t.hits >= 3 else 0)]
        now = self.report()
        mean, size = np.hstack([now.estimate.pose[:, :2], now.estimate.velocity]), now.estimate.size
        for k, plot in enumerate(plots):
            if plot.begins and k not in taken and not inside(plot, mean, size):
                self.tracks.append(Track(self.next_id, plot))
                self.next_id += 1
        return self.report(), step_info(ids, taken, number)

    def report(self) -> Tracks:
        rows = [(t.number, 0.9 if t.hits >= 3 else 0.3, t.hits, t.age) for t in self.tracks]
        x, P, size = ([getattr(t, name) for t in self.tracks] for name in ("x", "P", "size"))
        return as_tracks(np.reshape(rows, (-1, 4)), np.reshape(x, (-1, 4)), np.reshape(P, (-1, 4, 4)),
                         np.reshape(size, (-1, 2)), self.next_id)  # fmt: skip


if __name__ == "__main__":
    env = gym.make("testbed/cut-in-v0", tracker=Points(), also=["rm-koch"], out="runs")
    env.reset(seed=0)
    for _ in range(20):  # 5 decisions a second
        env.step(testbed.PLANNERS["idm"].act(env))
    for name, row in env.recorder.close()["trackers"].items():
        print(f"{name}: GOSPA {row['gospa']:.2f} m, position RMSE {row['rmse_position']:.2f} m")

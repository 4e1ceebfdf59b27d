"""A tracker of points made of parts of Stone Soup (pip install stonesoup==1.9); plots of a scan are its detections.

Predictor, updater, global nearest neighbour, initiator and deleter are those of the library.

    testbed benchmark run v1 --tracker stonesoup_tracker:Soup --first 1    (in this folder)
"""

from datetime import datetime, timedelta

import gymnasium as gym
import numpy as np
from plots import as_tracks, inside, plots_of, smoothed, step_info
from stonesoup.base import Property
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.base import GaussianInitiator
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

import testbed
from trackers import Scan, StepInfo, Tracks

ORDER = [0, 2, 1, 3]  # states are x, vx, y, vy here, and x, y, vx, vy in the testbed


class PlotModel(LinearGaussian):
    """x, y and range rate of a plot."""

    H: np.ndarray = Property(doc="its matrix (3, 4)")

    def matrix(self, **_) -> np.ndarray:
        return self.H


class Near(DistanceHypothesiser):
    """Asks for the distances of near plots only: a scan of faults may have a hundred others."""

    def hypothesise(self, track, detections, timestamp, **more):
        x, y = np.asarray(track.state_vector, float).ravel()[[0, 2]]
        near = {d for d in detections if np.hypot(d.state_vector[0] - x, d.state_vector[1] - y) < 15.0}
        return super().hypothesise(track, near, timestamp, **more)


class FromPlot(GaussianInitiator):
    """Begins a track with the course that range rates say, where something moves."""

    def initiate(self, detections, timestamp, **_):
        moving = [(d, d.metadata["plot"]) for d in detections if d.metadata["plot"].begins]
        return {Track([GaussianStateUpdate(
            np.array([*p.z[:2], *p.velocity])[ORDER], p.covariance[np.ix_(ORDER, ORDER)],
            SingleHypothesis(None, d), timestamp=timestamp)]) for d, p in moving}  # fmt: skip


class Soup:
    def __init__(self, accel: float = 2.0):
        motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(accel)] * 2)  # [m^2/s^3]
        self.predictor, self.updater = KalmanPredictor(motion), KalmanUpdater(None)
        self.associator = GNNWith2DAssignment(Near(self.predictor, self.updater, Mahalanobis(), missed_distance=4.0))
        self.deleter = UpdateTimeStepsDeleter(10)

    def start(self) -> Tracks:
        first = UpdateTimeStepsDeleter(1)
        self.initiator = MultiMeasurementInitiator(
            None, first, self.associator, self.updater, min_points=3, initiator=FromPlot()
        )
        self.now, self.tracks, self.rows, self.next_id = datetime(2000, 1, 1), {}, {}, 0
        return self.report()

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        self.now += timedelta(seconds=dt)
        plots, number = plots_of(scan)
        seen = {
            Detection(
                p.z[:, None],
                timestamp=self.now,
                measurement_model=PlotModel(ndim_state=4, mapping=(0, 1, 2), noise_covar=p.R, H=p.H[:, ORDER]),
                metadata={"plot": p, "k": k},
            )
            for k, p in enumerate(plots)
        }
        ids, taken = np.array([*self.tracks], int), {}
        found = self.associator.associate({*self.tracks.values()}, seen, self.now)
        for i, track in self.tracks.items():
            hypothesis = found[track]
            track.append(self.updater.update(hypothesis) if hypothesis else hypothesis.prediction)
            row = self.rows[i]
            row["age"] += dt
            if hypothesis:
                about = hypothesis.measurement.metadata
                taken[i], row["hits"] = about["k"], row["hits"] + 1
                row["size"] = smoothed(row["size"], about["plot"].size)
        ended = self.deleter.delete_tracks({*self.tracks.values()}, timestamp=self.now)
        self.tracks = {i: t for i, t in self.tracks.items() if t not in ended}
        now = self.report().estimate
        mean, size = np.hstack([now.pose[:, :2], now.velocity]), now.size
        left = {d for d in seen if not (d.metadata["k"] in taken.values() or inside(d.metadata["plot"], mean, size))}
        for track in sorted(self.initiator.initiate(left, self.now), key=lambda t: tuple(t.state_vector.ravel())):
            self.tracks[self.next_id] = track
            self.rows[self.next_id] = {"size": track.metadata["plot"].size, "hits": 3, "age": 2 * dt}
            self.next_id += 1
        return self.report(), step_info(ids, np.array([taken.get(i, -1) for i in ids], int), number)

    def report(self) -> Tracks:
        kept = [(self.rows[i], t.state) for i, t in self.tracks.items()]
        rows = [(i, 0.9, self.rows[i]["hits"], self.rows[i]["age"]) for i in self.tracks]
        mean = [np.asarray(s.mean, float).ravel()[ORDER] for _, s in kept]
        cov = [np.asarray(s.covar, float)[np.ix_(ORDER, ORDER)] for _, s in kept]
        return as_tracks(np.reshape(rows, (-1, 4)), np.reshape(mean, (-1, 4)), np.reshape(cov, (-1, 4, 4)),
                         np.reshape([row["size"] for row, _ in kept], (-1, 2)), self.next_id)  # fmt: skip


if __name__ == "__main__":
    env = gym.make("testbed/cut-in-v0", tracker=Soup(), also=["rm-koch"], out="runs")
    env.reset(seed=0)
    for _ in range(20):  # 5 decisions a second
        env.step(testbed.PLANNERS["idm"].act(env))
    for name, row in env.recorder.close()["trackers"].items():
        print(f"{name}: GOSPA {row['gospa']:.2f} m, position RMSE {row['rmse_position']:.2f} m")

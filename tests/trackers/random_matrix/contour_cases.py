"""Static and moving objects whose detections are virtual ones, for the tests of the contour filters."""

import numpy as np

from trackers import Scan, prior
from trackers.random_matrix.rays import root_of

CAR = np.array([4.7, 1.8])
ORIGIN = np.zeros(2)


def static_case(aspect, f, start, distance=15.0, runs=None):
    """The state with start size, and noise-free virtual detections of a true car, as one scan."""
    centre = np.array([distance, 0.0])
    tilt = np.array(float(aspect))
    points, _ = f.virtual(ORIGIN, centre, root_of(CAR, tilt))
    state = f.init(prior((*centre, aspect), size=start))
    return state, Scan.from_xy(points)


def adapted(f, state, scan, times):
    for _ in range(times):
        state = f.adapt(state, scan)
    return state


def follow(f, steps=60, seed=0):
    """Mean centre error (2,) [m] along and across, and filter position error, of a car ahead driving away at 10 m/s."""
    rng = np.random.default_rng(seed)
    state = f.init(prior((20.0, 0.0, 0.0), velocity=(10.0, 0.0)))
    errors, positions = [], []
    for k in range(1, steps):
        centre = np.array([20.0 + k, 0.0])
        points, _ = f.virtual(ORIGIN, centre, root_of(CAR, np.array(0.0)))
        scan = Scan.from_xy(points[::3] + 0.1 * rng.standard_normal(points[::3].shape))
        state, _ = f.update(f.predict(state, 0.1), scan)
        errors.append(f.estimate(state).pose[:2] - centre)
        positions.append(state.koch.x[:2] - centre)
    return np.mean(errors[20:], 0), np.mean(positions[20:], 0)


def box_case(aspect, f, start, count=200):
    """A true box of a car's size at 15 m, seen by a fan of rays."""
    centre = np.array([15.0, 0.0])
    points, mask = f.virtual(ORIGIN, centre, root_of(CAR, np.array(float(aspect))))
    return f.init(prior((*centre, aspect), size=start)), Scan.from_xy(points, np.broadcast_to(mask, points.shape[:1]))

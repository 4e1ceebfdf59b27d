"""Detections of the sides of bodies that move and turn, and face the sensor; no simulator."""

import numpy as np

from trackers import Scan
from trackers.geometry import rotation

CAR = np.array([4.6, 1.86])


def seen_body(rng, centre, heading, velocity, yaw_rate, n, noise=0.1, rate_noise=0.0, size=CAR):
    """n detections on the lit sides of bodies at centre (..., 2), seen from the origin, with their range rates.

    heading, yaw_rate (...), velocity (..., 2) of the centre.
    """
    M = rotation(heading)
    sight = -(M.mT @ centre[..., None])[..., 0]  # from the centre to the sensor
    x, y = (rng.uniform(-0.5, 0.5, (*np.shape(heading), n)) for _ in range(2))
    lit = np.where(np.abs(sight) > size / 2, np.abs(sight), 0.0) * size[::-1]  # seen widths of end and side
    end = rng.random(x.shape) < (lit[..., 0] / lit.sum(-1))[..., None]
    toward = np.sign(sight)[..., None, :] / 2
    body = np.stack([np.where(end, toward[..., 0], x), np.where(end, y, toward[..., 1])], -1) * size
    lever = body @ M.mT
    z = centre[..., None, :] + lever
    turn = np.asarray(yaw_rate)[..., None, None] * np.stack([-lever[..., 1], lever[..., 0]], -1)
    xy = z + rng.normal(0, noise, z.shape)
    scan = Scan.from_xy(xy, noise=(noise, noise / 30, 0.1))
    polar = scan.polar.copy()
    polar[..., 2] = (scan.sight * (velocity[..., None, :] + turn)).sum(-1) + rng.normal(0, rate_noise, end.shape)
    return scan._replace(polar=polar)

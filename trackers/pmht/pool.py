"""The newest decoupled detections of an object, so many for each direction that it was seen from.

So a side that is out of view now keeps what was seen of it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.held_gaussian import LENGTH
from trackers.pmht.association import squares
from trackers.pmht.window import Decoupled

REACH = 0.8  # largest coordinate in the unit frame, where the box ends at 0.5; beyond, it is another object's


class Pool(NamedTuple):
    """B aspect bins with room for S detections each."""

    z: NDArray  # (..., B, S, 2) in the unit frame
    R: NDArray  # (..., B, S, 3)
    sensor: NDArray  # (..., B, S, 2) [m]
    came: NDArray  # (..., B) int, all that ever came into the bin

    @property
    def all(self) -> Decoupled:
        """All detections (T, D) of T objects, D <= B S."""
        T, B, S = self.z.shape[:-1]
        mask = np.arange(S) < self.came[..., None]
        used = mask.any(0).ravel()
        return Decoupled(*(a.reshape(T, B * S, *a.shape[3:])[:, used] for a in (*self[:3], mask)))


def empty(lead: tuple[int, ...], B: int, S: int) -> Pool:
    """Pools without a detection."""
    z, R, sensor = (np.zeros((*lead, B, S, k)) for k in (2, 3, 2))
    return Pool(z, R, sensor, np.zeros((*lead, B), int))


def added(pool: Pool, new: Decoupled) -> tuple[Pool, NDArray]:
    """The pools of T objects with more detections, and how many were added (T,)."""
    T, B, S = pool.z.shape[:-1]
    fit = new.mask & (np.abs(new.z) < REACH).all(-1)
    angle = np.arctan2(new.sensor[..., 1], new.sensor[..., 0])
    bin = np.round(angle / (2 * np.pi / B)).astype(int) % B  # bin 0 is ahead
    each = fit[..., None] & (bin[..., None] == np.arange(B))  # (T, D, B)
    rank = (each.cumsum(-2) * each).sum(-1) - 1
    t, d = np.nonzero(fit)
    slot = (pool.came[t, bin[t, d]] + rank[t, d]) % S
    z, R, sensor = pool.z.copy(), pool.R.copy(), pool.sensor.copy()
    for ring, row in ((z, new.z), (R, new.R), (sensor, new.sensor)):
        ring[t, bin[t, d], slot] = row[t, d]
    return Pool(z, R, sensor, pool.came + each.sum(-2)), fit.sum(-1)


def moved(pool: Pool, o: NDArray, before: NDArray, after: NDArray) -> Pool:
    """The pool in a frame moved by o (..., 2) [m] in body axes, for sizes before and after (..., 2) [m]."""
    shift = o[..., None, None, :]
    z = (pool.z * before[..., None, None, :] - shift) / after[..., None, None, :]
    R = pool.R * (squares(before) / squares(after)).mT[..., None, :, :]
    return pool._replace(z=z, R=R, sensor=pool.sensor - shift)


def ends_seen(pool: Pool, m: NDArray, least: int) -> NDArray:
    """Ends (..., 2, 2) of the body that `least` detections or more came from beyond: rear, front; right, left."""
    all_ = pool.all
    half = m[..., None, LENGTH:] / 2
    beyond = np.stack([all_.sensor < -half, all_.sensor > half], -1) & all_.mask[..., None, None]
    return beyond.sum(-3) >= least

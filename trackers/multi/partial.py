"""Partial occlusion: detections of a vehicle that others hide in part lie about the middle of what is seen of it.

Equations: docs/methods/multi-object-tracking.md, section 3.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.estimate import Estimate
from trackers.geometry import wrap_angle
from trackers.multi.association import SortedScan
from trackers.multi.visibility import NEARER, SensorArray, angular_spans, azimuth_std

PLACES = 16
STEPS = (np.arange(PLACES) + 0.5) / PLACES - 0.5  # places across a box, as shares of its span
LEAST_SEEN = 0.02  # share of a box, below which its detections are turned less and less
LEAST_STD = 1e-6  # [rad] of an edge


def as_if_whole(
    z: SortedScan, owner: NDArray, estimate: Estimate, occluder: NDArray, share: NDArray, sensors: SensorArray
) -> SortedScan:
    """The scan with detections of partly hidden tracks turned to where they would be, were these seen as a whole.

    owner (M,) is the row of each detection's track, -1 for none; estimate (T,) all tracks, occluder (T,) bool those
    that hide others, share (S, T) what of the rays on each track its sensors see.
    """
    own = np.flatnonzero(owner >= 0)
    own = own[share[z.sensor[own], owner[own]] < 1]
    if not len(own):
        return z
    pair, of_pair = np.unique(np.c_[z.sensor[own], owner[own]], axis=0, return_inverse=True)
    s, t = pair.T  # P pairs of sensor and track
    o = np.flatnonzero(occluder)
    poses = sensors.poses(z.scan.platform)
    low, high, nearest = angular_spans(estimate, poses)
    middle, half, std = (low + high) / 2, (high - low) / 2, azimuth_std(estimate, poses)
    place = 2 * half[s, t, None] * STEPS  # (P, K) [rad] from the middle
    to_edge = wrap_angle(middle[s[:, None], o] - middle[s, t, None])[:, None] - place[..., None]  # (P, K, O)
    of_edge = np.maximum(np.hypot(std[s, t, None], std[s[:, None], o]), LEAST_STD)[:, None]
    beside = half[s[:, None], o][:, None]
    behind = (nearest[s[:, None], o] + NEARER < nearest[s, t, None]) & (t[:, None] != o)
    hidden = behind[:, None] * (ndtr((to_edge + beside) / of_edge) - ndtr((to_edge - beside) / of_edge))
    seen = (1 - hidden).prod(-1)  # (MOT.60)
    shift = (place * seen).mean(-1) / np.maximum(seen.mean(-1), LEAST_SEEN)  # (MOT.61)
    of_pair, noise, polar = of_pair.ravel(), z.scan.noise[own, 1] ** 2, z.scan.polar.copy()
    blurred = noise / (half[s, t][of_pair] ** 2 / 3 + noise)  # (MOT.62)
    polar[own, 1] = wrap_angle(polar[own, 1] - blurred * shift[of_pair])  # (MOT.62)
    scan = z.scan._replace(polar=polar)
    sight = scan.sight
    return z._replace(scan=scan, sight=sight, xy=scan.points(sight), rate=scan.rates(sight))

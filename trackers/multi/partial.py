"""Partial occlusion: detections of a vehicle that others hide in part lie about the middle of what is seen of it.

Equations: docs/methods/multi-object-tracking.md, section 3.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.batch import take
from trackers.estimate import Estimate
from trackers.geometry import wrap_angle
from trackers.multi.association import SortedScan
from trackers.multi.visibility import SensorArray, angular_spans, azimuth_std
from trackers.shade import Shade

PLACES = 16
STEPS = (np.arange(PLACES) + 0.5) / PLACES - 0.5  # places across a box, as shares of its span
LEAST_SEEN = 0.02  # share of a box, below which its detections are turned less and less


def shade_of(estimate: Estimate, occluder: NDArray, sensors: SensorArray, platform: NDArray) -> Shade:
    """What hides others, of tracks (T,) those where occluder (T,) bool is true; platform (6,) is the odometry."""
    o, poses = np.flatnonzero(occluder), sensors.poses(platform)
    hiding = take(estimate, o)
    low, high, nearest = angular_spans(hiding, poses)
    return Shade(o, (low + high) / 2, (high - low) / 2, azimuth_std(hiding, poses), nearest)


def as_if_whole(
    z: SortedScan, owner: NDArray, estimate: Estimate, shade: Shade, share: NDArray, sensors: SensorArray
) -> SortedScan:
    """The scan with detections of partly hidden tracks turned to where they would be, were these seen as a whole.

    owner (M,) is the row of each detection's track, -1 for none; estimate (T,) all tracks, shade those that hide
    others, share (S, T) what of the rays on each track its sensors see.
    """
    own = np.flatnonzero(owner >= 0)
    own = own[share[z.sensor[own], owner[own]] < 1]
    if not len(own):
        return z
    pair, of_pair = np.unique(np.c_[z.sensor[own], owner[own]], axis=0, return_inverse=True)
    s, t = pair.T  # P pairs of sensor and track
    poses = sensors.poses(z.scan.platform)
    low, high, nearest = (a[s, t] for a in angular_spans(estimate, poses))
    half, std = (high - low) / 2, azimuth_std(estimate, poses)[s, t]
    place = 2 * half[:, None] * STEPS  # (P, K) [rad] from the middle
    seen = shade.seen(s, t, (low + high)[:, None] / 2 + place, nearest[:, None], std)  # (MOT.60)
    shift = (place * seen).mean(-1) / np.maximum(seen.mean(-1), LEAST_SEEN)  # (MOT.61)
    of_pair, noise, polar = of_pair.ravel(), z.scan.noise[own, 1] ** 2, z.scan.polar.copy()
    blurred = noise / (half[of_pair] ** 2 / 3 + noise)  # (MOT.62)
    polar[own, 1] = wrap_angle(polar[own, 1] - blurred * shift[of_pair])  # (MOT.62)
    scan = z.scan._replace(polar=polar)
    sight = scan.sight
    return z._replace(scan=scan, sight=sight, xy=scan.points(sight), rate=scan.rates(sight))

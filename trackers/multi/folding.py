"""Folded range rates: each is taken on the lap that fits a track, else what stands still, else the traffic.

Equations: docs/methods/multi-object-tracking.md, section 1. The rest of a step then knows nothing of folds.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import dot
from trackers.multi.association import Association
from trackers.multi.tracks import REPORT_ABOVE, Tracks
from trackers.multi.visibility import SensorArray
from trackers.range_rate import over_ground
from trackers.scan import Scan


def unfolded(scan: Scan, tracks: Tracks, association: Association, sensors: SensorArray, limit: NDArray) -> Scan:
    """The scan (M,) with each range rate on one lap of those that its sensor confuses.

    tracks (T,) are predicted; limit (S,) [m/s] are the range rates beyond which those of sensors fold, inf: none do.
    """
    M, box = len(scan.mask), tracks.estimate
    fold = limit[scan.sensor + np.zeros(M, int)]
    scan = on_lap(scan, fold, np.zeros(M))
    z, order = association.prepare(scan, sensors)
    if not len(order):
        return scan
    traffic, sure = z.scan.velocity, tracks.existence > REPORT_ABOVE
    if sure.any():
        away = ((z.xy[:, None] - box.pose[sure, :2]) ** 2).sum(-1)
        traffic = box.velocity[sure][away.argmin(1)]
    aim = np.zeros(M)
    aim[order] = np.where(z.static, 0.0, dot(z.sight, traffic))  # (MOT.51)
    if len(tracks.id):
        track, j, log_p = association.inside_gate(box, z)
        u, xy = z.sight[j], z.xy[j]
        ghat = over_ground(u, box.velocity[track], box.yaw_rate[track], xy - box.pose[track, :2])
        pairs = z._replace(xy=xy, sight=u, rate=z.rate[j] + laps(ghat - z.rate[j], fold[order[j]]))
        log_rate, near = association.inside_rate_gate(box, pairs, track, np.arange(len(j)))
        best = np.argsort(np.where(near, log_p + log_rate, -np.inf), kind="stable")
        best = best[near[best]]
        aim[order[j[best]]] = ghat[best]  # the best comes last, (MOT.51)
    return on_lap(scan, fold, aim)


def on_lap(scan: Scan, fold: NDArray, aim: NDArray) -> Scan:
    """The scan with each range rate on the lap on which that over ground is nearest to aim (M,) [m/s]."""
    polar = scan.polar.copy()
    polar[:, 2] += laps(aim - scan.ground_rate, fold)
    return scan._replace(polar=polar)


def laps(difference: NDArray, fold: NDArray) -> NDArray:
    """Whole laps (...) [m/s] of rates that fold at +- fold (...) [m/s], as near to a difference [m/s] as can be."""
    lap = 2 * np.where(np.isfinite(fold), fold, 1.0)
    return np.where(np.isfinite(fold), lap * np.rint(difference / lap), 0.0)  # (MOT.50)

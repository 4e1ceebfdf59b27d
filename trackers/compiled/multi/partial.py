"""Where detections of partly hidden tracks would be, were these seen whole; as `trackers.multi.partial`."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.linear import ndtr, wrap
from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.rules import Boxes, Detections, Rules
from trackers.compiled.multi.view import NEARER, azimuth_std, span

PLACES, LEAST_SEEN, LEAST_STD = 16, 0.02, 1e-6  # as in `trackers.multi.partial`
FAR = 9.0  # standard deviations from an edge where nothing of a box hides anything


@compiled
def turned(
    owner: NDArray, z: Detections, box: Boxes, occluder: NDArray, share: NDArray, platform: NDArray, p: Rules
) -> tuple[NDArray, NDArray]:
    """Lines of sight (M, 2) and rates over ground (M,) of the detections, those of partly hidden tracks turned."""
    sight, rate, sheets, S, T = z.sight.copy(), z.rate.copy(), p.sheets, len(p.sheets.fov), len(box.pose)
    shift, known, sensor = np.full((S, T), np.nan), np.zeros(S, np.bool_), np.empty(3)
    middle, half, nearest, std = np.empty((S, T)), np.empty((S, T)), np.empty((S, T)), np.empty((S, T))
    cos, sin = np.cos(box.pose[:, 2]), np.sin(box.pose[:, 2])
    c, n = math.cos(platform[2]), math.sin(platform[2])
    for i in range(len(owner)):
        t, s = owner[i], z.sensor[i]
        if t < 0 or share[s, t] >= 1:
            continue
        if not known[s]:
            known[s], x, y = True, sheets.mount[s, 0], sheets.mount[s, 1]
            sensor[0], sensor[1] = platform[0] + (c * x - n * y), platform[1] + (n * x + c * y)
            sensor[2] = platform[2] + sheets.mount[s, 2]
            for o in range(T):
                low, high, nearest[s, o] = span(box.pose[o], box.size[o], cos[o], sin[o], sensor)
                middle[s, o], half[s, o] = (low + high) / 2, (high - low) / 2
                std[s, o] = azimuth_std(box.pose[o], box.cov[o], sensor)
        if math.isnan(shift[s, t]):
            shift[s, t] = shift_of(t, occluder, middle[s], half[s], nearest[s], std[s])
        noise = z.noise[i, 1] ** 2
        blurred = noise / (half[s, t] ** 2 / 3 + noise)  # (MOT.62)
        bearing = wrap(z.polar[i, 1] - blurred * shift[s, t]) + z.pose[i, 2]  # (MOT.62)
        sight[i, 0], sight[i, 1] = math.cos(bearing), math.sin(bearing)
        rate[i] = z.polar[i, 2] + (sight[i, 0] * z.velocity[i, 0] + sight[i, 1] * z.velocity[i, 1])  # (MOT.2)
    return sight, rate


@compiled
def shift_of(t: int, occluder: NDArray, middle: NDArray, half: NDArray, nearest: NDArray, std: NDArray) -> float:
    """(MOT.60), (MOT.61) of one track for one sensor, to which all T boxes have these azimuths and distances (T,)."""
    moment = total = 0.0
    for k in range(PLACES):
        place, seen = 2 * half[t] * ((k + 0.5) / PLACES - 0.5), 1.0
        for o in range(len(middle)):
            if o == t or not occluder[o] or not nearest[o] + NEARER < nearest[t]:
                continue
            to_edge = wrap(middle[o] - middle[t]) - place
            of_edge = max(math.hypot(std[t], std[o]), LEAST_STD)
            if abs(to_edge) < half[o] + FAR * of_edge:
                seen *= 1 - (ndtr((to_edge + half[o]) / of_edge) - ndtr((to_edge - half[o]) / of_edge))
        moment, total = moment + place * seen, total + seen
    return moment / PLACES / max(total / PLACES, LEAST_SEEN)

"""Where detections of partly hidden tracks would be, were these seen whole; as `trackers.multi.partial`."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.linear import wrap
from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.rules import Boxes, Detections
from trackers.compiled.multi.view import azimuth_std, span, stand
from trackers.compiled.shade import hides
from trackers.shade import Shade

PLACES, LEAST_SEEN = 16, 0.02  # as in `trackers.multi.partial`


@compiled
def shade_of(box: Boxes, occluder: NDArray, platform: NDArray, mount: NDArray) -> Shade:
    """What hides others of the tracks box (T,), those of occluder (T,) bool, from sensors at mount (S, 3)."""
    row, S, sensor = np.flatnonzero(occluder), len(mount), np.empty(3)
    O = len(row)
    shade = Shade(row, np.empty((S, O)), np.empty((S, O)), np.empty((S, O)), np.empty((S, O)))
    for s in range(S):
        stand(mount[s], platform, sensor)
        for o in range(O):
            low, high, shade.nearest[s, o] = span_of(row[o], box, sensor)
            shade.middle[s, o], shade.half[s, o] = (low + high) / 2, (high - low) / 2
            shade.std[s, o] = azimuth_std(box.pose[row[o]], box.cov[row[o]], sensor)
    return shade


@compiled
def turned(
    owner: NDArray, z: Detections, box: Boxes, occluder: NDArray, share: NDArray, platform: NDArray, mount: NDArray
) -> tuple[NDArray, NDArray, Shade]:
    """Lines of sight (M, 2) and rates over ground (M,) of the detections, those of partly hidden tracks turned.

    box (T,) are the tracks, occluder (T,) bool those that hide others, share (S, T) what is seen of each by sensors,
    which are at mount (S, 3) on the platform (6,). The third is what hides others.
    """
    sight, rate, shade = z.sight.copy(), z.rate.copy(), shade_of(box, occluder, platform, mount)
    shift, half, sensor = np.full(share.shape, np.nan), np.empty(share.shape), np.empty(3)
    for i in range(len(owner)):
        t, s = owner[i], z.sensor[i]
        if t < 0 or share[s, t] >= 1:
            continue
        if math.isnan(shift[s, t]):
            stand(mount[s], platform, sensor)
            shift[s, t], half[s, t] = shift_of(t, s, box, shade, sensor)
        noise = z.noise[i, 1] ** 2
        blurred = noise / (half[s, t] ** 2 / 3 + noise)  # (MOT.62)
        bearing = wrap(z.polar[i, 1] - blurred * shift[s, t]) + z.pose[i, 2]  # (MOT.62)
        sight[i, 0], sight[i, 1] = math.cos(bearing), math.sin(bearing)
        rate[i] = z.polar[i, 2] + (sight[i, 0] * z.velocity[i, 0] + sight[i, 1] * z.velocity[i, 1])  # (MOT.2)
    return sight, rate, shade


@compiled
def shift_of(t: int, s: int, box: Boxes, shade: Shade, sensor: NDArray) -> tuple[float, float]:
    """(MOT.60), (MOT.61) of one track for the sensor s at (3,), and half the width [rad] of its box."""
    low, high, nearest = span_of(t, box, sensor)
    middle, half, std = (low + high) / 2, (high - low) / 2, azimuth_std(box.pose[t], box.cov[t], sensor)
    place, seen = 2 * half * ((np.arange(PLACES) + 0.5) / PLACES - 0.5), np.ones(PLACES)
    hides(shade, s, t, middle + place, np.full(PLACES, nearest), std, seen)
    return (place * seen).mean() / max(seen.mean(), LEAST_SEEN), half


@compiled
def span_of(t: int, box: Boxes, sensor: NDArray) -> tuple[float, float, float]:
    """The span of `view` of one box."""
    return span(box.pose[t], box.size[t], math.cos(box.pose[t, 2]), math.sin(box.pose[t, 2]), sensor)

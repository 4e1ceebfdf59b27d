"""Where detections of partly hidden tracks would be, were these seen whole; as `trackers.multi.partial`."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.linear import ndtr, wrap
from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.rules import Boxes, Detections
from trackers.compiled.multi.view import NEARER, azimuth_std, span, stand

PLACES, LEAST_SEEN, LEAST_STD = 16, 0.02, 1e-6  # as in `trackers.multi.partial`
FAR = 9.0  # standard deviations from an edge where nothing of a box hides anything


@compiled
def turned(
    owner: NDArray, z: Detections, box: Boxes, occluder: NDArray, share: NDArray, platform: NDArray, mount: NDArray
) -> tuple[NDArray, NDArray]:
    """Lines of sight (M, 2) and rates over ground (M,) of the detections, those of partly hidden tracks turned.

    box (T,) are the tracks, occluder (T,) bool those that hide others, share (S, T) what is seen of each by sensors,
    which are at mount (S, 3) on the platform (6,).
    """
    sight, rate = z.sight.copy(), z.rate.copy()
    shift, half, sensor = np.full(share.shape, np.nan), np.empty(share.shape), np.empty(3)
    for i in range(len(owner)):
        t, s = owner[i], z.sensor[i]
        if t < 0 or share[s, t] >= 1:
            continue
        if math.isnan(shift[s, t]):
            stand(mount[s], platform, sensor)
            shift[s, t], half[s, t] = shift_of(t, box, occluder, sensor)
        noise = z.noise[i, 1] ** 2
        blurred = noise / (half[s, t] ** 2 / 3 + noise)  # (MOT.62)
        bearing = wrap(z.polar[i, 1] - blurred * shift[s, t]) + z.pose[i, 2]  # (MOT.62)
        sight[i, 0], sight[i, 1] = math.cos(bearing), math.sin(bearing)
        rate[i] = z.polar[i, 2] + (sight[i, 0] * z.velocity[i, 0] + sight[i, 1] * z.velocity[i, 1])  # (MOT.2)
    return sight, rate


@compiled
def shift_of(t: int, box: Boxes, occluder: NDArray, sensor: NDArray) -> tuple[float, float]:
    """(MOT.60), (MOT.61) of one track for a sensor (3,), and half the width [rad] of its box."""
    low, high, nearest = span_of(t, box, sensor)
    middle, half, std = (low + high) / 2, (high - low) / 2, azimuth_std(box.pose[t], box.cov[t], sensor)
    place, seen = 2 * half * ((np.arange(PLACES) + 0.5) / PLACES - 0.5), np.ones(PLACES)
    for o in range(len(box.pose)):
        dx, dy = box.pose[o, 0] - sensor[0], box.pose[o, 1] - sensor[1]
        distance, radius = math.hypot(dx, dy), math.hypot(box.size[o, 0], box.size[o, 1]) / 2
        if o == t or not occluder[o] or distance - radius + NEARER > nearest:
            continue
        of_edge = max(math.hypot(std, azimuth_std(box.pose[o], box.cov[o], sensor)), LEAST_STD)
        wide = math.asin(radius / distance) if distance > radius else math.pi
        if abs(wrap(math.atan2(dy, dx) - sensor[2] - middle)) > half + wide + FAR * of_edge:
            continue
        other_low, other_high, other_nearest = span_of(o, box, sensor)
        if other_nearest + NEARER < nearest:
            to_other, beside = wrap((other_low + other_high) / 2 - middle), (other_high - other_low) / 2
            for k in range(PLACES):
                to_edge = to_other - place[k]
                seen[k] *= 1 - (ndtr((to_edge + beside) / of_edge) - ndtr((to_edge - beside) / of_edge))
    return (place * seen).mean() / max(seen.mean(), LEAST_SEEN), half


@compiled
def span_of(t: int, box: Boxes, sensor: NDArray) -> tuple[float, float, float]:
    """The span of `view` of one box."""
    return span(box.pose[t], box.size[t], math.cos(box.pose[t, 2]), math.sin(box.pose[t, 2]), sensor)

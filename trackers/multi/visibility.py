"""Visibility: which predicted tracks which radar should see, and how many detections to expect of them.

Rays are cast over the predicted boxes. Equations: docs/methods/multi-object-tracking.md, section 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import box_corners, compose, cross, dot, perpendicular, rotation, to_frame, unit, wrap_angle
from trackers.scan import SensorModel
from trackers.shade import NEARER

RAYS = 9
STEPS = (np.arange(RAYS) + 0.5) / RAYS  # places of the rays, as shares of the span of a box
MANY = 32  # pairs of sensor and track from which on rays are cast at the boxes in their direction only
SHADOW = 0.5  # [m] added to an occluder on every side: tracks of half hidden vehicles lie beside their vehicles
LEAST_END = 0.5  # share of the rays on front and rear below which the near end of a box is hidden


class SensorArray(NamedTuple):
    """The data sheets of S sensors as arrays."""

    mount: NDArray  # (S, 3)
    max_range: NDArray  # (S,) [m]
    fov: NDArray  # (S,) [rad]
    noise: NDArray  # (S, 3)
    clutter: NDArray  # (S,) false alarms a scan
    clutter_density: NDArray  # (S,) false alarms a scan per m^2 and m/s
    clutter_density_2d: NDArray  # (S,) the same integrated over the range rate, per m^2
    rates: NDArray  # (S, 3) count_at_15m, count_falloff, count_max
    patchy: NDArray  # (S,) bool, sides have stretches without detections

    def poses(self, platform: NDArray) -> NDArray:
        """World poses (S, 3) on a platform (6,)."""
        return compose(platform[:3], self.mount)

    def at(self, sensor: NDArray) -> "SensorArray":
        """Rows of the sensors (G,) int."""
        return SensorArray(*(field[sensor] for field in self))

    @classmethod
    def of(cls, sensors: tuple[SensorModel, ...]) -> "SensorArray":
        """Arrays of the data sheets."""
        area = np.array([s.fov * s.max_range**2 / 2 for s in sensors])
        clutter = np.maximum([s.clutter for s in sensors], 1e-3)  # never 0: the likelihood ratio is divided by it
        return cls(
            mount=np.array([s.mount for s in sensors], float),
            max_range=np.array([s.max_range for s in sensors], float),
            fov=np.array([s.fov for s in sensors], float),
            noise=np.array([(s.sigma_range, s.sigma_azimuth, s.sigma_rate) for s in sensors], float),
            clutter=clutter,
            clutter_density=clutter / (area * 2 * np.array([min(s.max_rate, s.fold_rate) for s in sensors])),  # (MOT.6)
            clutter_density_2d=clutter / area,  # (MOT.6) without the range rate
            rates=np.array([(s.count_at_15m, s.count_falloff, s.count_max) for s in sensors], float),
            patchy=np.array([s.profile.patchy for s in sensors], bool),
        )

    def expected_count(self, sensor: NDArray, distance: NDArray, outline: NDArray) -> NDArray:
        """Detections (...) expected of a visible outline (...) [m] at distance (...) [m] from the sensor (...) int."""
        at_15m, falloff, most = np.moveaxis(self.rates[sensor], -1, 0)
        count = at_15m * (15.0 / np.maximum(distance, 1.0)) ** falloff * np.sqrt(outline / 3.0)
        return np.minimum(count, most)  # (MOT.11) without its factors


class Visibility(NamedTuple):
    """What S sensors should see of T tracks."""

    expected: NDArray  # (S, T) detections, occlusion included
    in_view: NDArray  # (T,) bool, inside the field of view and range of some sensor
    share: NDArray  # (S, T) share of the rays on the box that no occluder stops
    complete: NDArray  # (T,) visible share of the span of the uncut box, by the sensor that sees most of it
    hidden: NDArray  # (T,) bool, no ray of any sensor, be it out or not, reaches the box
    end_hidden: NDArray  # (T,) bool, hardly a ray of any sensor reaches the end, front or rear, that faces it
    certain: NDArray  # (S, T) share of what is expected that is in view also where the place of the track is wrong


def ray_box(origin: NDArray, direction: NDArray, pose: NDArray, size: NDArray) -> NDArray:
    """Distance [m] at which rays enter boxes, inf for a miss; slab method.

    origin (G, 2), direction (G, K, 2), boxes pose (T, 3), size (T, 2); returns (G, K, T). A ray that starts inside
    a box enters it at 0.
    """
    o = to_frame(pose, origin)[:, :, None]  # (T, G, 1, 2) in box axes
    d = (direction.reshape(-1, 2) @ rotation(pose[:, 2])).reshape(len(pose), *direction.shape)
    return entered(o, d, (size / 2)[:, None, None]).transpose(1, 2, 0)


def ray_pairs(origin: NDArray, direction: NDArray, pose: NDArray, size: NDArray) -> NDArray:
    """The same (P, K) for P pairs of rays with origin (P, 2), direction (P, K, 2), and boxes pose (P, 3), size (P, 2).

    One product turns both, as products of a single row may differ from those of `ray_box` in the last digit.
    """
    rows = np.concatenate([direction, (origin - pose[:, :2])[:, None]], 1) @ rotation(pose[:, 2])
    return entered(rows[:, -1:], rows[:, :-1], (size / 2)[:, None])


def entered(o: NDArray, d: NDArray, half: NDArray) -> NDArray:
    """Distance (...) at which rays from o (..., 2) along d (..., 2) enter boxes, in whose axes these are; inf: miss."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - o) / d, (half - o) / d
    enter, leave = np.fmin(a, b), np.fmax(a, b)
    near, far = np.maximum(enter[..., 0], enter[..., 1]), np.minimum(leave[..., 0], leave[..., 1])
    return np.where((near <= far) & (far >= 0), np.maximum(near, 0.0), np.inf)


def predict_visibility(
    estimate: Estimate, occluder: NDArray, sensors: SensorArray, platform: NDArray, rate_factor: float = 0.8,
    edge_sigmas: float = 0.0,
) -> Visibility:  # fmt: skip
    """Expected detections of T tracks by S sensors.

    estimate (T,) predicted tracks, occluder (T,) bool those sure enough to hide others, platform (6,) the odometry.
    rate_factor scales the counts of the data sheets. What lies within edge_sigmas standard deviations of the azimuth of
    a track from the edge of a field of view is not certain.
    """
    S, T = len(sensors.max_range), len(estimate.yaw_rate)
    expected, share = np.zeros((S, T)), np.zeros((S, T))
    if T == 0:
        return Visibility(expected, np.zeros(0, bool), share, np.zeros(0), np.zeros(0, bool), np.zeros(0, bool), share)
    poses = sensors.poses(platform)
    low, high, nearest = angular_spans(estimate, poses)
    edge, uncut = sensors.fov[:, None] / 2, high - low
    low, high = np.maximum(low, -edge), np.minimum(high, edge)  # (MOT.8)
    unsure = np.where(edge < np.pi, edge_sigmas, 0.0) * azimuth_std(estimate, poses) if edge_sigmas else 0.0
    sure = np.minimum(high, edge - unsure) - np.maximum(low, unsure - edge)
    certain = np.sqrt(np.maximum(sure, 0.0) / np.maximum(high - low, 1e-9))  # (MOT.59)
    in_view = (high > low) & (nearest < sensors.max_range[:, None])
    s, t = np.nonzero(in_view)  # G pairs
    span = (high - low)[s, t]
    bearing = (poses[s, 2] + low[s, t])[:, None] + span[:, None] * STEPS  # (MOT.9)
    cast = first_hits if len(s) >= MANY else first_hits_of_few
    ray = unit(bearing)
    own, first = cast(poses[s], ray, t, estimate, np.flatnonzero(occluder))
    near = own < sensors.max_range[s, None]
    sees = (first > own - NEARER - SHADOW) & near  # (MOT.10)
    share[s, t] = sees.sum(-1) / RAYS
    at = poses[s, None, :2] + np.where(near, own, 0.0)[..., None] * ray
    x, y = np.moveaxis(np.abs(to_frame(estimate.pose[t], at)) / estimate.size[t, None], -1, 0)
    on_end = near & (x > y)
    ends, of_end = on_end.sum(-1), np.full((S, T), -1.0)  # share of the rays on ends; of a sensor without any: -1
    of_end[s, t] = np.where(ends > 0, (on_end & sees).sum(-1) / np.maximum(ends, 1), -1.0)
    most = of_end.max(0)
    end_hidden = (most >= 0) & (most < LEAST_END)  # (MOT.53)
    complete = (share * (high - low) / uncut).max(0)  # (MOT.12)
    visible = sees.any(-1)
    s, t = s[visible], t[visible]
    span, sees, own = span[visible], sees[visible], own[visible]
    distance = np.where(sees, own, np.inf).min(-1, initial=np.inf)
    rate = sensors.expected_count(s, distance, span * distance)  # the outline as a chord at that distance
    expected[s, t] = rate_factor * rate * np.minimum(1.0, 3 * share[s, t])  # (MOT.11)
    return Visibility(
        expected, np.asarray(in_view.any(axis=0)), share, complete, share.max(0) == 0, end_hidden, certain
    )


def first_hits_of_few(
    pose: NDArray, direction: NDArray, t: NDArray, estimate: Estimate, occluder: NDArray
) -> tuple[NDArray, NDArray]:
    """`first_hits` by casting all rays at all boxes."""
    own = ray_box(pose[:, :2], direction, estimate.pose, estimate.size)[np.arange(len(t)), :, t]
    return own, first_shadows(pose, direction, t, estimate, occluder)


def first_shadows(pose: NDArray, direction: NDArray, t: NDArray, estimate: Estimate, occluder: NDArray) -> NDArray:
    """The second of `first_hits` alone, (G, K) [m]."""
    shadow = ray_box(pose[:, :2], direction, estimate.pose[occluder], estimate.size[occluder] + 2 * SHADOW)  # (G, K, O)
    itself = t[:, None] == occluder
    return np.where(itself[:, None] | (shadow == 0), np.inf, shadow).min(-1, initial=np.inf)


def first_hits(
    pose: NDArray, direction: NDArray, t: NDArray, estimate: Estimate, occluder: NDArray
) -> tuple[NDArray, NDArray]:
    """Distances (G, K) [m] at which the rays of G pairs of sensor and track enter the track's box, and an occluder.

    pose (G, 3) of the sensor, direction (G, K, 2), t (G,) row of the track, occluder (O,) rows of those that hide. The
    second is inf for rays that only enter occluders behind the box, or none.
    """
    own = ray_pairs(pose[:, :2], direction, estimate.pose[t], estimate.size[t])
    size = estimate.size[occluder] + 2 * SHADOW
    g, o = np.nonzero(in_the_way(pose, direction, own, estimate.pose[occluder], size) & (t[:, None] != occluder))
    shadow = ray_pairs(pose[g, :2], direction[g], estimate.pose[occluder[o]], size[o])
    first = np.full(own.shape, np.inf)
    np.minimum.at(first, g, np.where(shadow == 0, np.inf, shadow))
    return own, first


def in_the_way(pose: NDArray, direction: NDArray, own: NDArray, boxes: NDArray, size: NDArray) -> NDArray:
    """Pairs (G, O) bool of which some ray (G, K, 2) may enter the circle around a box (O, 3) before own (G, K) [m]."""
    c = boxes[:, :2] - pose[:, None, :2]  # (G, O, 2)
    radius, distance = np.hypot(size[:, 0], size[:, 1]) / 2, np.hypot(c[..., 0], c[..., 1])
    middle = direction[:, direction.shape[1] // 2, None]  # (G, 1, 2)
    half = np.arccos(np.clip(dot(middle[:, 0], direction[:, 0]), -1.0, 1.0))[:, None]  # of the span of the rays
    away = np.abs(np.arctan2(cross(middle, c), dot(middle, c)))
    beside = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0))
    wide = (distance < 1.01 * radius) | (away < half + beside + 1e-6)
    return wide & (distance - radius < own.max(-1, keepdims=True) + 1e-6)


def azimuth_std(estimate: Estimate, poses: NDArray) -> NDArray:
    """Standard deviations (S, T) [rad] of the azimuths of T centres from sensors (S, 3)."""
    d = estimate.pose[:, :2] - poses[:, None, :2]
    n = perpendicular(d)
    var = dot(n, (estimate.cov[:, :2, :2] @ n[..., None])[..., 0])
    return np.asarray(np.sqrt(var) / np.maximum(dot(d, d), 1.0))


def angular_spans(estimate: Estimate, poses: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Lowest and highest azimuth (S, T) [rad] of T boxes in the frames of sensors (S, 3), for (MOT.8).

    The third array (S, T) [m] is the distance of the nearest corner.
    """
    corners = box_corners(estimate.pose, estimate.size)  # (T, 4, 2)
    d = corners - poses[:, None, None, :2]  # (S, T, 4, 2)
    c = estimate.pose[:, :2] - poses[:, None, :2]
    middle = np.arctan2(c[..., 1], c[..., 0])
    offset = wrap_angle(np.arctan2(d[..., 1], d[..., 0]) - middle[..., None])
    azimuth = wrap_angle(middle - poses[:, 2, None])
    return azimuth + offset.min(-1), azimuth + offset.max(-1), np.hypot(d[..., 0], d[..., 1]).min(-1)

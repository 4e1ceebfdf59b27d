"""Which predicted tracks which radar should see: rays over predicted boxes, card multi_object step 3."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import box_corners, compose, rotation, unit, wrap_angle
from trackers.scan import SensorModel

RAYS = 9
NEARER = 1.0  # [m] an occluder must be this much nearer on the same ray, or a duplicate protects its twin
SHADOW = 0.5  # [m] an occluder hides so much beyond its sides: half hidden tracks lie beside their vehicles


class SensorArray(NamedTuple):
    """The data sheets of S sensors as arrays."""

    mount: NDArray  # (S, 3)
    max_range: NDArray  # (S,) [m]
    fov: NDArray  # (S,) [rad]
    noise: NDArray  # (S, 3)
    clutter_density: NDArray  # (S,) false alarms a scan per m^2 and m/s
    clutter_density_2d: NDArray  # (S,) the same integrated over the range rate, per m^2
    rates: NDArray  # (S, 3) count_at_15m, count_falloff, count_max

    @classmethod
    def of(cls, sensors: tuple[SensorModel, ...]) -> "SensorArray":
        """Arrays of the data sheets."""
        area = np.array([s.fov * s.max_range**2 / 2 for s in sensors])
        clutter = np.maximum([s.clutter for s in sensors], 1e-3)  # a radar without false alarms still has surprises
        return cls(
            mount=np.array([s.mount for s in sensors], float),
            max_range=np.array([s.max_range for s in sensors], float),
            fov=np.array([s.fov for s in sensors], float),
            noise=np.array([(s.sigma_range, s.sigma_azimuth, s.sigma_rate) for s in sensors], float),
            clutter_density=clutter / (area * 2 * np.array([s.max_rate for s in sensors])),
            clutter_density_2d=clutter / area,
            rates=np.array([(s.count_at_15m, s.count_falloff, s.count_max) for s in sensors], float),
        )

    def expected_count(self, distance: NDArray, outline: NDArray) -> NDArray:
        """Detections (S, T) expected of an outline (S, T) [m] in sight at distance (S, T) [m]."""
        at_15m, falloff, most = (self.rates[:, i, None] for i in range(3))
        count = at_15m * (15.0 / np.maximum(distance, 1.0)) ** falloff * np.sqrt(outline / 3.0)
        return np.minimum(count, most)


class Visibility(NamedTuple):
    """What S sensors should see of T tracks."""

    expected: NDArray  # (S, T) detections, occlusion included
    in_view: NDArray  # (T,) bool, inside the field of view and range of some sensor
    share: NDArray  # (S, T) share of the rays on the box that no occluder stops


def ray_box(origin: NDArray, direction: NDArray, pose: NDArray, size: NDArray) -> NDArray:
    """Distance [m] at which rays enter boxes, inf for a miss; slab method.

    origin (G, 2), direction (G, K, 2), boxes pose (T, 3), size (T, 2); returns (G, K, T). A ray that starts inside
    a box enters it at 0.
    """
    M = rotation(pose[:, 2])
    o = np.einsum("gti,tij->gtj", origin[:, None] - pose[:, :2], M)[:, None]  # (G, 1, T, 2) in box axes
    d = np.einsum("gki,tij->gktj", direction, M)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-size / 2 - o) / d, (size / 2 - o) / d
    near, far = np.fmin(a, b).max(-1), np.fmax(a, b).min(-1)
    return np.where((near <= far) & (far >= 0), np.maximum(near, 0.0), np.inf)


def predict_visibility(
    estimate: Estimate, occluder: NDArray, sensors: SensorArray, platform: NDArray, trust: float = 0.8
) -> Visibility:
    """Expected detections of every track by every sensor.

    estimate (T,), occluder (T,) bool: tracks sure enough to hide others, platform (6,). `trust` scales the data
    sheet's rate (card: gs).
    """
    S, T = len(sensors.max_range), len(estimate.yaw_rate)
    expected, share, in_view = np.zeros((S, T)), np.zeros((S, T)), np.zeros((S, T), bool)
    if T == 0:
        return Visibility(expected, np.asarray(in_view.any(axis=0)), share)
    poses = compose(np.broadcast_to(platform[:3], (S, 3)), sensors.mount)
    low, high, nearest = angular_spans(estimate, poses)
    edge = sensors.fov[:, None] / 2
    low, high = np.maximum(low, -edge), np.minimum(high, edge)
    in_view[:] = (high > low) & (nearest < sensors.max_range[:, None])
    s, t = np.nonzero(in_view)
    step = (np.arange(RAYS) + 0.5) / RAYS
    bearing = poses[s, 2, None] + low[s, t, None] + (high - low)[s, t, None] * step
    rays = poses[s, :2], unit(bearing)
    own = ray_box(*rays, estimate.pose, estimate.size)[np.arange(len(s)), :, t]  # (G, K)
    shadow = ray_box(*rays, estimate.pose[occluder], estimate.size[occluder] + 2 * SHADOW)  # (G, K, O)
    itself = t[:, None] == np.flatnonzero(occluder)
    first = np.where(itself[:, None] | (shadow == 0), np.inf, shadow).min(-1, initial=np.inf)
    sees = np.isfinite(own) & (first > own - NEARER - SHADOW) & (own < sensors.max_range[s, None])
    share[s, t] = sees.mean(-1)
    distance = np.full((S, T), np.inf)
    distance[s, t] = np.where(sees, own, np.inf).min(-1)
    visible = share > 0
    outline = np.where(
        visible, (high - low) * np.where(visible, distance, 0.0), 0.0
    )  # what the sensor sees of it, as a chord
    rate = sensors.expected_count(np.where(visible, distance, 1e3), outline)
    expected = np.where(visible, trust * rate * np.minimum(1.0, 3 * share), 0.0)
    return Visibility(expected, np.asarray(in_view.any(axis=0)), share)


def angular_spans(estimate: Estimate, poses: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Lowest and highest azimuth (S, T) [rad] of boxes in the frames of sensors (S, 3), and corner distance (S, T)."""
    corners = box_corners(estimate.pose, estimate.size)  # (T, 4, 2)
    d = corners - poses[:, None, None, :2]  # (S, T, 4, 2)
    c = estimate.pose[:, :2] - poses[:, None, :2]
    middle = np.arctan2(c[..., 1], c[..., 0])
    offset = wrap_angle(np.arctan2(d[..., 1], d[..., 0]) - middle[..., None])
    azimuth = wrap_angle(middle - poses[:, 2, None])
    return azimuth + offset.min(-1), azimuth + offset.max(-1), np.hypot(d[..., 0], d[..., 1]).min(-1)

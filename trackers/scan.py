"""The input of every tracker: one scan of all radars of one vehicle, and the data sheets of those radars.

Equations: docs/methods/multi-object-tracking.md, section 1, and docs/methods/radar.md.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers.geometry import compose, point_velocity, rotation, unit


class Scan(NamedTuple):
    """M detections at one instant: all that a tracker may know. Padding (mask false) may hold anything, even NaN.

    Fields about the sensor of a detection have the axis M, or 1 where a single sensor made all detections.
    """

    polar: NDArray  # (..., M, 3) range [m], azimuth in the sensor frame [rad], range rate [m/s]; NaN: not measured
    mask: NDArray  # (..., M) true where there is a detection
    pose: NDArray  # (..., M or 1, 3) sensor x, y [m], heading [rad]
    velocity: NDArray  # (..., M or 1, 2) sensor velocity [m/s]
    noise: NDArray = np.full((1, 3), np.nan)  # (..., M or 1, 3) std of range, azimuth, range rate; NaN: unknown
    sensor: NDArray = np.zeros(1, int)  # (..., M or 1) which sensor of the rig
    platform: NDArray = np.zeros(6)  # (..., 6) the vehicle: x, y [m], heading [rad], vx, vy [m/s], yaw rate [rad/s]
    delivered: NDArray | None = None  # (S,) bool, sensors that made a scan, if only an empty one; None: not known

    @classmethod
    def from_xy(
        cls,
        xy: ArrayLike,
        mask: ArrayLike | None = None,
        pose: ArrayLike | None = None,
        noise: ArrayLike | None = None,
    ) -> "Scan":
        """Cartesian detections xy (..., M, 2) [m] of a resting sensor at pose (3,), without range rate.

        Trackers mask what is farther from the pose than a radar reaches: with map coordinates, give a pose nearby.
        """
        xy = np.asarray(xy, float)
        if xy.ndim < 2 or xy.shape[-1] != 2:
            raise ValueError(f"xy must be (..., M, 2), got {xy.shape}; one detection is xy[None]")
        mask = np.ones(xy.shape[:-1], bool) if mask is None else np.asarray(mask, bool)
        if mask.shape[-1:] != xy.shape[-2:-1]:
            raise ValueError(f"mask must be (..., M) with M = {xy.shape[-2]}, got {mask.shape}")
        pose = np.zeros((1, 3)) if pose is None else np.atleast_2d(np.asarray(pose, float))
        d = xy - pose[..., :2]
        azimuth = np.arctan2(d[..., 1], d[..., 0]) - pose[..., 2]
        polar = np.stack([np.hypot(d[..., 0], d[..., 1]), azimuth, np.full(azimuth.shape, np.nan)], -1)
        spread = np.full((1, 3), np.nan) if noise is None else np.atleast_2d(np.asarray(noise, float))
        return cls(polar, mask, pose, np.zeros((1, 2)), spread)

    @property
    def sight(self) -> NDArray:
        """Unit lines of sight (..., M, 2) in the tracking frame."""
        return unit(self.polar[..., 1] + self.pose[..., 2])

    @property
    def xy(self) -> NDArray:
        """Detections in the tracking frame, (..., M, 2) [m]."""
        return self.points(self.sight)

    @property
    def ground_rate(self) -> NDArray:
        """Range rate over ground (..., M) [m/s]: 0 for all that stands still, NaN where not measured."""
        return self.rates(self.sight)

    def points(self, sight: NDArray) -> NDArray:
        """`xy` from `sight`, for callers that need both."""
        return self.pose[..., :2] + self.polar[..., :1] * sight  # (MOT.1)

    def rates(self, sight: NDArray) -> NDArray:
        """`ground_rate` from `sight`, for callers that need both."""
        return self.polar[..., 2] + (sight * self.velocity).sum(-1)  # (MOT.2)

    def position_noise(self, default: float = np.nan) -> NDArray:
        """Covariance (..., M, 2, 2) [m^2] of each detection; `default` [m] where the noise is not known."""
        R = rotation(self.polar[..., 1] + self.pose[..., 2])
        r = self.polar[..., 0]
        along = np.broadcast_to(self.noise[..., 0], r.shape)
        across = r * self.noise[..., 1]
        std = np.stack([along, across], -1)
        std = np.where(np.isnan(std), default, std)
        return (R * std[..., None, :] ** 2) @ R.mT  # (MOT.3)


@dataclass(frozen=True)
class DepthProfile:
    """Where the detections of a sensor lie on a body, from the face that it sees inwards; the defaults are a radar's.

    Equations: docs/methods/size-from-both-ends.md, sections 2 and 3.
    """

    inside: float = 0.2  # nu, share of the detections that come from inside
    inside_depth: float = np.inf  # [m] their mean depth along the line of sight; inf: even over the body
    depth: float = 0.15  # [m] mean depth behind a face of the others
    depth_std: float = 0.105  # [m] and its spread
    grazing: float = 0.5  # 0: these spread over the projected outline; 1: over its true length
    surface_std: float = 0.1  # [m] roughness of the body, added to the noise
    weight: float = 0.5  # alpha, information of a detection: those of one scan are not independent
    rounding: tuple[float, float] = (0.0, 0.0)  # [m] by how much sooner than the body its sides end, along and across
    rounding_std: tuple[float, float] = (0.0, 0.0)  # [m]
    least_room: tuple[float, float] = (1.0, 0.3)  # [m] least visible part of length and width
    hides_within: float = 0.0  # [rad] a detection hides what is behind it, so far to either side; 0: it hides nothing
    hides_behind: float = 0.7  # [m] and so much further away
    patchy: bool = False  # sides have stretches without detections; else these lie all along what is seen of a side
    slant: float | None = None  # 1: `depth` lies along the line of sight, less behind a face seen aslant; 0: behind it;
    # None is replaced by 1, but by 0 for outlines, which hide, and where the inside has a depth along the line of sight

    def __post_init__(self) -> None:
        slant = self.slant
        if slant is None:
            slant = float(np.isinf(self.inside_depth) and self.hides_within == 0)
            object.__setattr__(self, "slant", slant)
        shares = (self.inside, self.grazing, self.weight, slant)
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError(f"inside, grazing, weight and slant must be within 0 and 1, got {shares}")
        lengths = (self.depth, self.depth_std, *self.rounding, *self.rounding_std, *self.least_room)
        if not (all(x >= 0 for x in lengths) and self.surface_std > 0 and self.inside_depth > 0):
            raise ValueError(
                "depth, depth_std, rounding, rounding_std and least_room must be at least 0, surface_std and "
                f"inside_depth positive, got {lengths}, {self.surface_std} and {self.inside_depth} m"
            )


@dataclass(frozen=True)
class SensorModel:
    """The data sheet of one mounted radar, which a tracker may know. Angles in rad, lengths in m."""

    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x, y, heading in the frame of the vehicle's centre
    max_range: float = 100.0  # [m]
    fov: float = np.pi  # [rad] full opening angle
    sigma_range: float = 0.15  # [m]
    sigma_azimuth: float = 0.01  # [rad]
    sigma_rate: float = 0.1  # [m/s]
    max_rate: float = 60.0  # [m/s] range rates of false alarms lie within +- this
    fold_rate: float = np.inf  # [m/s] range rates beyond +- this come back at the other end; inf: none do
    count_at_15m: float = 9.0  # expected detections of a 3 m wide visible outline at 15 m
    count_falloff: float = 0.85  # exponent of (15 m / range)
    count_max: float = 40.0  # expected detections of one object never exceed this
    clutter: float = 2.0  # expected false alarms a scan
    profile: DepthProfile = DepthProfile()  # where its detections lie on a body

    def poses(self, platform: NDArray) -> NDArray:
        """World pose (..., 3) of the sensor on platforms (..., 6)."""
        return compose(platform[..., :3], np.asarray(self.mount))

    def velocity(self, platform: NDArray) -> NDArray:
        """World velocity (..., 2) [m/s] of the sensor: platform velocity plus yaw rate times lever arm."""
        lever = (rotation(platform[..., 2]) @ np.asarray(self.mount[:2])[:, None])[..., 0]
        return point_velocity(platform[..., 3:5], platform[..., 5], lever)  # (RAD.1)

    def expected_count(self, distance: ArrayLike, outline: ArrayLike) -> NDArray:
        """Expected detections (...) of an object with `outline` [m] visible at `distance` [m]."""
        falloff = (15.0 / np.maximum(distance, 1.0)) ** self.count_falloff
        count = self.count_at_15m * falloff * np.sqrt(np.maximum(outline, 0.0) / 3.0)
        return np.minimum(count, self.count_max)  # (RAD.9), (RAD.10)

"""What a vehicle returns by the side that it shows: an option of a sensor, off unless it is given.

A direction (c, s) from a body, in its own frame, shows the shares (max(c, 0)^2, s^2, max(-c, 0)^2) of its front, flank
and rear, which sum to one. Equations: docs/methods/radar.md, section 10.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.illumination import Illuminated
from sensors.raycast import Edges
from sensors.scattering import Draws
from sensors.scene import Bodies, local_boxes
from trackers.geometry import rotation, to_frame, to_world, unit

Sides = tuple[float, float, float]  # of front, flank, rear
Parameters = Mapping[str, NDArray]  # fields of `Aspects` of S sensors, (S,) or (S, 3) each
HEIGHTS = {  # [m] of the body that a radar sees, usual for its class
    "car": 1.5, "van": 2.1, "bus": 3.1, "truck": 3.4, "tractor": 2.8, "articulated": 4.0, "motorcycle": 1.5,
}  # fmt: skip
CAR_HEIGHT = 1.5  # [m] for which counts are given
PLATE = 0.25  # [m] standard deviation of the middle of front and rear
LEAST_SHARE = 0.02  # of an object in view, for the power in `hidden`


@dataclass(frozen=True)
class Aspects:
    """Returns by side. The defaults change nothing but the counts, which have to be given.

    Raises:
        ValueError: a number that is negative, except `specular`; shares above one.
    """

    count_max: Sides  # of one object of the height of a car, in place of `Sensor.count_max`
    count_shape: Sides  # of the negative binomial, in place of `Sensor.count_shape`
    hidden: float = 0.0  # exponent of the visible share of an object: others hide more than rays say
    height: float = 0.0  # exponent of its height over that of a car
    specular: float = 0.0  # exponent of the cosine of incidence: smooth faces reflect where they look at the radar
    plate: float = 0.0  # added weight of the middle of front and rear: number plates, beams behind bumpers, grille
    under: Sides = (0.0, 0.0, 0.0)  # share of the returns that come from wheels and axles, on paths beneath the body
    fade: float = np.inf  # [m] range at which 1/e of the weak returns, under and inside the body, are left
    wheel_overhang: float = 0.8  # [m] from the ends of the body to its axles
    wheel_inset: float = 0.12  # [m] from its sides to the middle of its wheels
    wheel_spread: float = 0.2  # [m] standard deviation about them, each axis

    def __post_init__(self) -> None:
        for one in fields(self):
            value = np.asarray(getattr(self, one.name))
            if value.shape != ((3,) if one.type == Sides else ()):
                raise ValueError(f"aspects.{one.name} must be {one.type}, got {value.tolist()}")
            if np.isnan(value).any() or (one.name != "specular" and (value < 0).any()):
                raise ValueError(f"aspects.{one.name} must be at least 0, got {value.tolist()}")
        if max(self.under) > 1:
            raise ValueError(f"aspects.under must be within 0 and 1, got {self.under}; they are shares")
        if self.fade == 0:
            raise ValueError("aspects.fade must be positive, got 0; inf keeps all weak returns")

    @classmethod
    def alike(cls, count_max: float, count_shape: float) -> "Aspects":
        """Those of a sensor to which all sides are alike."""
        return cls((count_max,) * 3, (count_shape,) * 3)


class Boxes(NamedTuple):
    """Bounding boxes of B bodies, each in the frame of its reference point."""

    centre: NDArray  # (B, 2) [m]
    half: NDArray  # (B, 2) [m] half length, half width


def shares_of_sides(direction: NDArray) -> NDArray:
    """Shares (..., 3) of front, flank and rear in unit directions (..., 2) of the frame of a body."""
    c, s = direction[..., 0], direction[..., 1]
    return np.stack([np.maximum(c, 0.0) ** 2, s**2, np.maximum(-c, 0.0) ** 2], -1)  # (RAD.30)


def in_frame(heading: NDArray, vector: NDArray) -> NDArray:
    """Vectors (..., 2) of the world in frames with heading (...) [rad]."""
    return (rotation(heading).mT @ vector[..., None])[..., 0]


def shown(pose: NDArray, sensor: NDArray) -> NDArray:
    """Shares (..., 3) of its sides that a body at pose (..., 3) shows to a sensor at (..., 2) [m]."""
    d = sensor - pose[..., :2]
    return shares_of_sides(in_frame(pose[..., 2], d / np.maximum(np.hypot(d[..., 0], d[..., 1]), 1e-12)[..., None]))


def interpolated(value: NDArray, sides: NDArray) -> NDArray:
    """Values (S, N) from those of three sides (S, 3), for objects that show the shares (S, N, 3) of their sides."""
    part = np.zeros(sides.shape)
    np.multiply(value[:, None], sides, out=part, where=sides > 0)  # a value may be infinite
    return part.sum(-1)


def mean_counts(
    p: Parameters, uncapped: NDArray, share: NDArray, sides: NDArray, kinds: tuple[str, ...], detected: NDArray
) -> NDArray:
    """Expected detections (S, N) from those (S, N) without a limit, visible shares (S, N) and sides (S, N, 3).

    detected (S,) is the probability that an object returns anything.
    """
    height = np.array([HEIGHTS.get(kind, CAR_HEIGHT) for kind in kinds]) / CAR_HEIGHT
    limited = np.minimum(uncapped, interpolated(p["count_max"], sides) * detected[:, None])  # (RAD.31)
    hidden = np.maximum(share, LEAST_SHARE) ** p["hidden"][:, None]
    return limited * hidden * height ** p["height"][:, None]  # (RAD.32)


class Faces:
    """The bodies of one scene before S sensors with parameters `p`: what their faces and wheels return."""

    def __init__(self, p: Parameters, bodies: Bodies, edges: Edges) -> None:
        """Bounding boxes of the bodies, and which edges (E,) look across the body rather than along it."""
        self.p, self.bodies, self.edges = p, bodies, edges
        low, high = local_boxes(bodies)
        self.box = Boxes((low + high) / 2, (high - low) / 2)
        along = in_frame(bodies.pose[edges.body, 2], edges.b - edges.a)
        self.flank = np.abs(along[:, 0]) > np.abs(along[:, 1])

    def weights(self, elements: Illuminated, pose: NDArray) -> NDArray:
        """Factors (L,) of the weights of illuminated elements; pose (S, 3) of the sensors."""
        s, body = elements.sensor, self.edges.body[elements.segment]
        place = pose[s, :2] + elements.range[:, None] * unit(elements.bearing)
        off = to_frame(self.bodies.pose[body], place[:, None])[:, 0] - self.box.centre[body]
        middle = np.where(self.flank[elements.segment], 0.0, np.exp(-0.5 * (off[:, 1] / PLATE) ** 2))
        return elements.incidence ** self.p["specular"][s] * (1.0 + self.p["plate"][s] * middle)  # (RAD.33)

    def left(self, sensor: NDArray, distance: NDArray) -> NDArray:
        """Share (D,) of the weak returns that is left at distances (D,) [m]."""
        return np.exp(-distance / self.p["fade"][sensor])  # (RAD.34)

    def from_beneath(
        self, point: NDArray, sensor: NDArray, body: NDArray, place: NDArray, distance: NDArray,
        rng: Draws,
    ) -> tuple[NDArray, NDArray]:  # fmt: skip
        """Points (D, 2) [m] of which those in the mask (D,) moved to an axle; the sensor is at place (D, 2) [m]."""
        p, pose = self.p, self.bodies.pose[body]
        sides = shown(pose, place)
        share = (p["under"][sensor] * sides).sum(-1) * self.left(sensor, distance)  # (RAD.35)
        under = rng.random(len(point)) < share
        overhang, inset, spread = (p[f"wheel_{name}"][sensor] for name in ("overhang", "inset", "spread"))
        axles = axle_points(self.box, body, sides[:, 1], overhang, inset, spread, rng)
        return np.where(under[:, None], to_world(pose, axles[:, None])[:, 0], point), under


def axle_points(
    box: Boxes, row: NDArray, flank: NDArray, overhang: NDArray, inset: NDArray, spread: NDArray,
    rng: Draws,
) -> NDArray:  # fmt: skip
    """Points (D, 2) [m] about the axles of bodies `row` (D,), in the frame of the body.

    At a wheel with probability `flank` (D,), the share of the flank that is shown; otherwise anywhere on the axle.
    """
    n = len(row)
    wheel = rng.integers(4, size=n)
    front, left = np.where(wheel < 2, 1.0, -1.0), np.where(wheel % 2 == 0, 1.0, -1.0)
    across = np.where(rng.random(n) < flank, left, rng.uniform(-1.0, 1.0, n))
    reach = np.maximum(box.half[row] - np.stack([overhang, inset], -1), 0.0)
    return (
        box.centre[row] + np.stack([front, across], -1) * reach + spread[:, None] * rng.standard_normal((n, 2))
    )  # (RAD.36)

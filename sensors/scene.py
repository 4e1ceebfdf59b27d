"""The truth at one instant, as sensors take it.

An object is what a tracker should report once, a body one rigid outline: an articulated truck has two. The ego vehicle
carries the sensors and is not among the objects.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import box_corners, rotation


class Objects(NamedTuple):
    """N objects; the box is the bounding box of all bodies of the object."""

    id: NDArray  # (N,) int, stable over the run
    kind: tuple[str, ...]  # (N,) class: car, van, bus, truck, tractor, articulated, motorcycle
    pose: NDArray  # (N, 3) centre x, y [m], heading [rad]
    velocity: NDArray  # (N, 2) [m/s] of the centre, with slip
    yaw_rate: NDArray  # (N,) [rad/s]
    size: NDArray  # (N, 2) length, width [m]
    crashed: NDArray  # (N,) bool; the motion of crashed objects is not physical


class Bodies(NamedTuple):
    """B rigid outlines."""

    owner: NDArray  # (B,) int, row of `Objects`
    pose: NDArray  # (B, 3) reference point x, y [m], heading [rad]
    velocity: NDArray  # (B, 2) [m/s] of the reference point
    yaw_rate: NDArray  # (B,) [rad/s]
    outline: tuple[NDArray, ...]  # B times (C, 2) [m], world frame, counter-clockwise, not closed


class Ego(NamedTuple):
    """The vehicle that carries the sensors."""

    pose: NDArray  # (3,)
    velocity: NDArray  # (2,) [m/s], with slip
    yaw_rate: float  # [rad/s]
    size: NDArray  # (2,) [m]
    outline: NDArray  # (C, 2) [m] world frame
    crashed: bool = False
    on_road: bool = True  # whether the centre is on a lane

    @property
    def platform(self) -> NDArray:
        """x, y, heading, vx, vy, yaw rate, (6,): the odometry in `Scan.platform`."""
        return np.array([*self.pose, *self.velocity, self.yaw_rate])


class Scene(NamedTuple):
    """Everything at one instant."""

    time: float  # [s] from the frame counter
    dt: float  # [s] since the scene before
    ego: Ego
    objects: Objects
    bodies: Bodies
    walls: NDArray = np.zeros((0, 2, 2))  # (W, 2, 2) [m] guard rails: segments that reflect, stand, and hide no body


def local_boxes(bodies: Bodies) -> tuple[NDArray, NDArray]:
    """Least and greatest coordinates (B, 2) [m] of each outline along and across its body, from its reference point."""
    size = np.array([len(outline) for outline in bodies.outline], int)
    if not len(size):
        return np.zeros((0, 2)), np.zeros((0, 2))
    start, body = np.cumsum(size) - size, np.repeat(np.arange(len(size)), size)
    R, xy = rotation(bodies.pose[:, 2]), np.concatenate(bodies.outline)  # the heading of a body is turned once
    dx, dy = (xy[:, k] - bodies.pose[body, k] for k in (0, 1))
    cos, sin = R[body, 0, 0], R[body, 1, 0]
    local = np.stack([dx * cos + dy * sin, dy * cos - dx * sin], -1)
    return np.minimum.reduceat(local, start), np.maximum.reduceat(local, start)


def check_scene(scene: Scene) -> None:
    """Raise ValueError, in one sentence, for a scene that is not finite or whose bodies do not fit together."""
    bodies = scene.bodies
    outlines = np.concatenate(bodies.outline) if len(bodies.outline) else np.zeros((0, 2))
    arrays = {
        "ego.platform": scene.ego.platform,
        "bodies.pose": bodies.pose,
        "bodies.velocity": bodies.velocity,
        "bodies.yaw_rate": bodies.yaw_rate,
        "bodies.outline": outlines,
        "walls": scene.walls,
    }
    for name, value in arrays.items():
        bad = value.size - int(np.isfinite(value).sum())
        if bad:
            raise ValueError(
                f"scene.{name} has {bad} values that are not finite; take the object out or repair its state"
            )
    if not len(bodies.owner) == len(bodies.outline) == len(bodies.pose):
        raise ValueError(
            f"scene.bodies has {len(bodies.owner)} owners, {len(bodies.pose)} poses and {len(bodies.outline)} "
            "outlines; every body needs one of each"
        )


def boxes_scene(
    pose: NDArray,
    size: NDArray,
    velocity: NDArray | None = None,
    yaw_rate: NDArray | None = None,
    ego: Ego | None = None,
    time: float = 0.0,
    dt: float = 0.1,
) -> Scene:
    """A scene of plain boxes, pose (N, 3) and size (N, 2), seen by a resting ego at the origin unless given."""
    pose, size = np.atleast_2d(np.asarray(pose, float)), np.atleast_2d(np.asarray(size, float))
    n = len(pose)
    velocity = np.zeros((n, 2)) if velocity is None else np.atleast_2d(np.asarray(velocity, float))
    yaw_rate = np.zeros(n) if yaw_rate is None else np.atleast_1d(np.asarray(yaw_rate, float))
    if ego is None:
        car = np.array([4.7, 1.9])
        ego = Ego(np.zeros(3), np.zeros(2), 0.0, car, box_corners(np.zeros(3), car))
    objects = Objects(np.arange(n), ("car",) * n, pose, velocity, yaw_rate, size, np.zeros(n, bool))
    bodies = Bodies(np.arange(n), pose, velocity, yaw_rate, tuple(box_corners(pose, size)))
    return Scene(time, dt, ego, objects, bodies)

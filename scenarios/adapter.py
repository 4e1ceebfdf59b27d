"""The one place where highway-env becomes a Scene; it reads any highway-env environment, stock or ours."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from highway_env.vehicle.objects import Obstacle, RoadObject
from numpy.typing import NDArray

from scenarios.bodies import RigidPart, is_kind, parts
from scenarios.contours import find
from sensors.scene import Bodies, Ego, Objects, Scene
from trackers.geometry import point_velocity, rotation, to_frame, wrap_angle

ARTICULATED, OBSTACLE = "articulated", "obstacle"


class SceneReader:
    """Reads Scenes, and keeps the id of every object it has read; call `reset` with every reset of the environment.

    Ids count from 1 in the order in which objects are first read: `road.vehicles`, then `road.objects`.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all ids."""
        # The reference in the value keeps an object that left the road alive: its id() cannot be given again
        self._known: dict[int, tuple[RoadObject, int]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """The objects in the order of their ids: the `id()` of an object is another one after pickling."""
        return {**self.__dict__, "_known": [vehicle for vehicle, _ in self._known.values()]}

    def __setstate__(self, state: dict[str, Any]) -> None:
        known = {id(vehicle): (vehicle, number) for number, vehicle in enumerate(state["_known"], 1)}
        self.__dict__.update(state, _known=known)

    def read(self, env: Any) -> Scene:
        """The truth in an unwrapped environment now, at the time of the last frame that highway-env has counted.

        highway-env counts a frame after `road.step`; its own `env.time` counts policy steps and drifts.
        """
        dt = 1 / env.config["simulation_frequency"]
        seen = [v for v in env.road.vehicles if v is not env.vehicle]
        seen += [o for o in env.road.objects if isinstance(o, Obstacle) and o.solid]
        bodies = [parts(v) for v in seen]
        return Scene(
            time=env.steps / env.config["simulation_frequency"],
            dt=dt,
            ego=self._ego(env.vehicle),
            objects=(objects := self._objects(seen, bodies)),
            bodies=_bodies(bodies, objects),
            walls=_walls(env),
        )

    def number(self, vehicle: RoadObject) -> int:
        """The id of an object, a new one if it has none yet."""
        return self._known.setdefault(id(vehicle), (vehicle, len(self._known) + 1))[1]

    def _ego(self, vehicle: RoadObject) -> Ego:
        if len(bodies := parts(vehicle)) != 1:
            raise ValueError(f"the ego vehicle must be one rigid body, got {len(bodies)}; drive a car, bus or truck")
        body = bodies[0]
        pose = _wrapped(body.pose)
        outline = find(body.contour).place(pose, body.size)
        return Ego(pose, body.velocity, body.yaw_rate, body.size, outline, bool(vehicle.crashed), bool(vehicle.on_road))

    def _objects(self, seen: Sequence[RoadObject], bodies: Sequence[list[RigidPart]]) -> Objects:
        boxes = [_box(b) for b in bodies]
        return Objects(
            id=np.array([self.number(v) for v in seen], int),
            kind=tuple(_kind(v, b) for v, b in zip(seen, bodies, strict=True)),
            pose=_wrapped(np.array([b.pose for b in boxes]).reshape(-1, 3)),
            velocity=np.array([b.velocity for b in boxes]).reshape(-1, 2),
            yaw_rate=np.array([b.yaw_rate for b in boxes], float),
            size=np.array([b.size for b in boxes]).reshape(-1, 2),
            crashed=np.array([v.crashed for v in seen], bool),
        )


def bounding_box(bodies: Sequence[RigidPart]) -> RigidPart:
    """Bounding box of the outlines of several bodies, in the frame of the longest one, as a part with contour box.

    Its velocity is the derivative of its position as the hitch turns: that of the midpoint between the extreme
    vertices.
    """
    frame = max(bodies, key=lambda b: b.size[0])
    xy, rate = [], []
    for body in bodies:
        world = find(body.contour).place(body.pose, body.size)
        velocity = point_velocity(body.velocity, np.asarray(body.yaw_rate), world - body.pose[:2])
        carried = point_velocity(frame.velocity, np.asarray(frame.yaw_rate), world - frame.pose[:2])
        xy.append(to_frame(frame.pose, world))
        rate.append((velocity - carried) @ rotation(frame.pose[2]))
    (low, low_rate), (high, high_rate) = _extremes(np.concatenate(xy), np.concatenate(rate))
    R = rotation(frame.pose[2])
    lever = R @ ((low + high) / 2)
    velocity = point_velocity(frame.velocity, np.asarray(frame.yaw_rate), lever) + R @ ((low_rate + high_rate) / 2)
    pose = np.array([*(frame.pose[:2] + lever), frame.pose[2]])
    return RigidPart("box", pose, velocity, frame.yaw_rate, high - low)


def _extremes(xy: NDArray, rate: NDArray) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
    """Least and greatest coordinates (2,) of points (C, 2), and their rates; of equal points the least or greatest."""
    level = np.round(xy, 9)  # [m] bodies in line are equally wide up to rounding
    first = [np.lexsort((rate[:, k], level[:, k]))[[0, -1]] for k in range(2)]
    pick = np.stack(first, -1)  # (low | high, axis)
    axis = np.arange(2)
    return (xy[pick[0], axis], rate[pick[0], axis]), (xy[pick[1], axis], rate[pick[1], axis])


def _box(bodies: list[RigidPart]) -> RigidPart:
    return bodies[0] if len(bodies) == 1 else bounding_box(bodies)


def _kind(vehicle: RoadObject, bodies: list[RigidPart]) -> str:
    if is_kind(type(vehicle), Obstacle):
        return OBSTACLE
    return bodies[0].contour if len(bodies) == 1 else ARTICULATED


def _wrapped(pose: NDArray) -> NDArray:
    """The poses (..., 3) with headings in [-pi, pi)."""
    return np.concatenate([pose[..., :2], wrap_angle(pose[..., 2:])], -1)


def _bodies(parts: Sequence[list[RigidPart]], objects: Objects) -> Bodies:
    """The bodies of all objects; where each is one body, their motion is known."""
    owner = [k for k, bodies in enumerate(parts) for _ in bodies]
    flat = [b for bodies in parts for b in bodies]
    if len(flat) == len(parts) and all(map(len, parts)):
        pose, velocity, yaw_rate = objects.pose.copy(), objects.velocity.copy(), objects.yaw_rate.copy()
    else:
        pose = _wrapped(np.array([b.pose for b in flat]).reshape(-1, 3))
        velocity = np.array([b.velocity for b in flat]).reshape(-1, 2)
        yaw_rate = np.array([b.yaw_rate for b in flat], float)
    turned = rotation(pose[:, 2]).mT
    shapes = [_shape(b.contour, *b.size.tolist()) for b in flat]
    outline = tuple(p + shape @ R for p, shape, R in zip(pose[:, :2], shapes, turned, strict=True))
    return Bodies(
        owner=np.array(owner, int),
        pose=pose,
        velocity=velocity,
        yaw_rate=yaw_rate,
        outline=outline,
    )


@lru_cache(maxsize=1024)
def _shape(contour: str, length: float, width: float) -> NDArray:
    """Outline (C, 2) [m] about the centre of a body; the same in every frame, so it is worked out once."""
    shape = find(contour).fit(np.array([length, width]))
    shape.flags.writeable = False
    return shape


def _walls(env: Any) -> NDArray:
    """Guard rails (W, 2, 2) [m] of environments that have any."""
    walls = np.asarray(getattr(env, "walls", np.zeros((0, 2, 2))), float)
    if walls.ndim != 3 or walls.shape[1:] != (2, 2):
        raise ValueError(f"env.walls must be (W, 2, 2): W segments of two points; got {walls.shape}")
    return walls

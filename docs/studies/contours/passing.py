"""How contours are learned in passing: lone vehicles of each class, passed once in the next lane.

The ego comes from behind, passes on the left and leaves the vehicle behind, so that its rear, one side and its front
are seen; see `studies.contours.page`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

import sensors
from scenarios.contours import CONTOURS
from sensors.scene import Ego, Scene, boxes_scene
from testbed.evaluation.metrics import areas, region_iou
from testbed.learn.detections import lone_vehicle
from trackers import MultiObjectTracker, find
from trackers.geometry import box_corners, to_frame

KINDS = ("car", "tractor", "bus", "articulated")
ARTICULATED = np.array([16.5, 2.55])  # [m]
EGO_SIZE = np.array([4.7, 1.9])  # [m]


@dataclass(frozen=True)
class Passing:
    """One vehicle that is passed."""

    kind: str
    duration: float = 30.0  # [s]
    dt: float = 1 / 15  # [s]
    speed: float = 20.0  # [m/s] of the vehicle
    ahead: float = 15.0  # [m] of the vehicle at the start, and behind at the end
    lane: float = -4.0  # [m] to its lane
    radar: str = "surround"
    seed: int = 0

    @property
    def size(self) -> NDArray:
        """Length and width (2,) [m] of the vehicle."""
        return ARTICULATED if self.kind == "articulated" else CONTOURS[self.kind].size

    def scenes(self) -> Iterator[Scene]:
        """The truth in each frame."""
        closing = 2 * self.ahead / self.duration
        for k in range(round(self.duration / self.dt) + 1):
            t = k * self.dt
            place = np.array([(self.speed + closing) * t, 0.0, 0.0])
            velocity = np.array([self.speed + closing, 0.0])
            ego = Ego(place, velocity, 0.0, EGO_SIZE, box_corners(place, EGO_SIZE))
            pose = np.array([self.ahead + self.speed * t, self.lane, 0.0])
            own = np.array([self.speed, 0.0])
            scene = boxes_scene(pose, self.size, own, ego=ego, time=t, dt=self.dt)
            bodies = lone_vehicle(self.kind, pose, self.size).bodies
            bodies = bodies._replace(velocity=np.tile(own, (len(bodies.owner), 1)))
            yield scene._replace(bodies=bodies)


class PassedTrack(NamedTuple):
    """The track of the vehicle that is passed, in K frames."""

    time: NDArray  # (K,) [s]
    contour: NDArray  # (K, C, 2) [m] in the frame of the track; NaN without one
    iou: NDArray  # (K,) with the true outline, each in its own frame: of the shape alone
    length_error: NDArray  # (K,) [m]
    position_error: NDArray  # (K,) [m]
    probability: NDArray  # (K, classes)
    truth: tuple[NDArray, ...]  # outlines of the bodies (C, 2) [m] in the frame of the vehicle
    events: tuple[tuple[float, str], ...]  # time [s] and reason of each change of the contour


def follow(passing: Passing, tracker: str) -> PassedTrack:
    """Track one vehicle; the reported track nearest to it counts."""
    radar, rng = sensors.find(passing.radar), np.random.default_rng(passing.seed)
    filter = find(tracker)
    many = MultiObjectTracker(filter, radar.models)
    tracks, rows, events = many.start(), [], []
    names = len(getattr(filter, "classes", ()))
    for k, scene in enumerate(passing.scenes()):
        scan, _ = radar.scan(scene, rng)
        tracks, info = many.step(tracks, scan, passing.dt if k else 0.0)
        events += [(scene.time, event.reason) for event in info.events if event.contours is not None]
        pose, reported = scene.objects.pose[0], tracks.reported.estimate
        d = np.hypot(*(reported.pose[:, :2] - pose[:2]).T)
        if len(d) == 0 or d.min() > 5.0 or reported.contour is None:
            rows.append((np.full((48, 2), np.nan), np.nan, np.nan, np.nan, np.full(names, np.nan)))
            continue
        i = int(d.argmin())
        ring = to_frame(reported.pose[i], reported.contour[i])
        shape = shape_iou(ring, [to_frame(pose, outline) for outline in scene.bodies.outline])
        p = np.zeros(0) if reported.class_probability is None else reported.class_probability[i]
        rows.append((ring, shape, reported.size[i, 0] - passing.size[0], d[i], p))
    rings, shapes, lengths, positions, classes = (np.array(column) for column in zip(*rows, strict=True))
    truth = tuple(to_frame(scene.objects.pose[0], outline) for outline in scene.bodies.outline)
    return PassedTrack(
        np.arange(len(rows)) * passing.dt, rings, shapes, lengths, positions, classes, truth, tuple(events)
    )


def shape_iou(ring: NDArray, outlines: Sequence[NDArray]) -> float:
    """Intersection over union of a contour (C, 2) and a body of some outlines (C, 2), all in [m]."""
    body = shapely.union_all([shapely.Polygon(outline) for outline in outlines])
    return float(region_iou(areas(ring[None]), np.array([body]))[0])

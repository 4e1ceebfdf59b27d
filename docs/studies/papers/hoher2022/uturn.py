"""The experiment of hoher2022: a lidar at the origin, one object on a U-turn.

The report shows the two paths and the shapes in pictures; their numbers are ours. Heading turns from x towards y and
"left" is mathematical here, not as highway-env draws.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import shapely
from numpy.typing import NDArray

from sensors import Radar, cast
from sensors.origin import Origin
from sensors.raycast import outline_edges
from sensors.scene import Bodies, Scene, boxes_scene
from trackers.batch import stack
from trackers.geometry import to_world, unit
from trackers.scan import Scan

DT = 0.1  # [s]
LIDAR_PITCH = float(np.radians(1.0))  # [rad]
PER_DETECTION = ("polar", "mask", "pose", "velocity", "noise", "sensor")  # fields of a scan


@dataclass(frozen=True)
class UTurn:
    """Leg towards -x, half circle, leg back."""

    name: str
    start: tuple[float, float]  # [m]
    turn_x: float  # [m] where the half circle begins
    radius: float  # [m], positive to the left
    end_x: float  # [m]
    speed: float  # [m/s]

    def poses(self) -> NDArray:
        """Poses (K, 3) of a body that follows its course, every DT."""
        first = self.start[0] - self.turn_x
        arc = np.pi * abs(self.radius)
        length = first + arc + self.end_x - self.turn_x
        s = np.arange(0, length, self.speed * DT)
        turned = np.clip((s - first) / self.radius, *sorted((0.0, np.sign(self.radius) * np.pi)))
        heading = np.pi + turned
        centre = np.array([self.turn_x, self.start[1] - self.radius])
        on_arc = centre + abs(self.radius) * unit(np.sign(self.radius) * np.pi / 2 + turned)
        along = np.where(s < first, first - s, np.maximum(s - first - arc, 0.0))
        xy = on_arc + along[:, None] * np.array([1.0, 0.0])
        return np.column_stack([xy, heading])


FIRST = UTurn("first path", (25.0, 26.0), -8.0, 10.0, 25.0, 5.0)
SECOND = UTurn("second path", (30.0, -32.0), -12.0, -12.0, 30.0, 7.0)


def centred(outline: NDArray) -> NDArray:
    """The outline (C, 2) [m] with its area centroid at the origin."""
    return outline - np.asarray(shapely.Polygon(outline).centroid.coords)[0]


def rectangle(length: float, width: float) -> NDArray:
    """Corners (4, 2) [m], counter-clockwise."""
    return np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]


def tractor() -> NDArray:
    """Rear part 1.8 x 2.2 m, bonnet 2.7 x 1.0 m in front of it."""
    return centred(np.array([[4.5, 0.5], [1.8, 0.5], [1.8, 1.1], [0, 1.1], [0, -1.1], [1.8, -1.1], [1.8, -0.5],
                             [4.5, -0.5]]))  # fmt: skip


def l_shape() -> NDArray:
    """6.0 x 2.4 m with 3.6 x 1.2 m cut from the front right."""
    return centred(np.array([[6, 2.4], [0, 2.4], [0, 0], [2.4, 0], [2.4, 1.2], [6, 1.2]], float))


CAR = np.array([4.7, 1.8])  # [m]
SHAPES = MappingProxyType(
    {
        "rectangle": rectangle(*CAR),
        "ellipse": unit(np.linspace(0, 2 * np.pi, 90, endpoint=False)) * CAR / 2,
        "tractor": tractor(),
        "L": l_shape(),
    }
)


@dataclass(frozen=True)
class Truth:
    """K steps of one object."""

    poses: NDArray  # (K, 3) area centroid x, y [m], heading of the body [rad]
    outline: NDArray  # (C, 2) [m] in the frame of the body

    @property
    def size(self) -> NDArray:
        """Length and width (2,) [m] of the bounding box."""
        return np.ptp(self.outline, axis=0)

    @property
    def outlines(self) -> NDArray:
        """Outlines (K, C, 2) [m] in the world."""
        return to_world(self.poses, self.outline)


def truth(course: UTurn, shape: str, drift: float = 0.0) -> Truth:
    """The object on its course, its heading turned from the course by drift [rad]."""
    return Truth(course.poses() + np.array([0.0, 0.0, drift]), SHAPES[shape])


def lidar_hits(truth: Truth) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """Bearing [rad], range [m] and edge (n,) of the first hits of a ray each degree, at each of the K steps."""
    bearing = np.arange(round(2 * np.pi / LIDAR_PITCH)) * LIDAR_PITCH
    for outline in truth.outlines:
        edges = outline_edges((outline,))
        r, edge = cast(np.zeros(2), bearing, edges.a, edges.b)
        hit = edge >= 0
        yield bearing[hit], r[hit], edge[hit]


def lidar_scans(truth: Truth, sigma: float, runs: int, rng: np.random.Generator) -> list[Scan]:
    """K scans with leading axis `runs`: first hits of a ray each degree, Gaussian noise sigma [m] on x and y."""
    scans = []
    for bearing, r, _ in lidar_hits(truth):
        xy = r[:, None] * unit(bearing)
        scans.append(Scan.from_xy(xy + sigma * rng.standard_normal((runs, *xy.shape))))
    return scans


def scenes(truth: Truth) -> Iterator[Scene]:
    """The same object for a radar, with the motion that its range rates need."""
    centres = truth.poses[:, :2]
    velocity = np.gradient(centres, DT, axis=0)
    yaw_rate = np.gradient(np.unwrap(truth.poses[:, 2]), DT)
    for k, outline in enumerate(truth.outlines):
        box = boxes_scene(truth.poses[k], truth.size, velocity[k], yaw_rate[k : k + 1], time=k * DT, dt=DT)
        body = Bodies(np.zeros(1, int), truth.poses[k : k + 1], velocity[k : k + 1], yaw_rate[k : k + 1], (outline,))
        yield box._replace(bodies=body)


def radar_scans(truth: Truth, radar: Radar, runs: int, rng: np.random.Generator) -> list[Scan]:
    """K scans with leading axis `runs` by one of our radars, with the detections of the object only."""
    return [padded([own(*radar.scan(scene, rng)) for _ in range(runs)]) for scene in scenes(truth)]


def own(scan: Scan, origin: Origin) -> Scan:
    """The detections that an object made."""
    return scan._replace(mask=scan.mask & (origin.object >= 0))


def padded(scans: list[Scan]) -> Scan:
    """Scans of different lengths as one with a leading axis, shorter ones padded under the mask."""
    M = max(len(scan.mask) for scan in scans)

    def pad(a: NDArray) -> NDArray:
        return np.concatenate([a, np.zeros((M - len(a), *a.shape[1:]), a.dtype)])

    rows = [scan._replace(**{name: pad(getattr(scan, name)) for name in PER_DETECTION}) for scan in scans]
    return stack([row._replace(platform=scans[0].platform) for row in rows])

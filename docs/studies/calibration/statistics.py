"""Simulated against real radar detections of vehicles: where they lie and how many there are.

The real ones are the annotated vehicles of Meyer and Kuschk, "Automotive Radar Dataset for Deep Learning Based 3D
Object Detection", EuRAD 2019 (CC BY-NC-SA 4.0; the data stay outside this project). The simulated ones are the same
frames, vehicle by vehicle, before the radar at the origin; those of one frame hide each other. The real frame has y to
the left; it is mirrored into ours. Both are judged on detections with |u| < 1.2 and |v| < 1.2 in unit coordinates of
the box, u = 2 long / length, v = 2 lat / width.

A radar is fitted on one half of the frames and judged on the other: blocks of ten frames, by turns. Neighbouring frames
show the same vehicles, so intervals come from a bootstrap over blocks. Page: docs/calibration.md.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.contours import CONTOURS
from sensors.radar import Radar
from sensors.scene import Scene, boxes_scene
from testbed.learn.archive import read_extract_arrays
from trackers.geometry import compose, to_frame, wrap_angle

EXTRACT = "astyx_hires2019_extract"  # folder of the real detections, in a folder `data` beside the project
DATA = next(Path(__file__).resolve().parents[4].glob(f"*/data/{EXTRACT}"), Path("data") / EXTRACT)
BANDS = ((0.0, 15.0), (15.0, 30.0), (30.0, 50.0), (50.0, 80.0), (80.0, 120.0))  # [m] range of the centre
ASPECTS = ("front", "diagonal front", "side", "diagonal rear", "rear")  # of the vehicle, turned to the radar
ASPECT_LIMITS = np.radians([22.5, 67.5, 112.5, 157.5])
KINDS = {  # class of the real extract -> contour; other classes are left out
    "Car": "car", "Truck": "truck", "Bus": "bus", "Trailer": "trailer", "Towed Object": "trailer",
    "Other Vehicle": "van", "Motorcyclist": "motorcycle",
}  # fmt: skip
TALL = 1.9  # [m] height from which what is annotated as a car is a van
SHORT = 0.19  # [m] by which annotated boxes end before the fronts, fitted: no path is shorter than the direct one
GROWN = 1.2  # times the box: detections within it belong to the vehicle
NEAR, FAR = 0.2, 0.4  # [m] bands about the outline
BLOCK = 10  # frames

NAMES = ("facing", "near", "far", "deep", "outside", "u", "v", "median", "mean", "std")


class Vehicles(NamedTuple):
    """N vehicles before a radar at the origin and their M detections; a detection in two boxes is listed twice."""

    pose: NDArray  # (N, 3) centre x, y [m], heading [rad]
    size: NDArray  # (N, 2) length, width [m]
    kind: NDArray  # (N,) str, a contour
    frame: NDArray  # (N,) int, the radar frame
    xy: NDArray  # (M, 2) [m] detections
    row: NDArray  # (M,) int, the vehicle

    @property
    def range(self) -> NDArray:
        """Distance (N,) [m] of the centres."""
        return np.hypot(self.pose[:, 0], self.pose[:, 1])

    @property
    def aspect(self) -> NDArray:
        """Index (N,) into ASPECTS: the side of the vehicle that faces the radar."""
        bearing = wrap_angle(np.arctan2(-self.pose[:, 1], -self.pose[:, 0]) - self.pose[:, 2])
        return np.searchsorted(ASPECT_LIMITS, np.abs(bearing))

    @property
    def block(self) -> NDArray:
        """Block (N,) of frames; those with an odd number are held out."""
        return self.frame // BLOCK

    def part(self, chosen: NDArray) -> "Vehicles":
        """The chosen (N,) vehicles and their detections."""
        keep = chosen[self.row]
        new = np.cumsum(chosen) - 1
        pose, size, kind, frame = (column[chosen] for column in self[:4])
        return Vehicles(pose, size, kind, frame, self.xy[keep], new[self.row[keep]])


def read_real(data: Path | None = None) -> Vehicles:
    """The real vehicles in our frame: y mirrored; raises ValueError, in one sentence, where none can be read."""
    extract = read_extract_arrays(DATA if data is None else Path(data), ["Car"])
    objects = extract.objects
    named = np.array([KINDS.get(name, "") for name in extract.classes])
    kind = named[objects["class"].astype(int)]
    kind[(kind == "car") & (objects["height"] > TALL)] = "van"
    pose = np.stack([objects["cx"], -objects["cy"], -objects["yaw"]], -1)
    size = np.stack([objects["length"], objects["width"]], -1)
    frame = objects["frame"].astype(int)
    return Vehicles(pose, size, kind, frame, extract.points * [1.0, -1.0], extract.row).part(kind != "")


def halves(vehicles: Vehicles) -> tuple[Vehicles, Vehicles]:
    """Those to fit on, and those held out."""
    held_out = vehicles.block % 2 == 1
    return vehicles.part(~held_out), vehicles.part(held_out)


def frame_scene(pose: NDArray, size: NDArray, kind: NDArray) -> Scene:
    """A scene of the N vehicles of one frame, poses (N, 3) and sizes (N, 2), in the outlines of the catalogue."""
    scene = boxes_scene(pose, size)
    outlines = tuple(CONTOURS[k].place(p, s) for p, s, k in zip(pose, size, kind, strict=True))
    objects = scene.objects._replace(kind=tuple(map(str, kind)))
    return scene._replace(objects=objects, bodies=scene.bodies._replace(outline=outlines))


def simulate(radar: Radar, real: Vehicles, rng: np.random.Generator, repeat: int = 1) -> Vehicles:
    """The same frames before the first sensor of a rig at the origin, each scanned `repeat` times, without clutter.

    Fronts lie `SHORT` before those of the annotated boxes; what belongs to a vehicle is decided by the annotated box.
    """
    sensor = replace(radar.sensors[0], mount=(0.0, 0.0, 0.0), clutter=0.0, roadside=None)
    alone = replace(radar, sensors=(sensor,))
    pose = compose(real.pose, np.array([SHORT / 2, 0.0, 0.0]))
    size = real.size + np.array([SHORT, 0.0])
    points, rows = [np.zeros((0, 2))], [np.zeros(0, int)]
    for frame in np.unique(real.frame):
        member = np.flatnonzero(real.frame == frame)
        scene = frame_scene(pose[member], size[member], real.kind[member])
        for k in range(repeat):
            xy = alone.scan(scene, rng)[0].xy
            e = to_frame(real.pose[member], xy)  # (n, M, 2)
            row, detection = np.nonzero((np.abs(e) < GROWN * real.size[member, None] / 2).all(-1))
            points.append(xy[detection])
            rows.append(member[row] + k * len(real.pose))
    pose, size, kind, frames = (np.concatenate([column] * repeat) for column in real[:4])
    return Vehicles(pose, size, kind, frames, np.concatenate(points), np.concatenate(rows))


def sums(vehicles: Vehicles) -> NDArray:
    """Detections of each vehicle (N, 8) in its grown box: how many, of them with each property, and u^2, v^2.

    The properties are those of `statistics`.
    """
    pose = vehicles.pose[vehicles.row]
    half = vehicles.size[vehicles.row] / 2
    e = to_frame(pose, vehicles.xy[:, None])[:, 0]
    own = (np.abs(e) < GROWN * half).all(-1)
    inside = (half - np.abs(e)).min(-1)
    beyond = np.linalg.norm(np.maximum(np.abs(e) - half, 0.0), axis=-1)
    distance = np.where(inside >= 0, inside, beyond)
    facing = ((vehicles.xy - pose[:, :2]) * pose[:, :2]).sum(-1) < 0
    shares = (own, facing, distance < NEAR, distance < FAR, inside > FAR, inside < 0)
    columns = np.column_stack([*shares, (e / half) ** 2]) * own[:, None]
    return np.stack([np.bincount(vehicles.row, column, len(vehicles.pose)) for column in columns.T], -1)


def statistics(table: NDArray) -> NDArray:
    """Where detections lie and how many there are (10,), in the order of NAMES, from the sums (N, 8) of N vehicles.

    facing: on the half towards the radar; near, far: within 0.2 and 0.4 m of the box outline; deep: more than 0.4 m
    inside; outside: of the box; u, v: root mean square unit coordinates; median, mean, std: detections a vehicle.
    Without a detection they are NaN.
    """
    total = table.sum(0)
    if total[0] == 0:
        return np.full(len(NAMES), np.nan)
    shares = total[1:] / total[0]
    count = table[:, 0]
    return np.concatenate([shares[:5], np.sqrt(shares[5:]), [np.median(count), count.mean(), count.std()]])


def groups(vehicles: Vehicles) -> dict[str, NDArray]:
    """The vehicles (N,) of every row of the tables: cars in all, by range, by aspect; then the other kinds."""
    car = vehicles.kind == "car"
    rows = {"all": car}
    rows |= {f"{low:.0f}-{high:.0f} m": car & (vehicles.range >= low) & (vehicles.range < high) for low, high in BANDS}
    rows |= {name: car & (vehicles.aspect == k) for k, name in enumerate(ASPECTS)}
    return rows | {kind: vehicles.kind == kind for kind in ("van", "truck", "bus", "motorcycle")}

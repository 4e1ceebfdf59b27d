"""Detections to learn spatial models from: our radar on lone vehicles, the real extract, a file of one's own.

Everything is brought to unit coordinates u = 2 long / length, 2 lat / width in the frame of the vehicle, with the
aspect angle of Xia et al. (2020), eq. (11): 0 where the sensor sees the rear, +-pi where it sees the front.

A data source is written `DATA` or `DATA:CLASS`, with CLASS car (the default) or truck; DATA is

- `sampler:RIG`, lone vehicles of many sizes at all aspects and ranges before each radar of the rig;
- a folder with `objects.npz` of the extract of Meyer and Kuschk, "Automotive Radar Dataset for Deep Learning Based 3D
  Object Detection", EuRAD 2019 (CC BY-NC-SA 4.0; the data stay outside this project);
- an `.npz` file in the layout of docs/learning.md;
- the review log (`.rrd`) of a run at level full.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import sensors
from scenarios.contours import CONTOURS
from sensors.radar import Radar
from sensors.scene import Bodies, Scene, boxes_scene
from testbed.learn.archive import check_unit_coordinates, detection_arrays, read_extract_arrays
from testbed.limits import MOST_DETECTIONS, check_seeds, check_whole
from testbed.log.detections import read_detections
from testbed.log.review import readable
from trackers.geometry import compose, rotation, to_frame, to_world, unit
from trackers.htg.bins import aspect_angle
from trackers.scan import Scan

Progress = Callable[[int, int, str], None]  # done, of so many, doing what

KINDS = ("car", "truck")
GROWN = 1.2  # times the box: real detections within it belong to the vehicle, as in Xia et al. (2020)
FARTHEST = 80.0  # [m] of the training sampler; beyond, noise across exceeds a vehicle's width
NEAREST = 3.0  # [m] between sensor and the circle about a vehicle
WITHIN = 0.9  # share of the field of view that centres are drawn from


class TrainingDetections(NamedTuple):
    """N detections of vehicles whose boxes are known."""

    u: NDArray  # (N, 2) unit coordinates
    aspect: NDArray  # (N,) [rad] at which its sensor sees the vehicle
    noise: NDArray | None  # (N, 2, 2) known sensor noise in unit coordinates; None: not known
    scan: NDArray  # (N,) int, the scan it belongs to; detections of one scan are not independent
    source: str  # where they come from, one line
    size: NDArray | None = None  # (N, 2) [m] length and width of the vehicle of each; None: not known


@dataclass(frozen=True)
class Make:
    """Vehicles of one outline in the training sampler."""

    contour: str  # of scenarios.CONTOURS, or articulated
    length: tuple[float, float]  # [m]
    width: tuple[float, float]  # [m]
    share: float  # of the vehicles of its class


MAKES: dict[str, tuple[Make, ...]] = {
    "car": (Make("car", (3.6, 5.3), (1.65, 2.05), 0.85), Make("van", (4.8, 6.5), (1.85, 2.1), 0.15)),
    "truck": (
        Make("truck", (6.5, 11.0), (2.25, 2.6), 0.4),
        Make("bus", (9.0, 15.0), (2.4, 2.6), 0.2),
        Make("articulated", (12.0, 18.0), (2.4, 2.6), 0.4),
    ),
}
LABELS = {"car": ("Car",), "truck": ("Truck", "Bus")}  # classes of the real extract
TRUE_KINDS = {"car": ("car", "van"), "truck": ("truck", "bus", "articulated")}  # classes of our scenes
TRACTOR_SHARE, COUPLED = 6.0 / 16.5, 13.6 / 16.5  # lengths of tractor unit and trailer in an articulated truck


def check_source(data: str, count: int, seed: int) -> None:
    """Raise ValueError for what is no name of data, or numbers that the sampler cannot take."""
    if not isinstance(data, str) or not data:
        raise ValueError(f"data must be sampler:RIG or the name of a file or folder, got {data!r}")
    check_whole("count", count, 1, MOST_DETECTIONS)
    check_seeds(seed)


def read(
    data: str, count: int = 60000, seed: int = 0, progress: Progress = lambda done, total, what: None
) -> TrainingDetections:
    """The detections that a data source stands for; `count` and `seed` are those of the sampler."""
    name, kind = split_kind(data)
    if name.startswith("sampler:"):
        radar = sensors.find(name.removeprefix("sampler:"))
        return sample(radar, kind, count, np.random.default_rng(seed), progress)
    path = Path(name)
    if path.is_dir():
        return read_extract(path, kind)
    if not path.is_file():
        raise ValueError(
            f"data: there is no {name}; give sampler:RIG, a folder with objects.npz, an .npz or an .rrd, "
            f"each with :{' or :'.join(KINDS)} behind it if wanted"
        )
    if path.suffix == ".npz":
        return read_npz(path, kind)
    if path.suffix == ".rrd":
        return read_recording(path, kind)
    raise ValueError(f"data: {name} is neither an .npz nor an .rrd; see `testbed learn-htg --help` for what is read")


def split_kind(data: str) -> tuple[str, str]:
    """Data source and class of `DATA:CLASS`; without a class it is car."""
    head, colon, tail = data.rpartition(":")
    return (head, tail) if colon and tail in KINDS else (data, KINDS[0])


def without_folders(data: str) -> str:
    """A data source by the name of its file or folder alone: provenance names no place of one machine."""
    return data if data.startswith("sampler:") else Path(data).name


def unit_coordinates(xy: NDArray, pose: NDArray, size: NDArray) -> NDArray:
    """Unit coordinates (N, 2) of world points xy (N, 2) [m] in boxes with pose (N, 3) and size (N, 2)."""
    return 2 * to_frame(pose, xy[:, None])[:, 0] / size


def unit_noise(R: NDArray, heading: NDArray, size: NDArray) -> NDArray:
    """Covariances (N, 2, 2) in unit coordinates, from R (N, 2, 2) [m^2] in the world."""
    A = rotation(heading) * (2 / size)[:, None, :]
    return A.mT @ R @ A


# -- our radar --------------------------------------------------------------------------------------------------------


def sample(
    radar: Radar,
    kind: str,
    count: int,
    rng: np.random.Generator,
    progress: Progress = lambda done, total, what: None,
    table: dict[str, tuple[Make, ...]] = MAKES,
) -> TrainingDetections:
    """`count` detections or more of lone vehicles of the makes in `table`, each scan by one of the radars at random."""
    parts, got, scans = [], 0, 0
    what = f"{radar.name} on {kind}s"
    for detections in lone_vehicle_scans(radar, kind, rng, table):
        if len(detections.u):
            parts.append(detections._replace(scan=np.full(len(detections.u), scans)))
        got, scans = got + len(detections.u), scans + 1
        if scans % 50 == 0 or got >= count:
            progress(min(got, count), count, what)
        if got >= count:
            break
        if scans == 200 and got == 0:
            raise ValueError(f"radar {radar.name} did not detect a single {kind} in 200 scans; it cannot be learned")
    u, aspect, noise, index, size = (np.concatenate(column) for column in zip(*((*p[:4], p.size) for p in parts)))
    source = f"training sampler: {radar.name}, {kind}s, {scans} scans, ranges up to {FARTHEST:g} m"
    return TrainingDetections(u, aspect, noise, index, source, size)


def lone_vehicle_scans(
    radar: Radar, kind: str, rng: np.random.Generator, table: dict[str, tuple[Make, ...]] = MAKES
) -> Iterator[TrainingDetections]:
    """Scans of lone vehicles, one vehicle each, without end; false alarms are left out."""
    alone = [replace(radar, sensors=(replace(sensor, mount=(0.0, 0.0, 0.0), clutter=0.0),)) for sensor in radar.sensors]
    makes = table[kind]
    while True:
        one = alone[rng.integers(len(alone))]
        make = makes[rng.choice(len(makes), p=[make.share for make in makes])]
        size = np.array([rng.uniform(*make.length), rng.uniform(*make.width)])
        sensor = one.models[0]
        near = NEAREST + size[0] / 2
        r = rng.uniform(near, max(near, min(FARTHEST, sensor.max_range)))
        bearing = rng.uniform(-0.5, 0.5) * WITHIN * sensor.fov
        aspect = rng.uniform(-np.pi, np.pi)
        pose = np.array([*(r * unit(bearing)), bearing + aspect])
        scan, origin = one.scan(lone_vehicle(make.contour, pose, size), rng)
        own = origin.object == 0
        n = int(own.sum())
        heading, sizes = np.full(n, pose[2]), np.tile(size, (n, 1))
        yield TrainingDetections(
            unit_coordinates(scan.xy[own], np.tile(pose, (n, 1)), sizes),
            np.full(n, aspect),
            unit_noise(scan.position_noise()[own], heading, sizes),
            np.zeros(n, int),
            "",
            sizes,
        )


def lone_vehicle(contour: str, pose: NDArray, size: NDArray) -> Scene:
    """A resting vehicle at pose (3,) with size (2,) [m], alone before a sensor at the origin."""
    scene = boxes_scene(pose, size)
    if contour != "articulated":
        return scene._replace(bodies=scene.bodies._replace(outline=(CONTOURS[contour].place(pose, size),)))
    length = size[0] * np.array([TRACTOR_SHARE, COUPLED])
    middle = np.array([size[0] - length[0], length[1] - size[0]]) / 2
    centre = to_world(pose, np.stack([middle, np.zeros(2)], -1))
    poses = np.column_stack([centre, np.full(2, pose[2])])
    outline = tuple(
        CONTOURS[name].place(p, np.array([l, size[1]]))
        for name, p, l in zip(("tractor-unit", "trailer"), poses, length, strict=True)
    )
    bodies = Bodies(np.zeros(2, int), poses, np.zeros((2, 2)), np.zeros(2), outline)
    return scene._replace(bodies=bodies)


# -- files ------------------------------------------------------------------------------------------------------------


def read_extract(folder: Path, kind: str) -> TrainingDetections:
    """Real detections within 1.2 times the box of annotated vehicles; y mirrored into our frame, noise unknown."""
    extract = read_extract_arrays(folder, LABELS[kind])
    objects, row = extract.objects, extract.row
    pose = np.stack([objects["cx"], -objects["cy"], -objects["yaw"]], -1)
    size = np.stack([objects["length"], objects["width"]], -1)
    u = unit_coordinates(extract.points * [1.0, -1.0], pose[row], size[row])
    wanted = extract.of_class(LABELS[kind])
    keep = wanted[row] & (np.abs(u) < GROWN).all(-1)
    aspect = aspect_angle(pose[:, :2], pose[:, 2], np.zeros(2))[row]
    labels = " and ".join(LABELS[kind])
    source = f"Astyx HiRes2019, {labels}, {int(wanted.sum())} boxes grown {GROWN:g} times; CC BY-NC-SA 4.0"
    return TrainingDetections(
        u[keep], aspect[keep], None, objects["frame"][row[keep]].astype(int), source, size[row[keep]]
    )


def read_npz(file: Path, kind: str) -> TrainingDetections:
    """Detections from an .npz file in the layout of docs/learning.md, never unpickled.

    Raises ValueError, in one sentence, for a file that is in no such layout.
    """
    arrays = detection_arrays(file)
    source = file.name
    if "kind" in arrays:
        known = arrays["kind"].astype(str)
        keep = np.isin(known, TRUE_KINDS[kind])
        if not keep.any():
            raise ValueError(
                f"data: {file} has no detection of a {kind} ({', '.join(TRUE_KINDS[kind])}), "
                f"only of {', '.join(np.unique(known)) or 'nothing'}"
            )
        arrays, source = {name: value[keep] for name, value in arrays.items()}, f"{source}, {kind}s"
    got = _from_arrays(arrays, source)
    check_unit_coordinates(got.u, got.aspect, file)
    return got


def _from_arrays(arrays: dict[str, NDArray], source: str) -> TrainingDetections:
    noise = arrays.get("noise")
    if "u" in arrays:
        u, aspect = arrays["u"].astype(float), arrays["aspect"].astype(float)
    else:
        pose, size = arrays["pose"].astype(float), arrays["size"].astype(float)
        u = unit_coordinates(arrays["xy"].astype(float), pose, size)
        aspect = aspect_angle(pose[:, :2], pose[:, 2], arrays["sensor"].astype(float))
        noise = None if noise is None else unit_noise(noise, pose[:, 2], size)
    return TrainingDetections(u, aspect, noise, arrays.get("look", np.arange(len(u))), source, arrays.get("size"))


def read_recording(file: Path, kind: str) -> TrainingDetections:
    """True detections of the vehicles in a review log; the noise is that of the rig that was recorded."""
    readable(file)
    got = read_detections(file)
    models = sensors.find(got.radar).models
    mounts = np.array([model.mount for model in models])
    sigmas = np.array([(model.sigma_range, model.sigma_azimuth, model.sigma_rate) for model in models])
    keep = np.isin(got.kind, TRUE_KINDS[kind])
    sensor, pose, size, xy = (column[keep] for column in (got.sensor, got.pose, got.size, got.xy))
    if len(sensor) and not (sensor.min() >= 0 and sensor.max() < len(models)):
        raise ValueError(f"data: {file} has detections of a sensor that the radar {got.radar} does not have")
    place = compose(got.platform[keep], mounts[sensor])
    noise = Scan.from_xy(xy, pose=place, noise=sigmas[sensor]).position_noise()
    aspect = aspect_angle(pose[:, :2], pose[:, 2], place[:, :2])
    source = f"recording {file.name}, {kind}s"
    return TrainingDetections(
        unit_coordinates(xy, pose, size), aspect, unit_noise(noise, pose[:, 2], size), got.step[keep], source, size
    )

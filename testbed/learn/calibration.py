"""Simulated against real radar detections of cars: where they lie and how many there are.

The real ones are the annotated cars of Meyer and Kuschk, "Automotive Radar Dataset for Deep Learning Based 3D Object
Detection", EuRAD 2019 (CC BY-NC-SA 4.0; the data stay outside this project). The simulated ones are the same cars,
pose by pose, alone before the radar at the origin. The real frame has y to the left; it is mirrored into ours. Both are
judged on detections with |u| < 1.2 and |v| < 1.2 in unit coordinates of the box, u = 2 long / length,
v = 2 lat / width.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table

import sensors
from scenarios.contours import CONTOURS
from sensors.radar import Radar
from sensors.scene import Scene, boxes_scene
from testbed.learn.archive import read_extract_arrays
from trackers.geometry import to_frame, wrap_angle

EXTRACT = "astyx_hires2019_extract"  # folder of the real detections, in a folder `data` beside the project
DATA = next(Path(__file__).resolve().parents[3].glob(f"*/data/{EXTRACT}"), Path("data") / EXTRACT)
BANDS = ((0.0, 15.0), (15.0, 30.0), (30.0, 50.0), (50.0, 80.0), (80.0, 120.0))  # [m] range of the centre
ASPECTS = ("front", "diagonal front", "side", "diagonal rear", "rear")  # of the car, turned to the radar
ASPECT_LIMITS = np.radians([22.5, 67.5, 112.5, 157.5])
GROWN = 1.2  # times the box: detections within it belong to the car
NEAR, FAR = 0.2, 0.4  # [m] bands about the outline
SEED = 0

NAMES = ("facing", "near", "far", "deep", "outside", "u", "v", "median", "mean", "std")
TITLES = (
    "facing half",
    "< 0.2 m",
    "< 0.4 m",
    "> 0.4 m inside",
    "outside box",
    "rms u",
    "rms v",
    "median",
    "mean",
    "std",
)


class Cars(NamedTuple):
    """N cars before a radar at the origin and their M detections."""

    pose: NDArray  # (N, 3) centre x, y [m], heading [rad]
    size: NDArray  # (N, 2) length, width [m]
    xy: NDArray  # (M, 2) [m] detections
    car: NDArray  # (M,) int, row of the car

    @property
    def range(self) -> NDArray:
        """Distance (N,) [m] of the centres."""
        return np.hypot(self.pose[:, 0], self.pose[:, 1])

    @property
    def aspect(self) -> NDArray:
        """Index (N,) into ASPECTS: the side of the car that faces the radar."""
        bearing = wrap_angle(np.arctan2(-self.pose[:, 1], -self.pose[:, 0]) - self.pose[:, 2])
        return np.searchsorted(ASPECT_LIMITS, np.abs(bearing))


def read_real(data: Path | None = None) -> Cars:
    """The real cars in our frame: y mirrored; raises ValueError, in one sentence, where there are none to be read."""
    extract = read_extract_arrays(DATA if data is None else Path(data), ["Car"])
    objects, row, wanted = extract.objects, extract.row, extract.of_class(["Car"])
    pose = np.stack([objects["cx"], -objects["cy"], -objects["yaw"]], -1)[wanted]
    size = np.stack([objects["length"], objects["width"]], -1)[wanted]
    keep = wanted[row]
    return Cars(pose, size, extract.points[keep] * [1.0, -1.0], (np.cumsum(wanted) - 1)[row[keep]])


def lone_car(pose: NDArray, size: NDArray) -> Scene:
    """A scene of one car at pose (3,) with size (2,), in the outline of the catalogue."""
    scene = boxes_scene(pose, size)
    return scene._replace(bodies=scene.bodies._replace(outline=(CONTOURS["car"].place(pose, size),)))


def simulate(radar: Radar, real: Cars, rng: np.random.Generator, every: int = 1) -> Cars:
    """The same cars before the first sensor of a rig at the origin; one car of each `every` cars."""
    sensor = replace(radar.sensors[0], mount=(0.0, 0.0, 0.0), clutter=0.0)
    alone = replace(radar, sensors=(sensor,))
    pose, size = real.pose[::every], real.size[::every]
    scans = [alone.scan(lone_car(p, s), rng)[0].xy for p, s in zip(pose, size, strict=True)]
    return Cars(pose, size, np.concatenate(scans), np.repeat(np.arange(len(scans)), [len(xy) for xy in scans]))


def statistics(cars: Cars, chosen: NDArray) -> dict[str, float]:
    """Shares that say where the detections of the chosen (N,) cars lie, and their numbers a car.

    facing: on the half towards the radar; near, far: within 0.2 and 0.4 m of the box outline; deep: more than 0.4 m
    inside; outside: of the box; u, v: root mean square unit coordinates; median, mean, std: detections a car.
    """
    e = to_frame(cars.pose[cars.car], cars.xy[:, None])[:, 0]
    half = cars.size[cars.car] / 2
    own = (np.abs(e) < GROWN * half).all(-1)
    use = own & chosen[cars.car]
    inside = (half - np.abs(e)).min(-1)
    beyond = np.linalg.norm(np.maximum(np.abs(e) - half, 0.0), axis=-1)
    distance = np.where(inside >= 0, inside, beyond)
    centre = cars.pose[cars.car, :2]
    facing = ((cars.xy - centre) * centre).sum(-1) < 0
    count = np.bincount(cars.car[own], minlength=len(cars.pose))[chosen]
    columns = (facing, distance < NEAR, distance < FAR, inside > FAR, inside < 0)
    shares = [float(column[use].mean()) if use.any() else np.nan for column in columns]
    spread = np.sqrt(((e / half)[use] ** 2).mean(0)) if use.any() else np.full(2, np.nan)
    amount = (np.median(count), count.mean(), count.std()) if len(count) else (np.nan,) * 3
    return dict(zip(NAMES, (*shares, *map(float, spread), *map(float, amount)), strict=True))


def groups(cars: Cars) -> dict[str, NDArray]:
    """The cars (N,) of every row of the tables: all, by range, by aspect."""
    rows = {"all": np.ones(len(cars.pose), bool)}
    rows |= {f"{low:.0f}-{high:.0f} m": (cars.range >= low) & (cars.range < high) for low, high in BANDS}
    return rows | {name: cars.aspect == k for k, name in enumerate(ASPECTS)}


def report(data: Path | None = None, radar: str = "imaging", every: int = 1) -> list[Table]:
    """Two tables, by range and by aspect, real / simulated in every cell; each fits 80 columns."""
    real = read_real(data)
    simulated = simulate(sensors.find(radar), real, np.random.default_rng(SEED), every)
    rows, twins = groups(real), groups(simulated)
    columns = {name: (statistics(real, rows[name]), statistics(simulated, twins[name])) for name in rows}
    return [
        _table(f"{radar} against real cars, by {what}: real/simulated", rows, {name: columns[name] for name in names})
        for what, names in (("range", [n for n in rows if n not in ASPECTS]), ("aspect", ASPECTS))
    ]


def _table(title: str, rows: dict[str, NDArray], columns: dict[str, tuple[dict, dict]]) -> Table:
    """One column for each group of cars, one row for each statistic."""
    table = Table(title=title, box=box.SIMPLE, padding=(0, 0, 0, 1))
    table.add_column("")
    for name in columns:
        table.add_column(name, justify="right")
    table.add_row("cars", *(str(int(rows[name].sum())) for name in columns))
    for key, label in zip(NAMES, TITLES, strict=True):
        d = 0 if key in ("median", "mean", "std") else 2
        table.add_row(label, *(f"{a[key]:.{d}f}/{b[key]:.{d}f}" for a, b in columns.values()))
    return table

"""A drive of ours as the tables of a recording: what is read back gives trackers the same bits.

Only a radar without noise gets the least standard deviations that a table may have.
"""

from collections.abc import Callable
from functools import partial
from io import BufferedIOBase
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from sensors.origin import KINDS
from sensors.radar import Radar
from testbed.environment.perception import RadarLike, radar_of
from testbed.files import atomic_file, make_directory
from testbed.limits import check_choice
from testbed.replay.columns import TABLES, TWO_SIDED, Column
from testbed.replay.recording import RecordedFrame, Recording
from testbed.replay.sensor_sheets import OPTIONAL
from testbed.replay.tables import FORMATS, path_of
from testbed.replay.truth import NONE, contour_text
from trackers.scan import DepthProfile, SensorModel

Columns = dict[str, Any]  # (N,) numbers, NaN for none, or N texts


def check_folder(folder: Path, format: str) -> None:
    """Raise ValueError or OSError, in one sentence, where tables cannot go into a folder in a format."""
    check_choice("format", format, FORMATS)
    make_directory(folder)
    for name in TABLES:
        found = path_of(folder, name)
        if found is not None and found.suffix != f".{format}":
            raise ValueError(f"out: {folder} has a table {found.name}; choose another directory, or that format")


def write(recording: Recording, folder: Path, format: str) -> list[Path]:
    """Write the tables of a recording, `csv` or `parquet`, into a folder; returns their paths.

    Raises OSError, in one sentence, where one cannot be written.
    """
    make_directory(folder)
    radar = radar_of(recording.radar)
    names = tuple(f"radar-{s}" for s in range(len(radar.models)))
    frames = recording.frames
    tables: dict[str, Columns] = {
        "sensors": _sensors(radar, names),
        "ego": _ego(frames),
        "scans": _scans(frames, names),
        "detections": _detections(frames, names),
        "truth": _truth(frames),
        "lanes": _lanes(recording),
    }
    return [_write(folder / f"{name}.{format}", TABLES[name].columns, columns) for name, columns in tables.items()]


def _write(path: Path, known: tuple[Column, ...], columns: Columns) -> Path:
    types = {column.name: (pa.string() if column.text else pa.float64()) for column in known}
    arrays = {name: pa.array(value, types[name], from_pandas=True) for name, value in columns.items()}
    units = {column.name: column.unit for column in known}
    fields = [pa.field(name, types[name], metadata={"unit": units[name]}) for name in arrays]
    table = pa.table(list(arrays.values()), pa.schema(fields))
    save: Callable[[pa.Table, BinaryIO | BufferedIOBase], Any] = pq.write_table
    if path.suffix == ".csv":
        save = partial(pa_csv.write_csv, write_options=pa_csv.WriteOptions(quoting_style="needed"))
    with atomic_file(path) as file:
        save(table, file)
    return path


def _sensors(radar: RadarLike, names: tuple[str, ...]) -> Columns:
    models = radar.models
    mount = np.array([model.mount for model in models])
    fixed = ("max_range", "fov", "sigma_range", "sigma_azimuth", *OPTIONAL)
    columns: Columns = {"name": names, "x": mount[:, 0], "y": mount[:, 1], "yaw": mount[:, 2], "rate": _rates(radar)}
    least = {column.name: column.least for column in TABLES["sensors"].columns}
    columns |= {name: np.array([max(getattr(model, name), least[name]) for model in models]) for name in fixed}
    columns["fold_rate"] = np.where(np.isinf(columns["fold_rate"]), np.nan, columns["fold_rate"])
    return columns | _profiles(models)


def _rates(radar: RadarLike) -> NDArray:
    """Scans a second of each sensor, NaN for one every frame of the simulation."""
    usual = np.nan if radar.rate is None else radar.rate
    if not isinstance(radar, Radar):
        return np.full(len(radar.models), usual)
    return np.array([sensor.rate if np.isfinite(sensor.rate) else usual for sensor in radar.sensors])


def _profiles(models: tuple[SensorModel, ...]) -> Columns:
    columns: Columns = {}
    for name in DepthProfile.__dataclass_fields__:
        value = np.array([getattr(model.profile, name) for model in models], float)
        if name in TWO_SIDED:
            columns |= {f"profile_{name}_along": value[:, 0], f"profile_{name}_across": value[:, 1]}
        else:
            columns[f"profile_{name}"] = value
    return columns


def _ego(frames: tuple[RecordedFrame, ...]) -> Columns:
    state = np.array([frame.scene.ego.platform for frame in frames])
    size = np.array([frame.scene.ego.size for frame in frames])
    columns = dict(zip(("x", "y", "heading", "vx", "vy", "yaw_rate"), state.T, strict=True))
    return {"time": _times(frames), **columns, "length": size[:, 0], "width": size[:, 1]}


def _times(frames: tuple[RecordedFrame, ...]) -> NDArray:
    return np.array([frame.scene.time for frame in frames])


def _scans(frames: tuple[RecordedFrame, ...], names: tuple[str, ...]) -> Columns:
    """What was delivered; of a radar that does not say so, what has detections."""
    rows = [(frame.scene.time, s) for frame in frames for s in _delivered(frame)]
    return {"time": [time for time, _ in rows], "sensor": [names[s] for _, s in rows]}


def _delivered(frame: RecordedFrame) -> list[int]:
    scan = frame.scan
    if scan.delivered is not None:
        return np.flatnonzero(scan.delivered).tolist()
    return np.unique((scan.sensor + np.zeros(len(scan.mask), int))[scan.mask]).tolist()


def _detections(frames: tuple[RecordedFrame, ...], names: tuple[str, ...]) -> Columns:
    time, sensor, polar, owner, kind = [], [], [np.zeros((0, 3))], [], []
    for scene, scan, origin in frames:
        use = scan.mask
        time += [scene.time] * int(use.sum())
        sensor += [names[s] for s in (scan.sensor + np.zeros(len(use), int))[use].tolist()]
        polar.append(scan.polar[use])
        ids = np.append(scene.objects.id, -1)[origin.object[use]]  # the last for -1
        owner += [NONE if number < 0 else str(number) for number in ids.tolist()]
        kind += [KINDS[k] for k in origin.kind[use].tolist()]
    r, a, rate = np.concatenate(polar).T
    return {"time": time, "sensor": sensor, "range": r, "azimuth": a, "range_rate": rate, "object": owner, "kind": kind}


def _truth(frames: tuple[RecordedFrame, ...]) -> Columns:
    objects = [frame.scene.objects for frame in frames]
    count = [len(o.id) for o in objects]
    joined = {
        name: np.concatenate([np.asarray(getattr(o, name), float) for o in objects])
        for name in ("pose", "velocity", "yaw_rate", "size", "crashed")
    }
    contours = [
        contour_text([outline for outline, k in zip(f.scene.bodies.outline, f.scene.bodies.owner) if k == row])
        for f in frames
        for row in range(len(f.scene.objects.id))
    ]
    return {
        "time": np.repeat(_times(frames), count),
        "id": [str(number) for o in objects for number in o.id.tolist()],
        **dict(zip(("x", "y", "heading"), joined["pose"].T, strict=True)),
        **dict(zip(("vx", "vy"), joined["velocity"].T, strict=True)),
        "yaw_rate": joined["yaw_rate"],
        **dict(zip(("length", "width"), joined["size"].T, strict=True)),
        "class": [kind for o in objects for kind in o.kind],
        "contour": contours,
        "expected": np.concatenate([frame.origin.expected for frame in frames]),
        "visible": np.concatenate([frame.origin.visible for frame in frames]),
        "crashed": joined["crashed"],
    }


def _lanes(recording: Recording) -> Columns:
    centres, half = recording.drawn.surface, recording.drawn.half_width
    points = np.concatenate([np.zeros((0, 2)), *centres])
    count = [len(line) for line in centres]
    lane = [str(k) for k, n in enumerate(count) for _ in range(n)]
    return {"lane": lane, "x": points[:, 0], "y": points[:, 1], "width": np.repeat(2 * np.array(half), count)}

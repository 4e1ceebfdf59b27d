"""Folders of comparisons made of seeded random numbers, in the layout of real ones."""

import hashlib
from pathlib import Path

import numpy as np
import pyarrow as pa

from testbed.evaluation.metric import COSTS, METRICS
from testbed.evaluation.tracking import ERRORS
from testbed.experiments.compare import Comparison
from testbed.experiments.rows import COLUMNS, SCHEMA
from testbed.experiments.run import Run
from testbed.experiments.store import ROWS, Results, Store
from testbed.experiments.study import Kept

PHASES = (("before", 0.0, 3.0), ("onset", 3.0, 4.0), ("during", 4.0, 6.0), ("after", 6.0, 8.0))
OBJECTS = 4
DT = 0.2  # [s]


def make(comparison: Comparison, blind: str | None = None, gone: tuple[tuple[str, str, int], ...] = ()) -> Results:
    """A folder with all runs but those in `gone`; the tracker `blind` holds no object at all."""
    (Path(comparison.out) / ROWS).mkdir(parents=True, exist_ok=True)
    for run in comparison.work():
        if (run.case, run.source, run.seed) not in gone:
            _write(run, comparison, run.source == blind)
    return Results.read(comparison)


def level(task: Run, comparison: Comparison) -> float:
    """Error of a run: trackers in order, hard and easy scenarios, noise of the seed shared by all trackers."""
    rng = np.random.default_rng(comparison.scenarios.index(task.case))
    own = np.random.default_rng(int.from_bytes(hashlib.sha256(task.name.encode()).digest()[:4]))
    shared = np.random.default_rng((comparison.scenarios.index(task.case), task.seed))
    place = comparison.trackers.index(task.source) / len(comparison.trackers)
    return float((0.8 + place) * rng.uniform(0.5, 2.5) * shared.uniform(0.7, 1.3) * own.uniform(0.8, 1.2))


def _write(task: Run, comparison: Comparison, blind: bool) -> None:
    size = level(task, comparison)
    rng = np.random.default_rng((comparison.work().index(task), 7))
    columns = _rows(task, size, blind, rng)
    arrays = [
        pa.array(values, from_pandas=True).cast(field.type) for values, field in zip(columns, SCHEMA, strict=True)
    ]
    table = pa.Table.from_arrays(arrays, schema=SCHEMA)
    spans = [_span(task, name, size, blind, rng) for name in ("all", *(p[0] for p in PHASES))]
    cost = {"ms_per_scan": 10 * size, "us_per_update": None if blind else 900 * size}
    seconds = {"loading": 0.1, "tracking": size, "metrics": 0.5}
    spans[0] |= cost
    Store(comparison).write(task, Kept(table, spans, seconds))


def _span(task: Run, phase: str, size: float, blind: bool, rng: np.random.Generator) -> dict[str, object]:
    values = {key: float(size * rng.uniform(0.9, 1.1)) for key in METRICS if key not in COSTS}
    values |= {"box_iou": 1 / (1 + size), "contour_iou": 1 / (1 + size), "nees_position": 2 * size**2}
    if blind:
        unknown = ("rmse", "gwd", "box", "contour", "nees")
        values = {k: None if k.startswith(unknown) else v for k, v in values.items()}
    return {"phase": phase, **values}


def _rows(task: Run, size: float, blind: bool, rng: np.random.Generator) -> list[object]:
    times = np.repeat(np.arange(0, PHASES[-1][2] + DT / 2, DT), OBJECTS)
    n = len(times)
    held = np.zeros(n, bool) if blind else rng.random(n) > 0.08
    names = np.array([p[0] for p in PHASES])
    phase = names[np.clip(np.searchsorted([p[2] for p in PHASES], times, side="right"), 0, len(names) - 1)]
    wander = 1 + 0.4 * np.sin(times + task.seed)
    errors = {name: size * wander * rng.normal(size=n) for name in ERRORS}
    errors |= {name: np.abs(errors[name]) for name in ("position", "velocity", "gwd", "gwd2")}
    errors |= {name: size * rng.chisquare(2, n) for name in ("nees_position", "nees_velocity")}
    errors |= {name: size * rng.chisquare(1, n) for name in ("nees_heading", "nees_length", "nees_width")}
    values = {
        "scenario": np.full(n, task.case), "tracker": np.full(n, task.source), "seed": np.full(n, task.seed),
        "time": times, "phase": phase, "status": np.where(held, "pair", "missed"),
        "object": np.tile(np.arange(OBJECTS), n // OBJECTS), "kind": np.full(n, "car"),
        "track": _where(held, np.tile(np.arange(OBJECTS), n // OBJECTS)), "range": rng.uniform(5, 140, n),
        "bearing": rng.uniform(0, 180, n), "age": times, "ends": np.minimum(times, 2).astype(int),
        "visible": rng.choice([0, 0.1, 0.4, 0.6, 0.9, 1.0], n), "expected": rng.uniform(1, 9, n),
        "detections": _where(held, rng.integers(0, 9, n)),
        "gospa2": np.where(held, errors["position"] ** 2, 50.0),
        "length_std": _where(held, np.full(n, 0.9)), "width_std": _where(held, np.full(n, 0.9)),
        "nis": _where(held, size * rng.chisquare(2, n)),
    }  # fmt: skip
    values |= {name: _where(held, e) for name, e in errors.items()}
    return [values[column.name] for column in COLUMNS]


def _where(held: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.where(held, values.astype(float), np.nan)

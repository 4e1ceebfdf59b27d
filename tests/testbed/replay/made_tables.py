"""Small recordings for tests: a car ahead and one beside an ego at constant speed, seen by two sensors."""

import csv
from pathlib import Path
from typing import Any

import numpy as np

from trackers.geometry import to_frame, to_world

Columns = dict[str, list[Any]]
CARS = {"a": (25.0, 0.0, 22.0, 4.5, 1.8), "b": (15.0, 4.0, 19.0, 8.0, 2.5)}  # x, y [m], speed [m/s], length, width
EGO_SPEED = 20.0
SHEET = {"max_range": 100.0, "fov": 2.0, "sigma_range": 0.1, "sigma_azimuth": 0.005, "sigma_rate": 0.1, "clutter": 0.1}


def made(duration: float = 1.5, rates: tuple[float, float] = (10.0, 10.0), points: int = 12) -> dict[str, Columns]:
    """The tables: two sensors at the front with these rates [1/s], the truth at each of their times."""
    rng = np.random.default_rng(5)
    names = ("left", "right")
    times = sorted({round(k / rate, 6) for rate in rates for k in range(int(duration * rate) + 1)})
    tables: dict[str, list[dict[str, Any]]] = {name: [] for name in ("detections", "ego", "sensors", "truth", "lanes")}
    for name, rate, y in zip(names, rates, (0.5, -0.5), strict=True):
        tables["sensors"].append({"name": name, "x": 2.0, "y": y, "yaw": 0.0, "rate": rate, **SHEET})
    for t in times:
        x = EGO_SPEED * t
        tables["ego"].append({"time": t, "x": x, "y": 0.0, "heading": 0.0, "speed": EGO_SPEED, "yaw_rate": 0.0})
        for name, (x0, y0, speed, length, width) in CARS.items():
            car = {"x": x0 + speed * t, "y": y0, "heading": 0.0, "speed": speed, "length": length, "width": width}
            tables["truth"].append({"time": t, "id": name, **car})
            for sensor, rate, side in zip(names, rates, (0.5, -0.5), strict=True):
                if abs(t * rate - round(t * rate)) < 1e-4:
                    seen = rear_points(car, points, rng)
                    tables["detections"] += rows(t, sensor, seen, np.array([x + 2.0, side]), speed, rng)
    tables["lanes"] = [
        {"lane": lane, "x": x, "y": y, "width": 4.0} for lane, y in ((0, 0.0), (1, 4.0)) for x in (0.0, 300.0)
    ]
    return {name: {key: [row[key] for row in table] for key in table[0]} for name, table in tables.items()}


def rear_points(car: dict[str, Any], count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (M, 2) [m] on the rear and the near side of a car."""
    u = rng.uniform(-0.5, 0.5, count)
    on_rear = rng.random(count) < 0.7
    local = np.where(on_rear[:, None], np.stack([0 * u - 0.5, u], -1), np.stack([u, 0 * u - 0.5], -1))
    return to_world(np.array([car["x"], car["y"], 0.0]), local * [car["length"], car["width"]])


def rows(time: float, sensor: str, xy: np.ndarray, place: np.ndarray, speed: float, rng: np.random.Generator) -> list:
    """Detections of points (M, 2) by a sensor at a place (2,)."""
    d = to_frame(np.array([*place, 0.0]), xy) + rng.normal(0, 0.05, xy.shape)
    r, a = np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0])
    rate = (speed - EGO_SPEED) * np.cos(a) + rng.normal(0, 0.1, len(r))
    values = zip(r.tolist(), a.tolist(), rate.tolist(), strict=True)
    return [{"time": time, "sensor": sensor, "range": q, "azimuth": b, "range_rate": v} for q, b, v in values]


def save(tables: dict[str, Columns], folder: Path) -> Path:
    """Write the tables as CSV; None is an empty cell."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, columns in tables.items():
        with open(folder / f"{name}.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))
    return folder

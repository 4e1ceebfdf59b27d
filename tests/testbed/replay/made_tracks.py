"""Tracks of the cars of `made_tables` as a table, right to the last digit, in the columns that are needed."""

from pathlib import Path
from typing import Any

from tests.testbed.replay.made_tables import CARS, Columns, made, save

NEEDED = ("time", "id", "x", "y", "heading", "vx", "vy", "length", "width")


def tracks(duration: float = 1.0, **more: Any) -> Columns:
    """A row for each car at each scan; `more` are further columns of one value."""
    rows = [
        (t, f"track {name}", x0 + speed * t, y0, 0.0, speed, 0.0, length, width)
        for t in (k / 10 for k in range(round(10 * duration) + 1))
        for name, (x0, y0, speed, length, width) in CARS.items()
    ]
    columns = dict(zip(NEEDED, map(list, zip(*rows, strict=True)), strict=True))
    return columns | {name: [value] * len(rows) for name, value in more.items()}


def written(columns: Columns, path: Path) -> Path:
    """Write a CSV."""
    save({path.stem: columns}, path.parent)
    return path.parent / f"{path.stem}.csv"


def recording(folder: Path, duration: float = 1.0) -> Path:
    """A recording of the cars."""
    return save(made(duration), folder)

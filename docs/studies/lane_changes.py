"""How likely a lane change is from offset and speed across, in recorded traffic: docs/results/lane_changes.json.

The planners take the log odds that are fitted here (docs/methods/planners.md).
"""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from scenarios.traffic.fitting import direction, fit
from scenarios.traffic.motion import smoothed
from scenarios.traffic.plan import WINDOW, WINDOWS
from scenarios.traffic.reading import Trajectory, read
from studies.page import Docs
from studies.traffic.recorded import FILES
from testbed.command_line.terminal import console, user_input
from testbed.files import write_json
from trackers.geometry import rotation

AHEAD, EVERY = 3.0, 0.5  # [s] within which a change counts, and between the samples of a vehicle
OFFSETS = (-0.5, 0.0, 0.5, 1.0, 1.5)  # [m] bounds of the table, open at both ends
SPEEDS = (-0.1, 0.1, 0.3, 0.6, 1.0)  # [m/s]
LIKELY = (0.01, 0.03, 0.1, 0.3)  # bounds of the probabilities that are held against what happened
DRAWS = 200  # of the bootstrap over vehicles


class Samples(NamedTuple):
    """N moments of vehicles that have a lane on the side that is looked at."""

    lean: NDArray  # (N, 2) [m, m/s] offset from the middle of the lane towards that side, and its change
    changed: NDArray  # (N,) whether its centre crosses the line on that side within `AHEAD`
    vehicle: NDArray  # (N,) int


def samples(paths: list[Path]) -> Samples:
    """All samples of the recordings; ValueError where one cannot be used."""
    rows: list[tuple[float, float, bool, int]] = []
    vehicles = 0
    for path in paths:
        layout, recorded = read(path)
        steps = np.array([v.xy[-1] - v.xy[0] for v in recorded])
        turn = rotation(direction(steps, steps.sum(0)))
        across = [(v.xy @ turn)[:, 1] for v in recorded]
        lanes = fit(np.concatenate(across), np.concatenate([v.lane for v in recorded]))
        for v, y in zip(recorded, across, strict=True):
            rows += [(*row, vehicles) for row in _of(v, y, lanes.places, lanes.width, WINDOWS.get(layout.name, WINDOW))]
            vehicles += 1
    offset, speed, changed, vehicle = map(np.array, zip(*rows, strict=True))
    return Samples(np.stack([offset, speed], -1), changed, vehicle)


def _of(v: Trajectory, y: NDArray, places: NDArray, width: float, window: float) -> list[tuple[float, float, bool]]:
    """Offset, speed and whether it changed, of one vehicle with lateral places y (K,) [m], towards both sides."""
    step = float(np.median(np.diff(v.time)))
    y = smoothed(y[:, None], round(window / 2 / step))[:, 0]
    speed, lane = np.gradient(y, step), np.abs(y[:, None] - places).argmin(1)
    ahead, found = round(AHEAD / step), []
    for k in range(0, len(y) - ahead, round(EVERY / step)):
        for side in (-1, 1):
            if 0 <= lane[k] + side < len(places):
                way = side * (y[k : k + ahead + 1] - places[lane[k]])
                found.append((float(way[0]), float(side * speed[k]), bool(way.max() > width / 2)))
    return found


def log_odds(s: Samples) -> NDArray:
    """The logistic regression (3,) of the change on 1, offset and speed: greatest likelihood."""
    X = np.column_stack([np.ones(len(s.lean)), s.lean])
    return minimize(lambda b: np.sum(np.logaddexp(0.0, X @ b) - s.changed * (X @ b)), np.zeros(3)).x


def interval(s: Samples) -> NDArray:
    """95 % intervals (3, 2) of the log odds, by bootstrap over vehicles."""
    rng = np.random.default_rng(0)
    rows = [np.flatnonzero(s.vehicle == k) for k in np.unique(s.vehicle)]
    drawn = []
    for _ in range(DRAWS):
        index = np.concatenate([rows[k] for k in rng.integers(len(rows), size=len(rows))])
        drawn.append(log_odds(Samples(*(part[index] for part in s))))
    return np.quantile(drawn, (0.025, 0.975), axis=0).T


def table(s: Samples, b: NDArray) -> list[dict[str, float]]:
    """A row a cell: samples, changes, and how many are expected by the log odds b (3,)."""
    cells = np.digitize(s.lean[:, 0], OFFSETS), np.digitize(s.lean[:, 1], SPEEDS)
    p, low, high = expit(b[0] + s.lean @ b[1:]), (-9.0, *OFFSETS), (*SPEEDS, 9.0)
    found = []
    for i in range(len(OFFSETS) + 1):
        for j in range(len(SPEEDS) + 1):
            here = (cells[0] == i) & (cells[1] == j)
            found.append({
                "offset_from": low[i], "speed_to": high[j], "samples": int(here.sum()),
                "changes": int(s.changed[here].sum()), "expected": round(float(p[here].sum()), 1),
            })  # fmt: skip
    return found


def held_out(s: Samples) -> NDArray:
    """Probabilities (N,) by the log odds of the other half of the vehicles: of the odd ones for the even ones."""
    p, odd = np.empty(len(s.lean)), s.vehicle % 2 == 1
    for half in (odd, ~odd):
        b = log_odds(Samples(*(part[~half] for part in s)))
        p[half] = expit(b[0] + s.lean[half] @ b[1:])
    return p


def calibration(changed: NDArray, p: NDArray) -> list[dict[str, float]]:
    """A row a range of the probabilities p (N,): samples, changes, and how many are expected.

    >>> calibration(np.array([False, True]), np.array([0.02, 0.5]))[-1]
    {'probability_from': 0.3, 'samples': 1, 'changes': 1, 'expected': 0.5}
    """
    cell, found = np.digitize(p, LIKELY), []
    for i, low in enumerate((0.0, *LIKELY)):
        here = cell == i
        found.append({
            "probability_from": low, "samples": int(here.sum()), "changes": int(changed[here].sum()),
            "expected": round(float(p[here].sum()), 1),
        })  # fmt: skip
    return found


def skill(changed: NDArray, p: NDArray) -> float:
    """By how much less the mean squared error (Brier 1950) of probabilities (N,) is than that of the mean frequency."""
    return float(1 - np.mean((p - changed) ** 2) / np.var(changed))


def main(
    data: Annotated[Path, typer.Argument(help="Folder of ngsim_i80 and ngsim_us101.")],
    docs: Docs = Path("docs"),
) -> None:
    """Count lane changes in recorded traffic, and fit their log odds."""
    with user_input((OSError, ValueError)):
        s = samples([data / file for files in FILES.values() for file in files])
        b, p = log_odds(s), held_out(s)
        out = docs / "results" / "lane_changes.json"
        write_json(out, {
            "of": "NGSIM I-80 16:00 and US-101; logistic regression of a lane change within 3 s on 1, offset [m], "
                  "speed across [m/s]; intervals of 95 % by bootstrap over vehicles; held out: each half of the "
                  "vehicles by the log odds of the other",
            "vehicles": len(np.unique(s.vehicle)), "vehicles_changing": len(np.unique(s.vehicle[s.changed])),
            "samples": len(s.changed), "changes": int(s.changed.sum()),
            "log_odds": b.round(2).tolist(), "interval": interval(s).round(2).tolist(), "table": table(s, b),
            "held_out": {"table": calibration(s.changed, p), "skill": round(skill(s.changed, p), 3)},
        })  # fmt: skip
        console.print(f"results  {out}", soft_wrap=True)

"""Drives of all probes on the truth, kept drive by drive, and what accepts a probe."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.probes import PROBES
from testbed.command_line.interruption import InterruptRequest
from testbed.evaluation.tracking import jsonable
from testbed.experiments.probe import accepted, driven
from testbed.experiments.run import Run
from testbed.files import write_json
from testbed.frame import TRUTH

PLANNERS = {"probe-merge": "idm-keen"}  # that want what the probe is about; `PLANNER` in all others
PLANNER = "idm"
SEEDS = 50


@dataclass(frozen=True)
class Summary:
    """What the drives of a probe on the truth were like."""

    probe: str
    planner: str
    drives: int
    collisions: int
    ttc: tuple[float, float, float]  # [s] least, median, largest of the least time to collision of each drive
    drac: float  # [m/s^2] median of the largest DRAC
    braking: tuple[float, float]  # [m/s^2] median and largest of the hardest braking
    accepted: bool


def planner_of(probe: str) -> str:
    """The planner with which a probe is accepted."""
    return PLANNERS.get(probe, PLANNER)


def summary(probe: str, rows: Sequence[Mapping[str, Any]]) -> Summary:
    """What the drives of a probe were like, from their metrics.

    The time to collision is that to anything, ahead or in the plane: a gap is entered from the side.
    """
    ttc = [min(row["ttc_min"], row["ttc_plane_min"]) for row in rows]
    braking = [row["deceleration_max"] for row in rows]
    return Summary(
        probe,
        planner_of(probe),
        len(rows),
        sum(row["collisions"] for row in rows),
        (min(ttc), float(np.median(ttc)), max(ttc)),
        float(np.median([row["drac_max"] for row in rows])),
        (float(np.median(braking)), max(braking)),
        accepted(PROBES[probe], rows),
    )


def all_drives(
    seeds: Sequence[int], code: str, out: Path, progress: Callable[[str], None], request: InterruptRequest
) -> dict[str, list[dict[str, Any]]]:
    """Measures of the drives of each probe, those that lie in `out` from the same code included.

    Ends early, with the drives made until then, when an interruption is requested.
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for probe in PROBES:
        file = out / f"{probe}.json"
        known = _known(file, code)
        for seed in seeds:
            if request.signal is not None:
                break
            progress(f"{probe}, seed {seed}")
            if str(seed) not in known:
                known[str(seed)] = row(driven(on_truth(probe, seed)))
                write_json(file, {"code": code, "drives": known})
        found[probe] = [known[str(seed)] for seed in seeds if str(seed) in known]
    return found


def on_truth(probe: str, seed: int) -> Run:
    """A drive of a probe on the truth, with the planner with which it is accepted."""
    return Run(probe, seed, TRUTH, planner_of(probe))


def row(summary: Mapping[str, float | int]) -> dict[str, Any]:
    """Metrics as JSON types, rounded to what a page shows and more."""
    return jsonable({key: round(value, 4) for key, value in summary.items()})


def _known(file: Path, code: str) -> dict[str, dict[str, Any]]:
    """Drives of an earlier call by the same code, by seed."""
    try:
        found = json.loads(file.read_text())
    except (FileNotFoundError, ValueError):
        return {}
    return found["drives"] if found["code"] == code else {}

"""Two drives of one seed side by side: how the second differs from the first, and where they part."""

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from testbed.environment.sources.conditions import IN_VIEW, parse
from testbed.evaluation.driving import SAME, Driven, changed_decisions
from testbed.evaluation.metric import DRIVES, keys, values
from testbed.frame import TRUTH
from testbed.regret.curves import Curves
from testbed.regret.results import Drive, Results
from testbed.regret.study import Task

HARD = 2.0  # [m/s^2] braking that counts as an event
AFTER = 3.0  # [s] within which the other drive brakes for the same reason
MEASURES = (  # of each drive, of which a pair has the difference
    "drive_score", "collisions", "drac_max", "tit", "ttc_min", "headway_min", "progress", "deceleration_max", "jerk",
)  # fmt: skip


def difference(drive: Drive, other: Drive) -> dict[str, float]:
    """Measures of a drive minus those of another one."""
    return {key: float(drive.measures[key]) - float(other.measures[key]) for key in MEASURES}


def paired(curves: Curves, others: Curves, drive: Drive, other: Drive) -> dict[str, float]:
    """What only a pair has."""
    return values(DRIVES, Driven(curves.drive, drive.decisions), Driven(others.drive, other.decisions))


class Parting(NamedTuple):
    """Where two drives part: the first decision that differs."""

    time: float  # [s]
    action: str  # of the drive
    other: str  # of the one that it is compared with
    cause: str  # the largest difference between tracks and truth then

    def __str__(self) -> str:
        return f"at {self.time:.1f} s {self.action} instead of {self.other}; {self.cause}"


def parting(curves: Curves, others: Curves, drive: Drive, other: Drive) -> Parting | None:
    """Where a drive parts from another one, None where all decisions agree."""
    for k, (a, b) in enumerate(zip(drive.decisions, other.decisions, strict=False)):
        if changed_decisions([a], [b], SAME):
            time = drive.times[k]
            chosen, instead = (c.action[int(np.searchsorted(c.drive.time, time + 1e-6))] for c in (curves, others))
            return Parting(time, chosen, instead, curves.cause[int(np.searchsorted(curves.drive.time, time - 1e-6))])
    return None


def events(curves: Curves, others: Curves) -> list[tuple[float, str]]:
    """Time [s] and text: braking for nothing, and braking too late, each beside the other drive."""
    time, own, ref = curves.drive.time, curves.drive.braking, others.drive.braking
    found = []
    for start in _onsets(own > HARD):
        again = ref[(others.drive.time >= time[start] - AFTER) & (others.drive.time <= time[start] + AFTER)]
        if not (again > HARD).any():
            found.append((float(time[start]), f"brakes for nothing, {own[start : start + 15].max():.1f} m/s^2"))
    mine = time[_onsets(own > HARD)]
    for start in _onsets(ref > HARD):
        at = others.drive.time[start]
        later = mine[(mine >= at - AFTER) & (mine <= at + AFTER)]
        if not len(later):
            found.append((float(at), "does not brake where the other drive does"))
        elif (delay := float(later[0] - at)) > 0.1:
            found.append((float(later[0]), f"brakes {delay:.1f} s late"))
    return sorted(found)


def _onsets(active: NDArray) -> NDArray:
    """Indices at which a series (F,) of bool becomes true, spans nearer than a second counted as one."""
    starts = np.flatnonzero(active & ~np.concatenate([[False], active[:-1]]))
    ends = np.flatnonzero(active & ~np.concatenate([active[1:], [False]]))
    fresh = np.concatenate([[True], starts[1:] - ends[:-1] > 15]) if len(starts) else np.zeros(0, bool)
    return starts[fresh]


def table(results: Results) -> pd.DataFrame:
    """All drives beside those on the truth, and beside those on what is in view: drive minus reference.

    One row a pair: reference, scenario, planner, condition, seed, the measures, what only pairs have, `parted` [s] and
    `parting` in words. Drives with groups of errors are left out: their attribution needs no pairs.
    """
    rows: list[dict[str, Any]] = []
    for task, drive in results.drives.items():
        if parse(task.condition).groups is not None:
            continue
        for reference in (TRUTH, IN_VIEW):
            other = results.drives.get(task._replace(condition=reference))
            if other is not None and task.condition not in (TRUTH, reference):
                rows.append({"reference": reference, **task._asdict(), **_row(results, drive, other)})
    columns = ["reference", *Task._fields, *MEASURES, *keys(DRIVES), "parted", "parting"]
    return pd.DataFrame(rows, columns=columns)


def _row(results: Results, drive: Drive, other: Drive) -> dict[str, Any]:
    curves, others = results.curves(drive.task), results.curves(other.task)
    where = parting(curves, others, drive, other)
    words = "no decision differs" if where is None else str(where)
    parted = np.nan if where is None else where.time
    return {**difference(drive, other), **paired(curves, others, drive, other), "parted": parted, "parting": words}

"""Drives of all probes on the truth and on nothing, and what accepts a probe."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa

from scenarios.probes import PROBES
from studies.runs import NOTHING
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import drive_score
from testbed.evaluation.tracking import jsonable
from testbed.experiments.episode import Played
from testbed.experiments.probe import BLIND, accepted, fails
from testbed.experiments.run import Run
from testbed.experiments.study import WHOLE_RUN, Kept, Study
from testbed.frame import TRUTH, Frame

PLANNERS = {"probe-merge": "idm-keen"}  # that want what the probe is about; `PLANNER` in all others
PLANNER = "idm"
SEEDS = 50
SEEDS_BLIND = 20


@dataclass(frozen=True)
class Acceptance:
    """What the drives of a probe on the truth were like, and those that saw nothing."""

    probe: str
    planner: str
    drives: int
    collisions: int
    ttc: tuple[float, float, float]  # [s] least, median, largest of the least time to collision of each drive
    drac: float  # [m/s^2] median of the largest DRAC
    braking: tuple[float, float]  # [m/s^2] median and largest of the hardest braking
    score: tuple[float, float]  # mean on the truth, and of those that saw nothing
    blind: tuple[int, int]  # drives that saw nothing, and of these those that failed
    accepted: bool


def planner_of(probe: str) -> str:
    """The planner with which a probe is accepted."""
    return PLANNERS.get(probe, PLANNER)


def acceptance(probe: str, rows: Sequence[Mapping[str, Any]], blind: Sequence[Mapping[str, Any]]) -> Acceptance:
    """What accepts a probe, from the measures of its drives on the truth, and of the first seeds also on nothing.

    The time to collision is that to anything, ahead or in the plane: a gap is entered from the side.
    """
    ttc = [min(row["ttc_min"], row["ttc_plane_min"]) for row in rows]
    braking = [row["deceleration_max"] for row in rows]
    return Acceptance(
        probe,
        planner_of(probe),
        len(rows),
        sum(row["collisions"] for row in rows),
        (min(ttc), float(np.median(ttc)), max(ttc)),
        float(np.median([row["drac_max"] for row in rows])),
        (float(np.median(braking)), max(braking)),
        (_score(rows, rows), _score(blind, rows)),
        (len(blind), sum(map(fails, blind, rows))),
        accepted(PROBES[probe], rows, blind),
    )


def _score(rows: Sequence[Mapping[str, Any]], truth: Sequence[Mapping[str, Any]]) -> float:
    pairs = zip(rows, truth, strict=False)
    return round(float(np.mean([drive_score(row, aim["progress"]) for row, aim in pairs])), 3)


def drive_of(probe: str, seed: int, source: str = TRUTH) -> Run:
    """A drive of a probe, with the planner with which it is accepted."""
    return Run(probe, seed, source, planner_of(probe))


@dataclass(frozen=True, kw_only=True)
class Probes(Study):
    """All probes on the truth, and with some seeds on nothing."""

    seeds: int = SEEDS
    blind: int = SEEDS_BLIND

    name: ClassVar[str] = "probes"
    schema: ClassVar[pa.Schema] = NOTHING
    modules: ClassVar[tuple[str, ...]] = ("studies.probes.drives",)

    def work(self) -> list[Run]:
        """Every probe with every seed."""
        asked = ((TRUTH, self.seeds), (BLIND, min(self.seeds, self.blind)))
        return [drive_of(probe, seed, source) for probe in PROBES for source, n in asked for seed in range(n)]

    def watch(self, run: Run) -> "Watched":
        """What measures the drive."""
        return Watched()


class Watched:
    """Measures of a drive."""

    def __init__(self) -> None:
        self.drive = DriveEvaluator()

    def begin(self, phases: Sequence[Any]) -> None:
        """Phases of the maneuver are not told apart."""

    def __call__(self, frame: Frame) -> None:
        """Take one frame."""
        self.drive.step(frame.scene)

    def kept(self, played: Played) -> Kept:
        """The measures as JSON types."""
        return Kept(NOTHING.empty_table(), [{"phase": WHOLE_RUN, **row(self.drive.summary())}])


def row(summary: Mapping[str, float | int]) -> dict[str, Any]:
    """Metrics as JSON types, rounded to what a page shows and more."""
    return jsonable({key: round(value, 4) for key, value in summary.items()})

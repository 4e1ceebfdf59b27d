"""What is kept of a drive of a study of regret: its curves frame by frame, its measures, decisions, tracking errors."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenarios.stage import Phase
from testbed.environment.sources import conditions
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import DriveCurves, DriveFrame
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.experiments.discrepancy import Discrepancy, largest
from testbed.experiments.episode import Played
from testbed.experiments.run import Run
from testbed.experiments.study import WHOLE_RUN, Kept
from testbed.frame import Frame

DRIVEN = (  # metrics of the drive
    "elapsed", "collisions", "ttc_min", "ttc_plane_min", "ttc_5", "drac_max", "tit", "headway_min",
    "deceleration_max", "jerk", "progress", "drive_score",
)  # fmt: skip
TRACKING = (  # measures of the tracker in its own drive
    "gospa", "missed_percent", "false_per_scan", "switches", "lost", "birth_delay",
    "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width", "nees_position",
)  # fmt: skip
COLUMNS = {  # name: unit, note
    "time": ("s", "since the reset"),
    "x": ("m", "of the centre of the ego"),
    "y": ("m", "of the centre of the ego"),
    "heading": ("rad", "of the ego"),
    **dict.fromkeys(DriveFrame._fields, ("", "as in `DriveFrame`")),
    "discrepancy": ("1", "size of the largest difference between tracks and truth, see `discrepancy`"),
}
WORDS = {"action": "the planner's last choice", "cause": "the largest difference between tracks and truth"}
SCHEMA = pa.schema(
    [pa.field(n, pa.float64(), metadata={"unit": unit, "note": note}) for n, (unit, note) in COLUMNS.items()]
    + [pa.field(n, pa.string(), metadata={"unit": "", "note": note}) for n, note in WORDS.items()]
)


class Curves(NamedTuple):
    """One drive over its F frames."""

    drive: DriveCurves
    pose: NDArray  # (F, 3) x, y [m], heading [rad] of the ego
    discrepancy: NDArray  # (F,)
    action: Sequence[str]  # (F,)
    cause: Sequence[str]  # (F,)

    def table(self) -> pa.Table:
        """Columns of `SCHEMA`."""
        found = {**self.drive._asdict(), **dict(zip(("x", "y", "heading"), self.pose.T, strict=True))}
        found |= {"discrepancy": self.discrepancy, "action": list(self.action), "cause": list(self.cause)}
        return pa.table([pa.array(found[f.name], f.type) for f in SCHEMA], schema=SCHEMA)

    @classmethod
    def of(cls, table: pa.Table) -> "Curves":
        """Back from a table."""

        def column(name: str) -> NDArray:
            return table[name].to_numpy()

        pose = np.stack([column(name) for name in ("x", "y", "heading")], -1)
        words = [table[name].to_pylist() for name in WORDS]
        return cls(DriveCurves(*map(column, DriveCurves._fields)), pose, column("discrepancy"), *words)


class DriveWatch:
    """Watches a drive for its curves, and where a tracker runs alone for its errors."""

    def __init__(self, run: Run) -> None:
        condition = conditions.parse(run.source)
        self.drive = DriveEvaluator()
        self.tracking = Evaluator(run.condition) if condition.groups is None and condition.tracker else None
        self._pose: list[Any] = []
        self._action: list[str] = []
        self._found: list[Discrepancy] = []

    def begin(self, phases: tuple[Phase, ...]) -> None:
        """Phases are not used."""

    def __call__(self, frame: Frame) -> None:
        """Take one frame."""
        tracks, info = next(iter(frame.outputs.values()))
        self.drive.step(frame.scene)
        if self.tracking is not None:
            self.tracking.keep(frame.time, frame.scene, frame.origin, tracks, info.owner)
        self._pose.append(frame.scene.ego.pose)
        self._action.append(frame.action)
        self._found.append(largest(frame.scene, frame.origin.visible, tracks))

    @property
    def curves(self) -> Curves:
        """The drive so far."""
        sizes = np.array([d.size for d in self._found])
        return Curves(self.drive.curves, np.array(self._pose), sizes, self._action, [d.text for d in self._found])

    def kept(self, played: Played) -> Kept:
        """Curves, measures, errors of the tracker, CPU time [s], and the times [s] and actions of all decisions."""
        drive, tracking = self.drive.summary(), {} if self.tracking is None else self.tracking.summary()
        span: dict[str, Any] = {"phase": WHOLE_RUN, **{key: float(drive[key]) for key in DRIVEN}}
        span |= {key: tracking[key] for key in TRACKING if key in tracking} | {"cpu": played.cpu}
        decisions = [np.ravel(step.action).astype(float).tolist() for step in played.steps]
        more = {"decisions": decisions, "times": [step.time for step in played.steps]}
        return Kept(self.curves.table(), [jsonable(span)], more=more)

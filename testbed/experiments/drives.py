"""What is kept of a drive of a study of regret: its curves frame by frame, its measures, decisions, tracking errors."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from sensors.scene import Scene
from testbed.environment.perception import truth_tracks
from testbed.environment.sources import conditions
from testbed.environment.sources.substitution import match
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import DriveCurves, DriveFrame
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.experiments.episode import Played
from testbed.experiments.run import Run
from testbed.experiments.study import WHOLE_RUN, Kept
from testbed.frame import Frame
from testbed.log.paths import vehicle
from trackers.estimate import Estimate
from trackers.geometry import rotation, to_frame
from trackers.multi.tracks import Tracks

AHEAD, BEHIND, BESIDE = 100.0, 10.0, 6.0  # [m] where traffic matters to the ego: along and across its heading
UNITS = {"near edge": 1.0, "speed": 1.0, "speed across": 0.5, "heading": 0.1}  # errors that weigh alike; SI
MISSING = 4.0  # a missing object, or a false track, weighs as much as an error of so many units

DRIVEN = (  # metrics of the drive
    "elapsed", "collisions", "ttc_min", "ttc_plane_min", "ttc_5", "drac_max", "tit", "headway_min",
    "deceleration_max", "jerk", "progress", "off_road", "drive_value",
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
    "discrepancy": ("1", "size of the largest difference between tracks and truth, see `largest`"),
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


class Discrepancy(NamedTuple):
    """The largest difference between the truth and the tracks."""

    size: float  # in units, less with distance
    text: str


NOTHING = Discrepancy(0.0, "nothing differs")


def largest(scene: Scene, visible: NDArray, tracks: Tracks) -> Discrepancy:
    """The largest difference near the ego, between all objects and the reported tracks.

    visible (N,): share of each object that is visible; one that is hidden is called so.
    """
    truth, own = truth_tracks(scene), tracks._replace(state=None).reported
    partner = match(truth, own)
    found = [NOTHING]
    place = to_frame(scene.ego.pose, truth.estimate.pose[:, None, :2])[:, 0]
    for row in np.flatnonzero(_matters(place)):
        name = f"{vehicle(int(truth.id[row]))}, {place[row, 0]:.0f} m ahead"
        weight = 1 / (1 + abs(place[row, 0]) / 50.0)
        if partner[row] < 0:
            how = "visible, without a reported track" if visible[row] > 0 else "hidden, without a reported track"
            found.append(Discrepancy(MISSING * weight, f"{name}: {how}"))
        else:
            errors = _errors(scene.ego.pose[2], truth.estimate, int(row), own.estimate, int(partner[row]))
            what = max(errors, key=lambda key: abs(errors[key]) / UNITS[key])
            unit = {"near edge": "m", "heading": "rad"}.get(what, "m/s")
            size = weight * abs(errors[what]) / UNITS[what]
            found.append(Discrepancy(size, f"{name}: {what} {errors[what]:+.2f} {unit}"))
    false = np.setdiff1d(np.arange(len(own.id)), partner)
    place = to_frame(scene.ego.pose, own.estimate.pose[false, None, :2])[:, 0]
    for row in np.flatnonzero(_matters(place)):
        weight = 1 / (1 + abs(place[row, 0]) / 50.0)
        name = f"track {own.id[false[row]]}, {place[row, 0]:.0f} m ahead"
        found.append(Discrepancy(MISSING * weight, f"{name}: no object there"))
    return max(found, key=lambda d: d.size)


def _matters(place: NDArray) -> NDArray:
    """Mask of positions (K, 2) [m] in the frame of the ego."""
    return (place[:, 0] > -BEHIND) & (place[:, 0] < AHEAD) & (np.abs(place[:, 1]) < BESIDE)


def _errors(heading: float, truth: Estimate, i: int, own: Estimate, j: int) -> dict[str, float]:
    """Errors of row j of the tracks against row i of the truth in the frame of an ego with this heading [rad]."""
    back = rotation(heading).T
    near = _near_edge(own, j, back[0]) - _near_edge(truth, i, back[0])
    speed, across = back @ (own.velocity[j] - truth.velocity[i])
    turn = float(np.angle(np.exp(1j * (own.pose[j, 2] - truth.pose[i, 2]))))  # of the box
    return {"near edge": float(near), "speed": float(speed), "speed across": float(across), "heading": turn}


def _near_edge(estimate: Estimate, row: int, along: NDArray) -> float:
    """Where the box of one estimate begins in the direction `along` (2,) [m]."""
    pose = estimate.pose[row]
    return pose[:2] @ along - np.abs(rotation(pose[2]).T @ along) @ estimate.size[row] / 2

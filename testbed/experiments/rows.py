"""Rows of a run: each object and track of one tracker in each frame, as a documented Parquet table.

A row is a counted object with its track (`pair`) or without one (`missed`), a reported track that belongs to no object
(`false`), or a frame with neither (`empty`), so that every frame has a row. The squared GOSPA distance of a frame is
the sum of `gospa2` over its rows.
"""

from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from scenarios.stage import Phase
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.ends import HITS, Ends
from testbed.evaluation.metric import METRICS
from testbed.evaluation.metrics import CUTOFF
from testbed.evaluation.tracking import ERRORS, Evaluator, jsonable
from testbed.experiments.episode import Played
from testbed.experiments.run import Run
from testbed.experiments.study import WHOLE_RUN, Kept
from testbed.frame import Frame
from trackers.geometry import wrap_angle

PAIR, MISSED, FALSE, EMPTY = "pair", "missed", "false", "empty"
BETWEEN = "between"  # phase of a frame that lies in none


class Column(NamedTuple):
    """One column of the table."""

    name: str
    type: pa.DataType
    unit: str
    note: str


TEXT = pa.dictionary(pa.int32(), pa.string())
COLUMNS = (
    Column("scenario", TEXT, "", "name in the catalogue"),
    Column("tracker", TEXT, "", "name in the catalogue"),
    Column("seed", pa.int32(), "1", "of the traffic and of the radar"),
    Column("time", pa.float64(), "s", "since the start of the episode"),
    Column("phase", TEXT, "", "of the maneuver: before, onset, during, after"),
    Column("status", TEXT, "", "pair, missed, false or empty"),
    Column("object", pa.int32(), "1", "id in the scene, null for a false track"),
    Column("kind", TEXT, "", "class of the object"),
    Column("track", pa.int32(), "1", "id of the track, null for a missed object"),
    Column("range", pa.float32(), "m", "from the ego to the object, or to a false track"),
    Column("bearing", pa.float32(), "deg", "of the ego from the object's heading: 0 is in front of it, 180 behind"),
    Column("age", pa.float32(), "s", "since the object was first counted"),
    Column("ends", pa.int32(), "1", f"ends of the object, 0 to 2, that {HITS} or more detections have hit so far"),
    Column("visible", pa.float32(), "1", "share of the outline facing the sensors that other vehicles do not hide"),
    Column("expected", pa.float32(), "1", "detections expected of the object in this frame"),
    Column("detections", pa.int32(), "1", "detections assigned to the track in this frame"),
    Column("gospa2", pa.float32(), "m^2", f"part of the squared GOSPA distance, c = {CUTOFF:g} m"),
    *(Column(name, pa.float32(), METRICS[name].unit, METRICS[name].words) for name in ERRORS),
    Column("length_std", pa.float32(), "m", "standard deviation of the length, by the tracker"),
    Column("width_std", pa.float32(), "m", "of the width, by the tracker"),
    Column("nis", pa.float32(), "1", "normalised innovation squared of the centroid, 2 degrees of freedom"),
)
NAMES = tuple(column.name for column in COLUMNS)
SCHEMA = pa.schema([pa.field(c.name, c.type, metadata={"unit": c.unit, "note": c.note}) for c in COLUMNS])


class Rows:
    """Watches a run for the rows of its source, and in closed loop for how the ego drove."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.evaluator = Evaluator(run.source)
        self._drive = DriveEvaluator() if run.loop == "closed" else None
        self._rows: list[tuple[Any, ...]] = []
        self._ends = Ends()
        self._first: dict[int, float] = {}  # object id -> time [s] at which it first counted

    def begin(self, phases: tuple[Phase, ...]) -> None:
        """Measure by these phases."""
        self.evaluator = Evaluator(self.run.source, phases, self.run.settle)

    def __call__(self, frame: Frame) -> None:
        """Add the rows of one frame."""
        time, scene, origin = frame.time, frame.scene, frame.origin
        tracks, info = frame.outputs[self.run.source]
        if self._drive is not None:
            self._drive.step(scene)
        score = self.evaluator.step(time, scene, origin, tracks, info.owner)
        out = tracks.reported
        row_of = {track: k for k, track in enumerate(out.id.tolist())}
        number = dict(zip(info.track.tolist(), zip(info.detections.tolist(), info.nis.tolist())))
        objects, ego = scene.objects, scene.ego.pose[:2]
        to_ego = ego - objects.pose[:, :2]
        distance = np.hypot(*to_ego.T).tolist()
        turn = wrap_angle(np.arctan2(to_ego[:, 1], to_ego[:, 0]) - objects.pose[:, 2])
        bearing = np.degrees(np.abs(turn)).tolist()
        ends = self._ends.step(objects, origin, frame.scan.xy).tolist()
        self._first = dict.fromkeys(score.counted, time) | self._first
        size_std = out.estimate.size_std.tolist()
        head = (self.run.case, self.run.source, self.run.seed, time, self._phase(time))
        rows: list[tuple[Any, ...]] = []
        for n, key in enumerate(objects.id.tolist()):
            if key not in score.counted:
                continue
            past = (bearing[n], time - self._first[key], ends[n])
            seen = (distance[n], *past, float(origin.visible[n]), float(origin.expected[n]))
            if key in score.pairs:
                track, errors = score.pairs[key], score.errors[key]
                took, nis = number.get(track, (None, None))
                rest = (took, errors["gwd2"], *errors.values(), *size_std[row_of[track]], nis)
                rows.append((*head, PAIR, key, objects.kind[n], track, *seen, *rest))
            else:
                rows.append((*head, MISSED, key, objects.kind[n], None, *seen, None, CUTOFF**2 / 2, *NOTHING))
        for track in sorted(set(row_of) - set(score.pairs.values())):
            k = row_of[track]
            far = float(np.hypot(*(out.estimate.pose[k, :2] - ego)))
            took, nis = number.get(track, (None, None))
            rest = (took, CUTOFF**2 / 2, *NOTHING[:-3], *size_std[k], nis)
            rows.append((*head, FALSE, None, None, track, far, *[None] * 5, *rest))
        self._rows += rows or [(*head, EMPTY, *[None] * 10, 0.0, *NOTHING)]

    def table(self) -> pa.Table:
        """All rows so far."""
        columns = list(zip(*self._rows, strict=True)) or [()] * len(COLUMNS)
        arrays = [pa.array(values, c.type, from_pandas=True) for values, c in zip(columns, COLUMNS, strict=True)]
        return pa.table(arrays, SCHEMA)

    def kept(self, played: Played) -> Kept:
        """The rows, and measures of the run and of each phase; events count in the phase in which they happen."""
        whole = {"phase": WHOLE_RUN, **self.evaluator.summary()}
        whole |= played.costs[self.run.source].row()
        whole |= {} if self._drive is None else self._drive.summary()
        return Kept(self.table(), [jsonable(row) for row in (whole, *self.evaluator.phase_rows())])

    def _phase(self, time: float) -> str:
        return next((name for name, start, end in self.evaluator.phases if start <= time < end), BETWEEN)


NOTHING = (None,) * (len(ERRORS) + 3)  # errors, two standard deviations and NIS of a row without a pair

"""Whether detections and the truth are of one place and one time. Method: docs/methods/plausibility.md."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbed.replay.evidence import RIGHT, Boxed, Seen, explained, turned
from testbed.replay.findings import DOUBT, GOOD, OPEN, Finding
from testbed.replay.recording import RecordedFrame
from testbed.replay.sensor_sheets import SensorSheets
from trackers.geometry import compose, point_velocity, to_frame

LATE = tuple(k / 5 for k in range(-5, 6) if k)  # [s] by which detections may be late
LEAST, CLEAR, NEAREST = 20, 4, 0.06  # cells of scans for it, in those against it, and [s] between times that are one
SIGHT, BOXES, HIT = 0.5, 30, 0.08  # part of the view and reach, boxes in it that are due, share that has a detection


def together(seen: Seen, boxes: Boxed, frames: Sequence[RecordedFrame], sensors: SensorSheets) -> Finding:
    """The finding on detections in boxes (B,) of the truth, and on those that were in them some time before."""
    test, due = "truth and detections", boxes.due(seen, RIGHT)
    usual, best = explained(seen, RIGHT, due), (0, 0, 0.0)
    for lag in LATE:
        late, there = _earlier(seen, frames, sensors.mount, lag)
        other = explained(late, RIGHT, boxes.due(late, RIGHT))
        n, m, *_ = seen.tally(other, usual, there, len(sensors.names)).sum(0).tolist()
        best = max(best, (n - m, m, lag))
    if best[0] + best[1] >= LEAST and best[0] + best[1] > CLEAR * best[1]:
        figure = f"{best[0] + best[1]} cells of scans fit only with that, {best[1]} only without"
        remedy = f"subtract about {best[2]:.1f} s from the times of detections and scans, or check the truth"
        return Finding(test, figure, f"detections may be about {best[2]:.1f} s late", DOUBT, remedy)
    hit, all_ = _hits(seen, boxes, sensors, usual)
    if all_ < BOXES:
        return Finding(test, "few boxes are in sight", OPEN, OPEN)
    figure = f"{hit} of {all_} boxes in sight have a detection"
    if hit >= HIT * all_:
        return Finding(test, figure, GOOD, GOOD)
    return Finding(test, figure, "they are at different places", DOUBT, "give both in one frame, and check the mounts")


def _earlier(seen: Seen, frames: Sequence[RecordedFrame], mount: NDArray, lag: float) -> tuple[Seen, NDArray]:
    """Detections as if they were `lag` [s] before, and which (N,) have a scan there."""
    time = np.array([f.scene.time for f in frames])
    scan = np.clip(np.searchsorted(time, seen.time - lag - NEAREST), 0, len(time) - 1)
    egos = [f.scene.ego for f in frames]
    ego, v, w = (np.array([getattr(e, n) for e in egos])[scan] for n in ("pose", "velocity", "yaw_rate"))
    pose = compose(ego, mount[seen.sensor])
    own = turned(point_velocity(v, w, pose[:, :2] - ego[:, :2]), -pose[:, 2])
    return seen._replace(scan=scan, pose=pose, velocity=own), np.abs(time[scan] - seen.time + lag) <= NEAREST


def _hits(seen: Seen, boxes: Boxed, sensors: SensorSheets, usual: NDArray) -> tuple[int, int]:
    """Boxes at scans well in sight of a sensor that have one of its usual (N,) detections, and all that are there."""
    _, first, of = np.unique(seen.scan * len(sensors.names) + seen.sensor, return_index=True, return_inverse=True)
    i, b = boxes.hits(seen, RIGHT)
    hit = np.unique(of[i[usual[i]]] * len(boxes.scan) + b[usual[i]])
    head = seen.take(first)
    k, b = boxes.at(head.scan)
    xy = to_frame(head.pose[k], boxes.pose[b, None, :2])[:, 0]
    reach, half = (np.array([getattr(m, n) for m in sensors.models])[head.sensor[k]] for n in ("max_range", "fov"))
    near = (np.hypot(*xy.T) < SIGHT * reach) & (np.abs(np.arctan2(xy[:, 1], xy[:, 0])) < SIGHT * half / 2)
    return int(np.isin(k * len(boxes.scan) + b, hit)[near].sum()), int(near.sum())

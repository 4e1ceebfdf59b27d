"""Whether a recording can be right: what was tested, the figure, the reading that fits, and a verdict with a remedy.

Method and equations: docs/methods/plausibility.md.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from testbed.replay.evidence import RIGHT, Boxed, Pairs, Seen, explained, turned
from testbed.replay.fixes import DOUBT, FACTORS, FAULT, GOOD, MEASURED, OPEN, Finding, parse
from testbed.replay.reading import Recorded, read
from testbed.replay.readings import columns, shares
from testbed.replay.recording import RecordedFrame
from testbed.replay.sensor_sheets import SensorSheets
from testbed.replay.ways import ego_speed, truth, yaw_rate
from trackers.geometry import compose, point_velocity, to_frame
from trackers.scan import SensorModel

FAR, BEYOND = 1.25, 0.05  # times `max_range`, and the share of detections that may lie further away
TWICE, SOME = 0.25, 0.1  # share of detections with an equal, of a fault and of a doubt
EGO = ("speed of the ego", "yaw rate of the ego", "reach")  # tests before those of the columns
CROWD, LOST = 10.0, 0.45  # unexplained detections in expected false alarms; share explained below which that counts

LATE = tuple(k / 5 for k in range(-5, 6) if k)  # [s] by which detections may be late
LEAST, PART, CLEAR = 20, 0.1, 4  # cells of scans for it, in those that fit as they are, and in those against it
NEAREST = 0.06  # [s] between times that are one
SIGHT, BOXES, HIT = 0.5, 30, 0.08  # part of the view and reach, boxes in it that are due, share that has a detection


def judged(
    folder: Path, start: float | None = None, end: float | None = None, fixes: Sequence[str] = ()
) -> tuple[Recorded, list[Finding]]:
    """The recording of a folder with its fixes, and all findings on it; errors as in `read` and `parse`."""
    chosen = parse(fixes)
    recorded = read(folder, start, end, chosen)
    if any(fix.how == MEASURED for fix in chosen):
        count, _ = _unexplained(Seen.of(recorded.frames), models := recorded.sensors.models)
        models = tuple(replace(m, clutter=max(float(n), m.clutter)) for m, n in zip(models, count, strict=True))
        recorded = recorded._replace(sensors=recorded.sensors._replace(models=models))
    found = [_names_of(recorded), *examine(recorded.frames, recorded.sensors)]
    return recorded, [f if f.verdict in (DOUBT, FAULT) else f._replace(remedy="") for f in found]


def _names_of(recorded: Recorded) -> Finding:
    """Columns that are not read; a fault where the range rates seem to be one of them."""
    other = [one for one in recorded.unread if one.like]
    said = ", ".join(f"{one.name} of {one.file}" for one in recorded.unread)
    if not other:
        return Finding("columns", f"not read: {said}" if said else "all are read", GOOD, GOOD)
    one = min(other, key=lambda one: one.like != "range_rate")
    rates = one.like == "range_rate"
    remedy = f"rename it{f', or read it with --fix {one.name}=range_rate' * rates}"
    figure = f"{one.name} of {one.file} is not read"
    return Finding("columns", figure, f"it seems to be {one.like}", FAULT if rates else DOUBT, remedy)


def examine(frames: Sequence[RecordedFrame], sensors: SensorSheets) -> list[Finding]:
    """All findings on the frames of a recording."""
    seen, boxes = Seen.of(frames), Boxed.of(frames)
    said, speed = truth(frames), ego_speed(frames)
    ways = [speed, *([] if faults([speed]) else [yaw_rate(frames)]), *said]
    if not len(seen.scan):
        return [*ways, Finding("detections", "none", OPEN, OPEN)]
    found = [*ways, _reach(seen, sensors), _equals(seen)]
    if any(one.test in EGO and one.verdict == FAULT for one in found):
        return found  # all else follows from these
    found = [*columns(seen, boxes, sensors, bool(said) and not faults(said)), shares(seen), *found]
    if faults(found):
        return found
    return [*found, *[_together(seen.thinned(), boxes, frames, sensors)] * len(said[:1]), _crowd(seen, sensors)]


def faults(found: Sequence[Finding]) -> list[str]:
    """Sentences of the definite faults."""
    return [f.sentence for f in found if f.verdict == FAULT]


def _reach(seen: Seen, sensors: SensorSheets) -> Finding:
    """Ranges against the data sheet."""
    limit = np.array([model.max_range for model in sensors.models])[seen.sensor]
    share = float((seen.polar[:, 0] > FAR * limit).mean())
    figure = f"{share:.1%} are beyond {FAR:g} times max_range"
    if share <= BEYOND:
        return Finding("reach", figure, GOOD, GOOD)
    fits = next(
        (u for u in ("ft", "cm", "mm") if (FACTORS[u] * seen.polar[:, 0] > FAR * limit).mean() < BEYOND), "too far"
    )
    remedy = f"read them with --fix range={fits}, or correct" if fits in FACTORS else "correct"
    return Finding(
        "reach", figure, f"ranges may be in {fits}" if fits in FACTORS else fits, FAULT, f"{remedy} max_range"
    )


def _equals(seen: Seen) -> Finding:
    """Detections that are there more than once."""
    rows = np.column_stack([seen.time, seen.polar])
    share = 1 - len(np.unique(rows, axis=0, equal_nan=True)) / len(rows)
    verdict = FAULT if share > TWICE else DOUBT if share > SOME else GOOD
    fits = GOOD if verdict == GOOD else "there more than once"
    return Finding(
        "equal detections", f"{share:.1%} of them", fits, verdict, "keep one of each with --fix detections=once"
    )


def _unexplained(seen: Seen, models: Sequence[SensorModel]) -> tuple[NDArray, float]:
    """Detections a scan of each sensor (S,) that neither stand nor are found again, and the share of the others.

    Of those that are due in sight; in half of the scans there are as many, for vehicles that pass by are a few scans.
    """
    pairs = Pairs.of(seen, np.array([model.fov for model in models]), stride=0.0)
    (g, t), (_, there, sure) = pairs.first.over_ground(RIGHT), pairs.again(RIGHT)
    free = ~there & ~(np.abs(g) < t)
    due, lost = (np.bincount(pairs.pair, mask, len(pairs.size)) for mask in (sure, sure & free))
    _, first = np.unique(pairs.pair, return_index=True)
    count, of = pairs.size * lost / np.maximum(due, 1), pairs.first.sensor[first]
    each = [np.median(count[of == s]) if (of == s).any() else 0.0 for s in range(len(models))]
    return np.array(each), 1 - float(free.mean()) if len(free) else 1.0


def _crowd(seen: Seen, sensors: SensorSheets) -> Finding:
    """Detections that nothing explains, against the false alarms that the sensors are said to have."""
    due = sum(model.clutter for model in sensors.models)
    if not np.isfinite(seen.polar[:, 2]).any():
        return Finding("detections a scan", "no scans with range rates to compare", OPEN, OPEN)
    each, share = _unexplained(seen, sensors.models)
    count = each.sum()
    figure = f"{count:.1f} without an explanation, {due:g} false alarms expected, {share:.0%} explained"
    if count <= CROWD * max(due, 1.0) or share >= LOST:  # (PLA.6)
        return Finding("detections a scan", figure, GOOD, GOOD)
    remedy = "thin them out, or take the false alarms as they are with --fix clutter=measured"
    return Finding("detections a scan", figure, "far more than the sensors are said to have", FAULT, remedy)


def _together(seen: Seen, boxes: Boxed, frames: Sequence[RecordedFrame], sensors: SensorSheets) -> Finding:
    """The finding on detections in boxes (B,) of the truth, and on those that were in them some time before."""
    test, due = "truth and detections", boxes.due(seen, RIGHT)
    usual, best = explained(seen, RIGHT, due), (0, 0, 0, 0.0)
    for lag in LATE:
        late, there = _earlier(seen, frames, sensors.mount, lag)
        other = explained(late, RIGHT, boxes.due(late, RIGHT))
        n, m, *_ = seen.tally(other, usual, there, len(sensors.names)).sum(0).tolist()
        best = max(best, (n - m, n, m, lag))
    fit = seen.tally(usual, ~usual, usual, len(sensors.names))[:, 0].sum()
    _, n, m, lag = best
    if n >= max(LEAST, PART * fit) and n > CLEAR * m:
        figure = f"{n} cells of scans fit only with that, {m} only without"
        remedy = f"subtract about {lag:.1f} s from the times of detections and scans, or check the truth"
        return Finding(test, figure, f"detections may be about {lag:.1f} s late", DOUBT, remedy)
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

"""What one frame draws: a `Frame` becomes rows of plain arrays, one row per entity, no rerun.

A row maps component names (`Points2D:positions`, `radar:doppler`) to a number, or to an array whose first axis counts
instances. Every array is a fresh copy, so the simulation may go on changing its own.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sensors.origin import KINDS
from sensors.scene import Bodies, Ego, Objects, Scene
from testbed.frame import Frame, FrameScore
from testbed.log import palette, paths
from testbed.log.modes import Modes, probabilities
from testbed.log.record import SmoothedTracks
from trackers.geometry import box_corners, ellipse_points, to_world, unit
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import SensorModel


class Strips(NamedTuple):
    """Ragged polylines: all points (P, 2) one after the other, and how many belong to each line, (n,)."""

    xy: NDArray
    counts: NDArray

    @classmethod
    def of(cls, lines: tuple[NDArray, ...] | NDArray, closed: bool = False) -> "Strips":
        """Polylines (C, 2) each, of equal length as one array (n, C, 2); `closed` ones end where they began."""
        if isinstance(lines, np.ndarray):
            rings = np.concatenate([lines, lines[:, :1]], 1) if closed else lines
            return cls(np.array(rings.reshape(-1, 2), np.float32), np.full(len(rings), rings.shape[1], np.int64))
        if closed:
            lines = tuple(np.concatenate([line, line[:1]]) for line in lines)
        flat = np.concatenate(lines) if len(lines) else np.zeros((0, 2))
        return cls(np.array(flat, np.float32), np.array([len(line) for line in lines], np.int64))

    def __len__(self) -> int:
        return len(self.counts)


Row = dict[str, NDArray | Strips | list[str] | float | int]
Rows = dict[str, Row]

CONFIDENCE_RADIUS = 2.4477  # sqrt of the 95 % quantile of chi-square with 2 degrees of freedom
ABOVE, BELOW = 1.4, 1.6  # [m] names of vehicles stand above their box, ids of tracks below
LIKELY = 0.5  # probability of a class above which it is in the label of its track
NOSE = 1.0  # [m] heading arrows reach this far beyond the front


def scene_rows(scene: Scene, middle: float | None = None, visible: NDArray | None = None) -> Rows:
    """Truth in grey: outlines, headings and names of all objects, the ego and the origin that follows it.

    The origin keeps to y = `middle` [m] where given: a view of a straight road then does not sway in lane changes.
    Objects are dimmed by their visible shares (N,), where given.
    """
    ego, objects, bodies = scene.ego, scene.objects, scene.bodies
    color = palette.dimmed(palette.TRUTH, np.ones(len(objects.id)) if visible is None else visible)
    y = ego.pose[1] if middle is None else middle
    return {
        paths.FOLLOW: {"Transform3D:translation": np.array([[ego.pose[0], y, 0.0]], np.float32)},
        paths.EGO: _ego_pose(ego),
        paths.TRUTH_EGO: {"LineStrips2D:strips": Strips.of((ego.outline,), closed=True)},
        paths.TRUTH_CONTOUR: _outlines(objects, bodies) | {"LineStrips2D:colors": color[bodies.owner]},
        paths.TRUTH_HEADING: _headings(objects.pose, objects.size[:, 0]) | {"Arrows2D:colors": color},
        paths.TRUTH_NAMES: {
            "Points2D:positions": _beside(objects.pose, objects.size, -ABOVE),
            "Points2D:labels": [
                f"{paths.vehicle(i)} {k}" for i, k in zip(objects.id.tolist(), objects.kind, strict=True)
            ],
            "Points2D:colors": color,
        },
    }


def _beside(pose: NDArray, size: NDArray, gap: float) -> NDArray:
    """Places (n, 2) [m] above boxes on the screen, by -`gap` [m], or below them."""
    across = np.abs(size[:, 1] / 2 * np.cos(pose[:, 2])) + np.abs(size[:, 0] / 2 * np.sin(pose[:, 2]))
    return np.array(pose[:, :2] + np.stack([0 * across, np.sign(gap) * across + gap], -1), np.float32)


def overview_row(origin: tuple[float, float]) -> Rows:
    """Origin of the overview at x, y [m]."""
    return {paths.OVERVIEW: {"Transform3D:translation": np.array([[*origin, 0.0]], np.float32)}}


def _ego_pose(ego: Ego) -> Row:
    half = ego.pose[2] / 2
    return {
        "Transform3D:translation": np.array([[ego.pose[0], ego.pose[1], 0.0]], np.float32),
        "Transform3D:quaternion": np.array([[0.0, 0.0, np.sin(half), np.cos(half)]], np.float32),
    }


def _outlines(objects: Objects, bodies: Bodies) -> Row:
    owner = objects.id[bodies.owner] if len(bodies.owner) else np.zeros(0, int)
    return {
        "LineStrips2D:strips": Strips.of(bodies.outline, closed=True),
        "LineStrips2D:class_ids": np.array(owner + 1, np.uint16),
        "truth:object_id": np.array(owner, np.int32),
        "truth:object_color": palette.identity(owner),
    }


def _headings(pose: NDArray, length: NDArray) -> Row:
    reach = (length / 2 + NOSE)[:, None] * unit(pose[:, 2])
    return {"Arrows2D:origins": np.array(pose[:, :2], np.float32), "Arrows2D:vectors": np.array(reach, np.float32)}


def wall_rows(walls: NDArray) -> Rows:
    """Guard rails (W, 2, 2) [m]."""
    return {paths.WALLS: {"LineStrips2D:strips": Strips.of(walls)}}


def plan_rows(plan: NDArray) -> Rows:
    """Where the planner means to go (P, 2) [m]; nothing for fewer than two points."""
    return {paths.EGO_PLAN: {"LineStrips2D:strips": Strips.of((plan,) if len(plan) > 1 else ())}}


def detection_rows(frame: Frame, trackers: Iterable[str]) -> Rows:
    """Detections by kind: what the radar measured, their origin, and to which track each tracker assigned them."""
    scan, origin = frame.scan, frame.origin
    keep = np.flatnonzero(scan.mask)
    ids = np.append(frame.scene.objects.id, -1).astype(np.int32)
    object_id = ids[origin.object[keep]]
    sensor = np.broadcast_to(scan.sensor, scan.mask.shape)[keep].astype(np.int32)
    columns: dict[str, NDArray] = {
        "Points2D:positions": scan.xy[keep].astype(np.float32),
        "radar:doppler": scan.ground_rate[keep].astype(np.float32),
        "radar:object_id": object_id,
        "radar:object_color": palette.identity(object_id),
        "radar:sensor": sensor,
    }
    for name in trackers:
        owner = frame.outputs[name][1].owner[keep]
        columns[f"radar:owner_{paths.plain(name)}"] = owner.astype(np.int32)
        columns[f"radar:owner_color_{paths.plain(name)}"] = palette.identity(owner)
    kind = origin.kind[keep]
    return {
        paths.detections(word): {component: column[kind == k] for component, column in columns.items()}
        for k, word in enumerate(KINDS)
    }


def tracker_rows(name: str, tracks: Tracks, info: StepInfo, modes: Sequence[str] = (), index: int = 0) -> Rows:
    """Boxes or contours, 95 % ellipses of the centre, headings and ids of the reported tracks; the others thin.

    The label is the id, then the most likely of the motion models `modes`, then the class if its probability is above
    `LIKELY`. Labels of the tracker with the number `index` stand that many lines farther below their boxes.
    """
    shown = tracks.existence > 0.5
    hidden = tracks.rows(~shown).estimate
    tracks = tracks.reported
    estimate = tracks.estimate
    outline = box_corners(estimate.pose, estimate.size) if estimate.contour is None else estimate.contour
    labels = _labels(tracks, info, modes)
    cov = estimate.cov[:, :2, :2]
    known = np.isfinite(cov).all((-2, -1))  # not of tracks from files without covariances
    ellipse = ellipse_points(estimate.pose[known, :2], CONFIDENCE_RADIUS**2 * cov[known], 17)
    return {
        paths.tracker(name, "extent"): {
            "LineStrips2D:strips": Strips.of(outline, closed=True),
            "track:id": tracks.id.astype(np.int32),
            "track:color": palette.identity(tracks.id),
        },
        paths.tracker(name, "tentative"): {
            "LineStrips2D:strips": Strips.of(box_corners(hidden.pose, hidden.size), closed=True)
        },
        paths.tracker(name, "covariance"): {"LineStrips2D:strips": Strips.of(ellipse)},
        paths.tracker(name, "heading"): _headings(estimate.pose, estimate.size[:, 0]),
        paths.tracker(name, "center"): {
            "Points2D:positions": np.array(estimate.pose[:, :2], np.float32),
            "Points2D:labels": labels,
        },
        paths.tracker(name, "label"): {
            "Points2D:positions": _beside(estimate.pose, estimate.size, (1 + index) * BELOW),
            "Points2D:labels": labels,
        },
    }


def change_rows(name: str, tracks: Tracks, info: StepInfo) -> Rows:
    """Contours that changed in this frame, before and after, at the present pose of their tracks."""
    contours = {event.track: event.contours for event in info.events if event.contours is not None}
    rows = [row for row, i in enumerate(tracks.id.tolist()) if i in contours]
    if not rows:
        return {}
    number = tracks.id[rows]
    rings = to_world(tracks.estimate.pose[rows, None], np.stack([contours[i] for i in number.tolist()]))
    return {
        paths.tracker(name, layer): {
            "LineStrips2D:strips": Strips.of(rings[:, k], closed=True),
            "track:id": number.astype(np.int32),
        }
        for k, layer in enumerate(paths.CHANGE_LAYERS)
    }


def no_change_rows(name: str) -> Rows:
    """Rows that remove the contours of `change_rows`."""
    nothing: Row = {"LineStrips2D:strips": Strips.of(()), "track:id": np.zeros(0, np.int32)}
    return {paths.tracker(name, layer): dict(nothing) for layer in paths.CHANGE_LAYERS}


def _labels(tracks: Tracks, info: StepInfo, modes: Sequence[str]) -> list[str]:
    moves = {track: modes[int(p.argmax())] for track, p in probabilities(info, modes).items()}
    ids = tracks.id.tolist()
    known = dict.fromkeys(ids, "")
    p, classes = tracks.estimate.class_probability, tracks.memory.classes
    if classes and p is not None:
        known |= {i: classes[int(own.argmax())] for i, own in zip(ids, p, strict=True) if own.max() > LIKELY}
    return [" ".join(filter(None, (str(i), moves.get(i), known[i]))) for i in ids]


def smoothed_extents(smoothed: SmoothedTracks) -> list[Row]:
    """Boxes of the smoothed tracks at each frame, with their ids and headings."""
    tracks = smoothed.tracks
    frame = np.concatenate([np.zeros(0, int), *(track.frame for track in tracks)])
    order = np.argsort(frame, kind="stable")
    number = np.repeat([track.id for track in tracks], [len(track.frame) for track in tracks])[order]
    pose = np.concatenate([np.zeros((0, 3)), *(track.pose for track in tracks)])[order]
    size = np.concatenate([np.zeros((0, 2)), *(track.size for track in tracks)])[order]
    at = np.searchsorted(frame[order], np.arange(len(smoothed.step) + 1))
    return [
        {
            "LineStrips2D:strips": Strips.of(box_corners(pose[a:b], size[a:b]), closed=True),
            "track:id": number[a:b].astype(np.int32),
            "track:heading": pose[a:b, 2].astype(np.float32),
        }
        for a, b in pairwise(at)
    ]


def smoothed_paths(smoothed: SmoothedTracks) -> Row:
    """Where the centre of each smoothed track went, from the first frame to the last."""
    return {
        "LineStrips2D:strips": Strips.of(tuple(track.pose[:, :2] for track in smoothed.tracks)),
        "track:id": np.array([track.id for track in smoothed.tracks], np.int32),
    }


def metric_rows(name: str, score: FrameScore) -> Rows:
    """Metrics of the whole frame, one entity each."""
    return {paths.metric(metric, name): scalar_row(value) for metric, value in score.mean.items()}


def object_rows(frame: Frame, scores: Mapping[str, FrameScore], modes: Modes = MappingProxyType({})) -> Rows:
    """Detections, expected number and visible share of each object, and errors of each tracker with a track on it.

    Where a tracker mixes the motion models `modes`, their probabilities stand beside the errors.
    """
    ids, origin = frame.scene.objects.id, frame.origin
    of_object = origin.object[frame.scan.mask]
    got = np.bincount(of_object[of_object >= 0], minlength=len(ids))
    rows: Rows = {}
    for i, number in enumerate(ids):
        rows[paths.of_object(number, paths.SEEN)] = _numbers(
            "radar", {"detections": got[i], "expected": origin.expected[i], "visible": origin.visible[i]}
        )
    for name, score in scores.items():
        names = modes.get(name, ())
        known = probabilities(frame.outputs[name][1], names)
        for number, errors in score.errors.items():
            row = _numbers("metrics", errors)
            track = int(score.pairs[number])
            row["metrics:track_id"] = track
            p = known.get(track, np.full(len(names), np.nan))
            rows[paths.of_object(number, name)] = row | _numbers("mode", dict(zip(names, p, strict=True)))
    return rows


def gap_row(row: Row) -> Row:
    """The row that interrupts the curves of an object without a track: NaN errors, track id -1."""
    return {name: -1 if name == "metrics:track_id" else float("nan") for name in row}


def _numbers(archetype: str, values: dict[str, float]) -> Row:
    return {f"{archetype}:{paths.part(key)}": float(value) for key, value in values.items()}


def scalar_row(value: float) -> Row:
    """One number of a plot; NaN leaves a gap."""
    return {"Scalars:scalars": float(value)}


def fields_of_view(sensors: tuple[SensorModel, ...]) -> tuple[NDArray, ...]:
    """Closed sectors (P, 2) [m] of the radars in the frame of the ego; a full circle has no straight edges."""
    lines = []
    for sensor in sensors:
        angle = np.linspace(-sensor.fov / 2, sensor.fov / 2, max(9, int(np.ceil(sensor.fov / 0.05))))
        arc = sensor.max_range * unit(angle)
        ring = sensor.fov >= 2 * np.pi - 1e-6
        lines.append(to_world(np.asarray(sensor.mount), arc if ring else np.vstack([[0, 0], arc, [0, 0]])))
    return tuple(lines)


def dashes(line: ArrayLike, dash: float = 3.0, gap: float = 6.0) -> NDArray:
    """A polyline (P, 2) [m] cut into straight dashes (n, 2, 2), each `dash` long with `gap` between [m]."""
    line = np.asarray(line, float)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    start = np.arange(0.0, arc[-1], dash + gap)
    at = np.stack([start, np.minimum(start + dash, arc[-1])], -1)
    return np.stack([np.interp(at, arc, line[:, 0]), np.interp(at, arc, line[:, 1])], -1)

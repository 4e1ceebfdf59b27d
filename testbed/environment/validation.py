"""Validation of tracks: what every step of a tracker must return, checked before anything is made of it.

A number that cannot be right would enter measures, logs and planners in silence. Here it ends the run, in a sentence
that names tracker, step, track and value. The check takes a few hundredths of a millisecond, whatever the tracker.
"""

from collections.abc import Mapping
from math import pi
from typing import Any

import numpy as np
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

from testbed.limits import UnfitPolicy
from trackers.estimate import Estimate
from trackers.multi.tracks import StepInfo, Tracks

TRACKS = ("id", "existence", "hits", "age", "confirmed")  # (T,)
ESTIMATE: Mapping[str, tuple[int, ...]] = {  # axes behind T
    "pose": (3,), "velocity": (2,), "yaw_rate": (), "size": (2,), "cov": (4, 4),
    "size_std": (2,), "heading_std": (), "yaw_rate_std": (),
}  # fmt: skip
INFO = ("expected", "in_view", "detections", "log_ratio", "nis")  # as many as `track`
WHERE = "see Tracks and Estimate in trackers"
FINITE = np.finfo(float).max
FREE, STD = (-FINITE, FINITE, "finite"), (0.0, FINITE, "finite and not negative, in SI units and rad")
COLUMNS: Mapping[str, tuple[float, float, str]] = {  # least and greatest value, in words
    "existence": (0.0, 1.0, "a probability within 0 and 1"),
    "age": (0.0, FINITE, "finite and not negative, in seconds"),
    "hits": (0.0, FINITE, "a count"),
    "x": FREE,
    "y": FREE,
    "heading": (-2 * pi, 2 * pi, "in rad and within a turn; wrap it, or convert degrees with np.radians"),
    "velocity x": FREE,
    "velocity y": FREE,
    "yaw_rate": FREE,
    **dict.fromkeys(("length", "width"), (1e-6, FINITE, "positive, the full size in metres")),
    **dict.fromkeys(("length_std", "width_std", "heading_std", "yaw_rate_std"), STD),
}
LEAST, MOST = (np.array([limits[side] for limits in COLUMNS.values()]) for side in (0, 1))
ROUNDING = 1e-6  # of the largest entry of a covariance


class WrongTracks(ValueError):
    """A tracker has returned what cannot be tracks; one sentence names tracker, step and value."""


OF_USERS = (WrongTracks, InvalidAction, UnfitPolicy)  # a tracker, planner or policy does not fit; a sentence says how


def check_tracks(tracks: Any, name: str, when: str) -> None:
    """Raise `WrongTracks` for what is no `Tracks` of plausible numbers; `when` says which step of tracker `name`."""
    fault = _fault_of(tracks)
    if fault:
        raise WrongTracks(f"tracker {name}, {when}: {fault}")


def check_output(output: Any, detections: int, name: str, when: str) -> None:
    """Raise `WrongTracks` for what `step` must not return for a scan with so many detections, padding included."""
    if not (isinstance(output, tuple) and len(output) == 2 and isinstance(output[1], StepInfo)):
        kinds = [type(part).__name__ for part in output] if type(output) is tuple else type(output).__name__
        raise WrongTracks(f"tracker {name}, {when}: step must return a tuple of Tracks and StepInfo, got {kinds}")
    tracks, info = output
    check_tracks(tracks, name, when)
    shapes = {"owner": (detections,), **dict.fromkeys(INFO, np.shape(info.track)[:1])}
    for field, due in shapes.items():
        if np.shape(getattr(info, field)) != due:
            got = np.shape(getattr(info, field))
            raise WrongTracks(f"tracker {name}, {when}: {field} of its StepInfo has the shape {got}, not {due}")


def _fault_of(tracks: Any) -> str:
    """What is wrong, empty where nothing is; faults of shape come before those of numbers."""
    if not (isinstance(tracks, Tracks) and isinstance(tracks.estimate, Estimate)):
        kind = f"Tracks of {type(tracks.estimate).__name__}" if isinstance(tracks, Tracks) else type(tracks).__name__
        return f"tracks must be Tracks of an Estimate, got {kind}; {WHERE}"
    e, count = tracks.estimate, np.shape(tracks.id)
    if len(count) != 1:
        return f"id has the shape {count}, not (T,) of T tracks; {WHERE}"
    fields = [(name, getattr(tracks, name), ()) for name in TRACKS]
    for field, value, tail in fields + [(name, getattr(e, name), tail) for name, tail in ESTIMATE.items()]:
        if not isinstance(value, np.ndarray) or value.shape != count + tail or value.dtype.kind not in "biuf":
            got = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
            return f"{field} must be an array of numbers of shape {count + tail}, got {got}; {WHERE}"
    if len(set(tracks.id.tolist())) < count[0]:
        ids, seen = np.unique(tracks.id, return_counts=True)
        return f"id {ids[seen.argmax()]} stands for {seen.max()} of {count[0]} tracks; each needs an id of its own"
    table = np.empty((*count, len(COLUMNS)))
    table[:, 0], table[:, 1], table[:, 2], table[:, 8] = tracks.existence, tracks.age, tracks.hits, e.yaw_rate
    table[:, 3:6], table[:, 6:8], table[:, 9:11], table[:, 11:13] = e.pose, e.velocity, e.size, e.size_std
    table[:, 13], table[:, 14] = e.heading_std, e.yaw_rate_std
    good = (table >= LEAST) & (table <= MOST)
    if not good.all():
        row, column = np.argwhere(~good)[0]
        name, (*_, words) = list(COLUMNS.items())[column]
        return f"{name} of track {tracks.id[row]} is {table[row, column]:.6g}; it must be {words}"
    return _fault_of_cov(tracks.id, e.cov) or _fault_of_rest(tracks)


def _fault_of_cov(ids: NDArray, cov: NDArray) -> str:
    """What is wrong with covariances (T, 4, 4) of x, y, vx, vy: they may be singular, but for rounding not negative."""
    try:
        np.linalg.cholesky(cov)  # the usual case, decided at little cost
        if (cov == cov.mT).all() and np.isfinite(cov).all():
            return ""
    except np.linalg.LinAlgError:
        pass
    for number, P in zip(ids, cov, strict=True):
        room = ROUNDING * np.abs(P).max()
        if not np.isfinite(P).all():
            return f"cov of track {number} is not finite"
        if np.abs(P - P.T).max() > room:
            return f"cov of track {number} is not symmetric, by {np.abs(P - P.T).max():.3g}; return (P + P.mT) / 2"
        if (least := np.linalg.eigvalsh(P)[0]) < -room:
            return f"cov of track {number} has the eigenvalue {least:.3g}; a covariance has none below 0"
    return ""


def _fault_of_rest(tracks: Tracks) -> str:
    """What is wrong with contours and class probabilities, where there are any."""
    contour, p, count = tracks.estimate.contour, tracks.estimate.class_probability, tracks.id.shape
    shape = () if contour is None else np.shape(contour)
    if contour is not None and not (len(shape) == 3 and shape[:1] == count and shape[2] == 2):
        return f"contour must have the shape (T, C, 2), got {shape}"
    if contour is not None and not np.isfinite(contour).all():
        return "contour has a point that is not finite"
    if p is not None and not (np.shape(p)[:1] == count and (p >= 0).all() and (p <= 1 + ROUNDING).all()):
        return "class_probability must be (T, C) of probabilities within 0 and 1"
    names = tracks.memory.classes
    if p is not None and names is not None and np.shape(p)[1:] != (len(names),):
        return f"class_probability has the shape {np.shape(p)}, and memory.classes names {', '.join(names)}"
    return ""

"""Moments in which averages do not count, on recorded drives: the motion across of one vehicle, scan by scan."""

from dataclasses import fields, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import sensors
from testbed.replay.recording import Recording, record
from trackers import build
from trackers.geometry import wrap_angle
from trackers.motion.modes import Modes
from trackers.multi.tracker import MultiObjectTracker
from trackers.pmht import SplinePmht

SIGHT = 16.0  # [m] ahead of the ego, from which on it is passed


class Moment(NamedTuple):
    """One vehicle at N scans, and the track on it, NaN without one; sideways is to the left of its lane."""

    time: NDArray  # (N,) [s]
    ahead: NDArray  # (N,) [m] centre, ahead of the ego's
    across: NDArray  # (N, 2) [m/s] true and estimated velocity along y
    across_std: NDArray  # (N,) [m/s] claimed
    offset: NDArray  # (N,) [m] estimated less true y of the centre
    turn: NDArray  # (N, 2) [rad] error of the heading, and its claimed standard deviation
    track: NDArray  # (N,) id, -1 without one


@lru_cache(maxsize=64)
def recorded(name: str, seed: int, duration: float) -> Recording:
    """A drive on the truth."""
    return record(name, seed, "surround", duration)


def watch(tracker: MultiObjectTracker, recording: Recording, kind: int = 0) -> Moment:
    """The object in row `kind` of the scene, and the reported track nearest to it within 3 m."""
    tracker, rows = replace(tracker, road=recording.road), []
    tracks = tracker.start()
    for frame in recording.frames:
        tracks, _ = tracker.step(tracks, frame.scan, frame.scene.dt)
        o, ego, out = frame.scene.objects, frame.scene.ego, tracks.reported
        distance = np.hypot(*(out.estimate.pose[:, :2] - o.pose[kind, :2]).T)
        row = [frame.scene.time, o.pose[kind, 0] - ego.pose[0], o.velocity[kind, 1]]
        if not distance.size or distance.min() > 3.0:
            rows.append([*row, *[np.nan] * 5, -1])
            continue
        e = out.estimate
        t = int(distance.argmin())
        turn = float(wrap_angle(e.pose[t, 2] - o.pose[kind, 2]))
        across = [e.velocity[t, 1], np.sqrt(e.cov[t, 3, 3]), e.pose[t, 1] - o.pose[kind, 1]]
        rows.append([*row, *across, turn, e.heading_std[t], out.id[t]])
    a = np.array(rows).T
    return Moment(a[0], a[1], a[2:4].T, a[4], a[5], a[6:8].T, a[8])


class Blind(SplinePmht):
    """pmht-spline that takes sensors to see everywhere."""

    def on_sensors(self, sensors: tuple) -> "Blind":
        """The same: data sheets are not read."""
        return self


def tracker(blind: bool = False, sure: bool = False, lazy: bool = False) -> MultiObjectTracker:
    """imm-spline; without fields of view, without the doubt about ellipses, or without onsets of turns."""
    models = sensors.find("surround").models
    built = build("imm-spline", models)
    place, motion = built.filter.place, built.filter.motion
    if sure:
        place = replace(place, doubt=0.0)
    if blind:
        place = Blind(**{f.name: getattr(place, f.name) for f in fields(place)} | {"sensors": ()})
    if lazy:
        motion = replace(motion, modes=Modes(tuple(replace(mode, onset=0.0) for mode in motion.modes.table)))
    return replace(built, filter=replace(built.filter, place=place, motion=motion))


def inward(moment: Moment) -> tuple[NDArray, float]:
    """Velocities (N, 2) towards the side that the vehicle moves to, and the time [s] at which it has 0.1 m/s."""
    v = moment.across[:, 0]
    side = np.sign(v[np.abs(v).argmax()])
    return side * moment.across, float(moment.time[np.abs(v) > 0.1][0])

"""What is kept of every frame to find the worst moments of a run afterwards: a few small arrays a scan.

Keeping costs some ten microseconds a scan; everything else is worked out when it is asked for.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import GHOSTS, Origin
from sensors.scene import Objects
from testbed.evaluation.ends import Ends
from testbed.frame import Frame
from trackers.geometry import box_corners
from trackers.multi.tracks import REPORT_ABOVE, StepInfo, Tracks

NOTHING, GHOST = -1, -2  # in place of an object: the source of clutter and standing returns, and of ghosts
BESIDE = 1 << 20  # larger than the id of any object
DEATHS = ("died", "merged")


class Output(NamedTuple):
    """The T reported tracks of one tracker after a scan, and the sources of their detections."""

    id: NDArray  # (T,) int
    pose: NDArray  # (T, 3) x, y [m], heading [rad]
    velocity: NDArray  # (T, 2) [m/s]
    size: NDArray  # (T, 2) [m]
    owned: NDArray  # (P, 3) int: track, its source (an object's id, NOTHING or GHOST), number of detections
    deaths: tuple[tuple[int, str], ...]  # track, and why it ended


class Snapshot(NamedTuple):
    """One scan of N objects."""

    time: float  # [s]
    ego: NDArray  # (3,) pose
    objects: Objects
    row: dict[int, int]  # id of an object -> its row
    visible: NDArray  # (N,) share that no other object hides
    expected: NDArray  # (N,) detections
    detections: NDArray  # (N,) int, measured
    ends: NDArray  # (N,) int, number of ends that the radar has hit so far
    outputs: dict[str, Output]  # by name of the tracker


class Snapshots:
    """Every frame of a run, in the order of time: an observer."""

    def __init__(self) -> None:
        self.frames: list[Snapshot] = []
        self._ends = Ends()

    def __call__(self, frame: Frame) -> None:
        """Keep one frame."""
        objects, origin = frame.scene.objects, frame.origin
        real = origin.object[origin.object >= 0]
        ends = np.zeros(len(objects.id), int)
        if len(origin.object) == len(frame.scan.mask):
            ends = self._ends.step(objects, origin, frame.scan.xy)
        source = _sources(objects, origin)
        self.frames.append(
            Snapshot(
                frame.time,
                frame.scene.ego.pose,
                objects,
                {i: row for row, i in enumerate(objects.id.tolist())},
                origin.visible,
                origin.expected,
                np.bincount(real, minlength=len(objects.id)),
                ends,
                {name: _output(tracks, info, source) for name, (tracks, info) in frame.outputs.items()},
            )
        )

    @property
    def time(self) -> NDArray:
        """Times (F,) [s]."""
        return np.array([frame.time for frame in self.frames])


def _sources(objects: Objects, origin: Origin) -> NDArray:
    """The source (M,) of each detection: the id of an object, NOTHING or GHOST."""
    nothing = np.where(np.isin(origin.kind, GHOSTS), GHOST, NOTHING)
    return np.where(origin.object >= 0, np.append(objects.id, NOTHING)[origin.object], nothing)


def _output(tracks: Tracks, info: StepInfo, source: NDArray) -> Output:
    shown, estimate = tracks.existence > REPORT_ABOVE, tracks.estimate
    owned = np.zeros((0, 3), int)
    if len(info.owner) == len(source):
        mine = info.owner >= 0
        key, count = np.unique(info.owner[mine] * BESIDE + source[mine] - GHOST, return_counts=True)
        owned = np.stack([key // BESIDE, key % BESIDE + GHOST, count], -1)
    deaths = tuple((event.track, event.reason) for event in info.events if event.kind in DEATHS)
    return Output(tracks.id[shown], estimate.pose[shown], estimate.velocity[shown], estimate.size[shown], owned, deaths)


def hiding(frame: Snapshot, key: int) -> tuple[int, float]:
    """The object that hides most of object `key` from the ego, and the share of the view that it covers.

    Shares are of the angle under which the box appears from the centre of the ego; (NOTHING, 0.0) where nothing does.
    """
    row = frame.row[key]
    if len(frame.row) < 2:
        return NOTHING, 0.0
    offset = box_corners(frame.objects.pose, frame.objects.size) - frame.ego[:2]  # (N, 4, 2)
    middle = frame.objects.pose[row, :2] - frame.ego[:2]
    forward = offset @ middle
    side = np.arctan2(middle[0] * offset[..., 1] - middle[1] * offset[..., 0], forward)  # (N, 4) bearings
    low, high = side.min(-1), side.max(-1)
    overlap = np.minimum(high, high[row]) - np.maximum(low, low[row])
    distance = np.hypot(*(frame.objects.pose[:, :2] - frame.ego[:2]).T)
    share = np.where((forward > 0).all(-1) & (distance < distance[row]), overlap / max(high[row] - low[row], 1e-9), 0.0)
    share[row] = 0.0
    best = int(share.argmax())
    return (int(frame.objects.id[best]), float(share[best])) if share[best] > 0 else (NOTHING, 0.0)

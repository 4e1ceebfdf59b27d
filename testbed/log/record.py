"""What one simulated frame hands to the log: plain data, no rerun."""

from typing import NamedTuple

from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Scene
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan


class TrackerFrame(NamedTuple):
    """One tracker at one frame."""

    tracks: Tracks
    info: StepInfo
    pairs: dict[int, int]  # object id -> id of the reported track assigned to it
    errors: dict[int, dict[str, float]]  # object id -> metric name -> value, for the assigned pairs
    mean: dict[str, float]  # metric name -> value of this frame (gospa, mean gwd over pairs, ...), NaN where undefined


class SmoothedTrack(NamedTuple):
    """One reported track as all its detections say that it was, at the K looks at which it was reported."""

    id: int
    look: NDArray  # (K,) int, of `SmoothedTracks.step`
    pose: NDArray  # (K, 3) x, y [m], heading [rad]
    size: NDArray  # (K, 2) length, width [m]


class SmoothedTracks(NamedTuple):
    """The tracks of one tracker over L looks, smoothed."""

    step: NDArray  # (L,) int
    time: NDArray  # (L,) [s]
    tracks: tuple[SmoothedTrack, ...]
    failed: tuple[int, ...] = ()  # ids of tracks that could not be smoothed: their covariances were none


class StepRecord(NamedTuple):
    """One frame of the simulation."""

    step: int
    time: float  # [s]
    scene: Scene
    scan: Scan
    origin: Origin
    frames: dict[str, TrackerFrame]  # tracker name -> frame, in the order of the command line
    action: str  # what the planner last chose
    plan: NDArray  # (P, 2) [m] where the planner means to go, world frame
    events: tuple[tuple[str, str], ...] = ()  # (level INFO | WARN | ERROR, text)


class RunMeta(NamedTuple):
    """Everything that identifies a run."""

    run_id: str
    scenario: str
    seed: int
    radar: str
    trackers: tuple[str, ...]
    planner: str
    config: dict[str, str]  # what was varied, as text
    versions: dict[str, str]  # package -> version


class RoadGeometry(NamedTuple):
    """What is drawn of the road; each line is a polyline (P, 2) [m] in the world frame."""

    edges: tuple[NDArray, ...] = ()  # continuous lines: borders of the carriageway, lines not to be crossed
    lane_lines: tuple[NDArray, ...] = ()  # lines between lanes, drawn dashed
    surface: tuple[NDArray, ...] = ()  # centre lines of lanes
    half_width: tuple[float, ...] = ()  # [m] of each surface line

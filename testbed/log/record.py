"""What a log holds beside its frames: what identifies the run, the road, the smoothed tracks. No rerun."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from numpy.typing import NDArray

from testbed.files import file_stem

LEVELS = ("off", "metrics", "full")  # nothing; numbers and events; these with all geometry


class SmoothedTrack(NamedTuple):
    """One track, smoothed over all its detections, at the K frames at which it was reported."""

    id: int
    frame: NDArray  # (K,) int, index into `SmoothedTracks.step`
    pose: NDArray  # (K, 3) x, y [m], heading [rad]
    size: NDArray  # (K, 2) length, width [m]


class SmoothedTracks(NamedTuple):
    """The tracks of one tracker over F frames, smoothed."""

    step: NDArray  # (F,) int
    time: NDArray  # (F,) [s]
    tracks: tuple[SmoothedTrack, ...]
    failed: tuple[int, ...] = ()  # ids of tracks that could not be smoothed: a covariance was not definite


class RunMeta(NamedTuple):
    """Everything that identifies a run."""

    run_id: str
    scenario: str
    seed: int
    radar: str
    trackers: tuple[str, ...]
    planner: str
    config: dict[str, Any]  # what was varied, as JSON types
    versions: dict[str, str]  # package -> version
    names: Mapping[int, str] = MappingProxyType({})  # id of an object -> what the user calls it


def run_id(
    scenario: str,
    trackers: Sequence[str],
    radar: str,
    planner: str,
    seed: int,
    duration: float | None = None,
    faults: Sequence[str] = (),
) -> str:
    """Name of a run's files: the same settings give the same name, and replace each other.

    duration [s]: None for the scenario's own, which is not in the name. Colons read `~` there.
    """
    parts = [scenario, "+".join(trackers), radar, planner, f"seed{seed}"]
    parts += [] if duration is None else [f"{float(duration)!r}s".replace(".0s", "s")]
    parts += ["+".join(faults)] if faults else []
    return file_stem(*parts)


class RoadGeometry(NamedTuple):
    """What is drawn of the road; each line is a polyline (P, 2) [m] in the world frame."""

    edges: tuple[NDArray, ...] = ()  # continuous lines: borders of the carriageway, lines not to be crossed
    lane_lines: tuple[NDArray, ...] = ()  # lines between lanes, drawn dashed
    surface: tuple[NDArray, ...] = ()  # centre lines of lanes
    half_width: tuple[float, ...] = ()  # [m] of each surface line

"""One drive, recorded once: the truth and the scans that every tracker of an open-loop comparison gets.

The planner gets the true state, so that the scenes depend on no tracker. A
recording is one `.npz` file of flat arrays: a ragged series is stored as its parts joined, with their lengths beside.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.lanes import lane_shapes
from scenarios.stage import Phase
from sensors.origin import Origin
from sensors.scene import Bodies, Ego, Objects, Scene
from testbed.environment.episode import decisions
from testbed.environment.episode import start as start_episode
from testbed.environment.registration import make
from testbed.files import atomic_file, read_arrays
from testbed.frame import TRUTH, Frame
from testbed.log.record import RoadGeometry
from testbed.log.road_geometry import road_geometry
from testbed.planners import find as find_planner
from trackers.multi.road import RoadMap
from trackers.scan import Scan

Arrays = dict[str, NDArray]
LINES = ("edges", "lane_lines", "surface")


class RecordedFrame(NamedTuple):
    """What a recording keeps of a `Frame`: nothing of trackers and planner."""

    scene: Scene
    scan: Scan
    origin: Origin


class Recording(NamedTuple):
    """All frames of one drive that have a scan."""

    scenario: str
    seed: int
    radar: Any  # name in the catalogue, or the radar itself
    frames: tuple[RecordedFrame, ...]
    phases: tuple[Phase, ...]
    road: RoadMap
    drawn: RoadGeometry
    seconds: dict[str, float]  # wall time: simulation, sensing


def record(
    scenario: str, seed: int, radar: Any, duration: float | None = None, config: Mapping[str, Any] | None = None
) -> Recording:
    """Drive once and keep every frame; the same arguments give the same frames.

    `duration` [s] may be given by itself, or in the configuration of the environment.
    """
    planner = find_planner(TRUTH)
    frames: list[RecordedFrame] = []

    def keep(frame: Frame) -> None:
        frames.append(RecordedFrame(frame.scene, frame.scan, frame.origin))

    start = perf_counter()
    config = dict(config or {}) | ({} if duration is None else {"duration": duration})
    with closing(make(scenario, config, tracker=TRUTH, radar=radar, planner=TRUTH)) as env:
        tracked: Any = env
        tracked.attach(keep)
        start_episode(env, planner, seed)
        shapes = lane_shapes(tracked.unwrapped.road.network)
        for _ in decisions(env, planner):
            pass
        phases = tuple(getattr(tracked.unwrapped, "phases", ()))
        sensing = tracked.seconds["sense"]
    seconds = {"simulation": perf_counter() - start - sensing, "sensing": sensing}
    road = RoadMap.of([(lane.centre, lane.width) for lane in shapes])
    return Recording(scenario, seed, radar, tuple(frames), phases, road, road_geometry(shapes), seconds)


def save(recording: Recording, path: Path) -> None:
    """Write the file; raises OSError, in one sentence, where it cannot be written."""
    arrays = _frames_to_arrays(recording.frames) | {
        "phase_names": np.array([p.name for p in recording.phases], np.str_),
        "phase_times": np.array([(p.start, p.end) for p in recording.phases]).reshape(-1, 2),
        "seconds": np.array([recording.seconds["simulation"], recording.seconds["sensing"]]),
        **{f"road.{name}": value for name, value in recording.road._asdict().items()},
        "drawn.half_width": np.array(recording.drawn.half_width),
    }
    for name in LINES:
        arrays |= _ragged(f"drawn.{name}", getattr(recording.drawn, name), np.zeros((0, 2)))
    with atomic_file(path) as file:
        np.savez_compressed(file, **arrays)


def load(path: Path, scenario: str, seed: int, radar: Any) -> Recording:
    """The recording in a file; raises ValueError, in one sentence, where the file is damaged."""
    try:
        arrays = read_arrays(path)
        lines = {name: tuple(_parts(arrays, f"drawn.{name}")) for name in LINES}
        return Recording(
            scenario,
            seed,
            radar,
            _frames_of_arrays(arrays),
            tuple(
                Phase(str(n), float(a), float(b))
                for n, (a, b) in zip(arrays["phase_names"], arrays["phase_times"], strict=True)
            ),
            RoadMap(arrays["road.a"], arrays["road.b"], arrays["road.half_width"]),
            RoadGeometry(**lines, half_width=tuple(arrays["drawn.half_width"].tolist())),
            dict(zip(("simulation", "sensing"), arrays["seconds"].tolist(), strict=True)),
        )
    except (ValueError, LookupError, TypeError, OverflowError) as error:
        raise ValueError(f"the recording {path} is damaged ({error}); delete it and it is made again") from None


def read_seconds(path: Path) -> dict[str, float]:
    """Wall time that a recording took: simulation, sensing; ValueError as in `load`."""
    try:
        return dict(zip(("simulation", "sensing"), read_arrays(path, ["seconds"])["seconds"].tolist(), strict=True))
    except (ValueError, TypeError) as error:
        raise ValueError(f"the recording {path} is damaged ({error}); delete it and it is made again") from None


# Names of the series are those of the fields; every entry says how to get the array of a frame.
_SERIES: dict[str, Callable[[RecordedFrame], Any]] = {
    "time": lambda k: k.scene.time,
    "dt": lambda k: k.scene.dt,
    **{f"ego.{n}": lambda k, n=n: getattr(k.scene.ego, n) for n in Ego._fields},  # type: ignore[misc]
    **{
        f"objects.{n}": lambda k, n=n: np.asarray(getattr(k.scene.objects, n), np.str_ if n == "kind" else None)  # type: ignore[misc]
        for n in Objects._fields
    },
    **{f"bodies.{n}": lambda k, n=n: getattr(k.scene.bodies, n) for n in Bodies._fields if n != "outline"},  # type: ignore[misc]
    "bodies.corners": lambda k: np.array([len(o) for o in k.scene.bodies.outline], int),
    "bodies.outline": lambda k: np.concatenate([np.zeros((0, 2)), *k.scene.bodies.outline]),
    "walls": lambda k: k.scene.walls,
    **{f"scan.{n}": lambda k, n=n: getattr(k.scan, n) for n in Scan._fields if n != "delivered"},  # type: ignore[misc]
    "scan.delivered": lambda k: np.zeros(0, bool) if k.scan.delivered is None else k.scan.delivered,
    **{f"origin.{n}": lambda k, n=n: getattr(k.origin, n) for n in Origin._fields},  # type: ignore[misc]
}


def _frames_to_arrays(frames: Sequence[RecordedFrame]) -> Arrays:
    arrays: Arrays = {}
    for name, get in _SERIES.items():
        arrays |= _ragged(name, [np.asarray(get(frame)) for frame in frames])
    return arrays


def _frames_of_arrays(arrays: Arrays) -> tuple[RecordedFrame, ...]:
    series = {name: _parts(arrays, name) for name in _SERIES}

    def fields(group: str, type_: Any, k: int, **more: Any) -> Any:
        return type_(**{n: series[f"{group}.{n}"][k] for n in type_._fields if n not in more}, **more)

    frames = []
    for k in range(len(series["time"])):
        ends = np.cumsum(series["bodies.corners"][k])
        outline = tuple(np.split(series["bodies.outline"][k], ends[:-1])) if len(ends) else ()
        scene = Scene(
            time=float(series["time"][k]),
            dt=float(series["dt"][k]),
            ego=fields(
                "ego",
                Ego,
                k,
                yaw_rate=float(series["ego.yaw_rate"][k]),
                **{name: bool(series[f"ego.{name}"][k]) for name in ("crashed", "on_road")},
            ),
            objects=fields("objects", Objects, k, kind=tuple(series["objects.kind"][k].tolist())),
            bodies=fields("bodies", Bodies, k, outline=outline),
            walls=series["walls"][k],
        )
        delivered = series["scan.delivered"][k]
        scan = fields("scan", Scan, k, delivered=delivered if len(delivered) else None)
        frames.append(RecordedFrame(scene, scan, fields("origin", Origin, k)))
    return tuple(frames)


def _ragged(name: str, parts: Sequence[NDArray], none: NDArray | None = None) -> Arrays:
    """A series as one array: stacked where all parts have one shape, else joined along their first axis."""
    if len({part.shape for part in parts}) == 1:
        return {name: np.stack(parts)}
    lengths = np.array([len(part) for part in parts], int)
    joined = np.concatenate(parts) if len(parts) else np.zeros((0, 2)) if none is None else none
    return {name: joined, f"{name}#lengths": lengths}


def _parts(arrays: Arrays, name: str) -> list[NDArray]:
    """The series again."""
    if f"{name}#lengths" not in arrays:
        return list(arrays[name])
    lengths = arrays[f"{name}#lengths"]
    return np.split(arrays[name], np.cumsum(lengths)[:-1]) if len(lengths) else []

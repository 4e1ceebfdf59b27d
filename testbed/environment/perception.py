"""The senses of one vehicle: a radar looks at the scene whenever it is due, and every tracker gets the same look.

Here truth ends: `Scene` goes in, `Tracks` come out. The tracker called "truth" is the exception, by its name: its
tracks are the scene itself, for planners that shall be compared with one that knows everything.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

import sensors
import trackers
from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.belief import advance
from testbed.frame import TRUTH, Observer
from trackers.estimate import Estimate, prior
from trackers.multi.road import RoadMap
from trackers.multi.tracker import MultiObjectTracker
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan, SensorModel


class RadarLike(Protocol):
    """What `Perception` asks of a radar."""

    @property
    def models(self) -> tuple[SensorModel, ...]:
        """Data sheets for the trackers."""

    @property
    def rate(self) -> float | None:
        """Looks per second; None: one a simulated frame."""

    def scan(self, scene: Scene, rng: np.random.Generator) -> tuple[Scan, Origin]:
        """One look."""


class TrackerLike(Protocol):
    """What `Perception` asks of a multi-object tracker."""

    def start(self) -> Tracks:
        """No tracks."""

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        """Tracks after a look that came dt [s] after the one before."""


class Cost(NamedTuple):
    """What one tracker has cost so far."""

    seconds: float = 0.0  # wall time
    scans: int = 0
    updates: int = 0  # tracks with a detection, over all scans

    def after(self, seconds: float, info: StepInfo) -> "Cost":
        """With one more step, which took so many seconds."""
        return Cost(self.seconds + seconds, self.scans + 1, self.updates + int((info.detections > 0).sum()))

    def row(self) -> dict[str, float]:
        """Milliseconds a scan, and microseconds for each track with a detection, NaN without any."""
        return {
            "ms_per_scan": 1e3 * self.seconds / self.scans if self.scans else np.nan,
            "us_per_update": 1e6 * self.seconds / self.updates if self.updates else np.nan,
        }


def radar_of(radar: Any) -> RadarLike:
    """The radar behind a name or {"name": name, parameter: value}; an object is taken as it is."""
    if isinstance(radar, str):
        return sensors.find(radar)
    if isinstance(radar, Mapping):
        name, parameters = _split(radar, "radar")
        return replace(sensors.find(name), **parameters)
    return radar


def tracker_of(tracker: Any, radar: RadarLike) -> TrackerLike | None:
    """The multi-object tracker behind a name, {"name": name, parameter: value} or a filter; None for the truth."""
    if isinstance(tracker, str):
        return None if tracker == TRUTH else MultiObjectTracker(trackers.find(tracker), radar.models)
    if isinstance(tracker, Mapping):
        name, parameters = _split(tracker, "tracker")
        return MultiObjectTracker(trackers.find(name, **parameters), radar.models)
    if hasattr(tracker, "start"):
        return tracker
    return MultiObjectTracker(tracker, radar.models)


def on_road(tracker: TrackerLike | None, road: RoadMap) -> TrackerLike | None:
    """The tracker with the map of the episode, unless it has a map or wants none."""
    if isinstance(tracker, MultiObjectTracker) and tracker.road is None:
        return replace(tracker, road=road)
    return tracker


def label(tracker: Any) -> str:
    """Name of a tracker in tables: its name with the parameters that were changed, or its class."""
    if isinstance(tracker, str):
        return tracker
    if isinstance(tracker, Mapping):
        name, parameters = _split(tracker, "tracker")
        changes = ", ".join(f"{key}={value}" for key, value in parameters.items())
        return f"{name}({changes})" if changes else name
    return type(tracker).__name__


def _split(entry: Mapping[str, Any], what: str) -> tuple[str, dict[str, Any]]:
    """Name and parameters of a dict entry."""
    if "name" not in entry:
        raise ValueError(f"{what} {dict(entry)} has no key 'name'; write {{'name': NAME, PARAMETER: VALUE}}")
    return entry["name"], {key: value for key, value in entry.items() if key != "name"}


def truth_tracks(scene: Scene) -> Tracks:
    """The objects of a scene as N tracks without any doubt; ids are those of the scene."""
    o = scene.objects
    n = len(o.id)
    tiny = 1e-6
    estimate: Estimate = prior(o.pose, o.velocity, o.yaw_rate, o.size, tiny, tiny, tiny, tiny, tiny)
    sure = np.ones(n)
    next_id = int(o.id.max(initial=-1)) + 1
    return Tracks(o.id, sure, np.ones(n, int), np.full(n, scene.time), sure > 0, None, estimate, next_id)


def truth_info(scene: Scene, origin: Origin) -> StepInfo:
    """What a tracker would report that knew the origin of every detection."""
    n = len(scene.objects.id)
    owned = origin.object >= 0
    owner = np.full(len(owned), -1)
    owner[owned] = scene.objects.id[origin.object[owned]]
    count = np.bincount(origin.object[owned], minlength=n)
    seen = origin.visible > 0
    return StepInfo(owner, scene.objects.id, origin.expected, seen, count, np.zeros(n), np.full(n, np.nan), ())


class Perception:
    """Radar, trackers and what they last said. A live thing: copies of the environment carry None in its place."""

    def __init__(self, radar: RadarLike, trackers: Mapping[str, TrackerLike | None]) -> None:
        """A radar and named trackers, the first of which feeds the planner; None stands for the truth."""
        self.radar, self.trackers = radar, dict(trackers)
        self.observers: list[Observer] = []
        self.seconds = {"sense": 0.0, "track": 0.0}  # wall time spent on scene and radar, and on the trackers
        self.costs = {name: Cost() for name in self.trackers}
        self.frame = -1  # simulated frames since the first look, -1 before

    def __deepcopy__(self, memo: dict) -> None:
        return None

    @classmethod
    def mount(cls, radar: Any, trackers: Sequence[Any]) -> "Perception":
        """From names, dicts or objects; ValueError when two trackers have one name."""
        mounted = radar_of(radar)
        names = [label(t) for t in trackers]
        if len(set(names)) < len(names):
            raise ValueError(f"trackers must have different names, got {', '.join(names)}; drop the repetition")
        return cls(mounted, {name: tracker_of(t, mounted) for name, t in zip(names, trackers, strict=True)})

    def start(self, read: Callable[[], Scene], road: RoadMap, rng: np.random.Generator) -> None:
        """Begin an episode on a mapped road with a look at its first scene."""
        self.rng, self.frame = rng, 0
        self._driven = {name: on_road(tracker, road) for name, tracker in self.trackers.items()}
        self._tracks = {name: tracker.start() for name, tracker in self._driven.items() if tracker is not None}
        self.look(read)

    def due(self, frequency: float) -> bool:
        """Count one simulated frame, of so many a second; true if there is a look in it."""
        self.frame += 1
        if self.radar.rate is None:
            return True
        looks = self.radar.rate / frequency  # a frame
        return int(self.frame * looks + 1e-9) > int((self.frame - 1) * looks + 1e-9)

    def look(self, read: Callable[[], Scene]) -> None:
        """Read a scene, scan it, and feed all trackers."""
        start = perf_counter()
        self.scene = read()
        self.scan, self.origin = self.radar.scan(self.scene, self.rng)
        sensed = perf_counter()
        self.outputs = {name: self._timed_step(name, tracker) for name, tracker in self._driven.items()}
        self.seconds["sense"] += sensed - start
        self.seconds["track"] += perf_counter() - sensed

    def tell(self, action: str, plan: NDArray) -> None:
        """Hand the last look to the observers, with the planner's action and plan (P, 2) [m]."""
        for observer in self.observers:
            observer(self.frame, self.scene.time, self.scene, self.scan, self.origin, self.outputs, action, plan)

    def estimate(self, time: float) -> tuple[NDArray, Estimate]:
        """Ids (T,) and estimates of the first tracker's reported tracks, moved on to a time [s] after the last look."""
        reported = self.tracks.reported
        return reported.id, advance(reported.estimate, time - self.scene.time)

    @property
    def knows_truth(self) -> bool:
        """True if the planner is fed with the truth."""
        return next(iter(self.trackers.values())) is None

    @property
    def tracks(self) -> Tracks:
        """What the first tracker carries."""
        return next(iter(self.outputs.values()))[0]

    def _timed_step(self, name: str, tracker: TrackerLike | None) -> tuple[Tracks, StepInfo]:
        start = perf_counter()
        tracks, info = self._step(name, tracker)
        self.costs[name] = self.costs[name].after(perf_counter() - start, info)
        return tracks, info

    def _step(self, name: str, tracker: TrackerLike | None) -> tuple[Tracks, StepInfo]:
        if tracker is None:
            return truth_tracks(self.scene), truth_info(self.scene, self.origin)
        self._tracks[name], info = tracker.step(self._tracks[name], self.scan, self.scene.dt)
        return self._tracks[name], info

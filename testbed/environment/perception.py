"""Radar and trackers of one vehicle: the scene is scanned whenever a scan is due, and every tracker gets the same scan.

Of the truth nothing goes further: a `Scene` goes in, `Tracks` come out. There are two exceptions, both for experiments
that ask what tracking costs: the tracker called "truth", whose tracks are the scene itself, and `TruthBased` ones.

Where the truth is the only tracker and there is no observer, scenes wait until a frame is asked for. They are then
scanned in their order, so that the radar draws the same numbers as if it had scanned them at once.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import fields, replace
from time import perf_counter
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

import sensors
import trackers
from sensors.fault_text import faults_of
from sensors.faults import Fault, apply_faults, chosen
from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.validation import check_output, check_tracks
from testbed.evaluation.metric import COST, values
from testbed.frame import TRUTH, Frame, Observer
from trackers.estimate import Estimate, prior
from trackers.geometry import rotation
from trackers.multi.road import RoadMap
from trackers.multi.tracker import MultiObjectTracker
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan, SensorModel

MAX_DEFERRED_SCANS = 1000  # scenes that may wait to be scanned; a minute of highway-v0


class RadarLike(Protocol):
    """A radar that `Perception` can use."""

    @property
    def models(self) -> tuple[SensorModel, ...]:
        """Parameters of each sensor, for the trackers."""

    @property
    def rate(self) -> float | None:
        """Scans per second; None: one every simulated frame."""

    def scan(self, scene: Scene, rng: np.random.Generator) -> tuple[Scan, Origin]:
        """One scan, and where its detections come from."""


class TrackerLike(Protocol):
    """A multi-object tracker that `Perception` can use."""

    def start(self) -> Tracks:
        """No tracks."""

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        """Tracks after a scan that came dt [s] after the one before."""


@runtime_checkable
class TruthBased(Protocol):
    """What makes tracks from the truth, and perhaps from scans: an ideal tracker, or one with errors put in or removed.

    Only experiments on the cost of tracking have such; a tracker has `step`, and gets the scan alone.
    """

    def start_on(self, road: RoadMap) -> Any:
        """State at the start of an episode on a road."""

    def step_on_truth(self, state: Any, scan: Scan, scene: Scene, origin: Origin) -> tuple[Any, Tracks, StepInfo]:
        """New state, and the tracks that the planner gets; `scene.dt` [s] is the time since the scan before."""


class Cost(NamedTuple):
    """Computation time of one tracker so far."""

    seconds: float = 0.0  # wall time
    scans: int = 0
    updates: int = 0  # tracks with a detection, over all scans

    def after(self, seconds: float, info: StepInfo) -> "Cost":
        """With one more step, which took so many seconds."""
        return Cost(self.seconds + seconds, self.scans + 1, self.updates + int((info.detections > 0).sum()))

    def row(self) -> dict[str, float]:
        """The metrics of a cost, NaN without a scan or an update."""
        return values(COST, self)


def radar_of(radar: Any) -> RadarLike:
    """The radar behind a name or {"name": name, parameter: value}; an object like a radar is taken as it is.

    Raises:
        LookupError: an unknown name; the nearest one is suggested.
        TypeError: no radar, or a parameter that a radar does not have.
        ValueError: a parameter of a value that no radar can have.
    """
    if isinstance(radar, str):
        return sensors.find(radar)
    if isinstance(radar, Mapping):
        name, parameters = _split(radar, "radar")
        found = sensors.find(name)
        known = [field.name for field in fields(found)]
        if unknown := sorted(set(parameters) - set(known)):
            raise TypeError(f"radar {name} has no parameter {', '.join(unknown)}; it has {', '.join(known)}")
        return replace(found, **parameters)
    if isinstance(radar, type) or not all(hasattr(radar, part) for part in ("models", "rate", "scan")):
        raise TypeError(
            f"radar must be a name, {{'name': NAME, PARAMETER: VALUE}} or an object with models, rate and scan, "
            f"got {radar!r}; try 'surround'"
        )
    return radar


def tracker_of(tracker: Any, radar: RadarLike) -> TrackerLike | TruthBased | None:
    """The multi-object tracker behind a name, `NAME:key=value`, {"name": name, parameter: value} or a filter.

    What is `TruthBased` is taken as it is.

    None for the truth.

    Raises:
        LookupError: an unknown name; the nearest one is suggested.
        TypeError: no tracker, or a parameter that the filter does not have.
        ValueError: a parameter of a value that the filter refuses.
    """
    if isinstance(tracker, str):
        return None if tracker == TRUTH else trackers.build(tracker, radar.models)
    if isinstance(tracker, Mapping):
        name, parameters = _split(tracker, "tracker")
        return trackers.build(name, radar.models, **parameters)
    if isinstance(tracker, TruthBased) and not isinstance(tracker, type):
        return tracker
    kinds = (("start", "step"), ("init", "predict", "update", "estimate"))
    complete = [not isinstance(tracker, type) and all(hasattr(tracker, part) for part in kind) for kind in kinds]
    if not any(complete):
        raise TypeError(
            f"tracker must be a name, {{'name': NAME, PARAMETER: VALUE}}, a filter with init, predict, update and "
            f"estimate, or an object with start and step, got {tracker!r}; try {trackers.DEFAULT!r}"
        )
    return tracker if complete[0] else MultiObjectTracker(tracker, radar.models)


def on_road(tracker: TrackerLike | None, road: RoadMap) -> TrackerLike | None:
    """The tracker with the map of the episode; one that has a map, or that takes none, is returned as it is."""
    if isinstance(tracker, MultiObjectTracker) and tracker.road is None:
        return replace(tracker, road=road)
    return tracker


def label(tracker: Any) -> str:
    """Name of a tracker or radar in tables, with changed parameters; of an object its own or its class."""
    if isinstance(tracker, str):
        return tracker
    if isinstance(tracker, Mapping):
        name, parameters = _split(tracker, "tracker")
        changes = ", ".join(f"{key}={value}" for key, value in parameters.items())
        return f"{name}({changes})" if changes else name
    own = getattr(tracker, "name", None)
    return own if isinstance(own, str) else type(tracker).__name__


def _split(entry: Mapping[str, Any], what: str) -> tuple[str, dict[str, Any]]:
    """Name and parameters of a dict entry."""
    if "name" not in entry:
        raise ValueError(f"{what} {dict(entry)} has no key 'name'; write {{'name': NAME, PARAMETER: VALUE}}")
    if not isinstance(entry["name"], str):
        raise TypeError(f"the name of a {what} must be a string, got {entry['name']!r}; `testbed list` shows the names")
    return entry["name"], {key: value for key, value in entry.items() if key != "name"}


def truth_tracks(scene: Scene) -> Tracks:
    """The objects of a scene as N tracks with tiny uncertainty; ids are those of the scene."""
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


def advance(estimate: Estimate, lag: float) -> Estimate:
    """The estimates predicted by lag [s] at constant velocity and yaw rate; the uncertainties are not changed."""
    turn = lag * np.asarray(estimate.yaw_rate)
    with np.errstate(invalid="ignore"):  # estimates that are not finite are dropped by `belief.plausible`
        step = np.concatenate([lag * estimate.velocity, turn[..., None]], -1)
    pose = estimate.pose + step  # (ENV.1)
    contour = estimate.contour
    if contour is not None:
        offsets = (contour - estimate.pose[..., None, :2]) @ rotation(turn).mT
        contour = pose[..., None, :2] + offsets  # (ENV.1)
    return estimate._replace(pose=pose, contour=contour)


class Perception:
    """Radar, trackers and their last frame."""

    scene: Scene  # of the last scan

    def __init__(
        self,
        radar: RadarLike,
        trackers: Mapping[str, TrackerLike | TruthBased | None],
        faults: Sequence[Fault] = (),
    ) -> None:
        """A radar, its faults, and named trackers; the planner uses the first. None stands for the truth."""
        self.radar, self.trackers, self.faults = radar, dict(trackers), tuple(faults)
        self.observers: list[Observer] = []
        self.seconds = {"sense": 0.0, "track": 0.0}  # wall time spent on scene and radar, and on the trackers
        self.costs = {name: Cost() for name in self.trackers}
        self.only_truth = {tracker is None for tracker in self.trackers.values()} == {True}
        self.steps = 0  # simulated frames since the start

    def without(self, observer: Observer) -> "Perception":
        """The same with one observer less; all else is shared."""
        other = copy(self)
        other.observers = [o for o in self.observers if o is not observer]
        return other

    @classmethod
    def mount(cls, radar: Any, trackers: Sequence[Any], faults: Any = ()) -> "Perception":
        """From names, dicts or objects; ValueError when two trackers have one name, or a fault is of no sensor."""
        mounted, wrong = radar_of(radar), faults_of(faults)
        for fault in wrong:
            chosen(fault.sensors, mounted.models)
        names = [label(t) for t in trackers]
        if len(set(names)) < len(names):
            raise ValueError(f"trackers must have different names, got {', '.join(names)}; drop the repetition")
        return cls(mounted, {name: tracker_of(t, mounted) for name, t in zip(names, trackers, strict=True)}, wrong)

    def start(
        self,
        read: Callable[[int], Scene],
        road: RoadMap,
        rng: np.random.Generator,
        frequency: float | None = None,
        action: str = "reset",
        fault_rngs: Sequence[np.random.Generator] = (),
    ) -> None:
        """Begin an episode with a scan of its first scene; `notify` hands the frame out.

        Args:
            read: the scene now, given the number of simulated frames since the start; its `dt` is replaced.
            road: for trackers that use a map and have none.
            rng: of the radar.
            frequency: simulated frames a second [1/s]; None: every frame has a scan, whatever the radar's rate.
            action: in the first frame, where no planner has chosen one.
            fault_rngs: one for each fault, see `sensors.faults.streams`.
        """
        self._read, self._rng, self._frequency, self.steps = read, rng, frequency, 0
        self._fault_rngs = tuple(fault_rngs)
        self._deferred: deque[tuple[int, Scene, str, NDArray]] = deque()  # frames without a scan yet, the last one last
        self._mapped: dict[str, TrackerLike | None] = {}
        self._tracks: dict[str, Tracks] = {}
        self._states: dict[str, Any] = {}  # of those that are truth-based
        for name, tracker in self.trackers.items():
            if isinstance(tracker, TruthBased):
                self._states[name], self._mapped[name] = tracker.start_on(road), None
            else:
                self._mapped[name] = mapped = on_road(tracker, road)
                if mapped is not None:
                    self._tracks[name] = mapped.start()
                    check_tracks(self._tracks[name], name, "start")
        self.step(action, np.zeros((0, 2)), first=True)

    def step(self, action: str, plan: NDArray, first: bool = False) -> None:
        """One simulated frame has passed under the planner's action and plan (P, 2) [m]: scan if a scan is due.

        The first frame of an episode has a scan, whose frame `notify` hands out.
        """
        self.steps += not first
        if not (first or self._due()):
            return
        start = perf_counter()
        scene = self._read(self.steps)
        self.scene = scene = scene._replace(dt=scene.time - self.scene.time if self.steps else 0.0)
        self.seconds["sense"] += perf_counter() - start
        if self.only_truth and not self.observers:
            self._deferred.append((self.steps, scene, action, plan))
            self._catch_up(MAX_DEFERRED_SCANS)
            return
        self._catch_up(0)
        scan, origin = self._scan(scene)
        outputs = {}
        for name, tracker in self._mapped.items():
            start = perf_counter()
            if name in self._states:
                based: Any = self.trackers[name]
                state, *output = based.step_on_truth(self._states[name], scan, scene, origin)
                self._states[name], outputs[name] = state, tuple(output)
            elif tracker is None:
                outputs[name] = truth_tracks(scene), truth_info(scene, origin)
            else:
                outputs[name] = tracker.step(self._tracks[name], scan, scene.dt)
                check_output(outputs[name], scan.mask.shape[-1], name, f"step {self.steps} ({scene.time:.2f} s)")
                self._tracks[name] = outputs[name][0]
            self._count(name, perf_counter() - start, outputs[name][1])
        self._frame = Frame(self.steps, scene, scan, origin, outputs, action, plan)
        if not first:
            self.notify()

    def notify(self) -> None:
        """Call all observers with the last frame."""
        for observer in self.observers:
            observer(self.frame)

    def estimate(self, time: float) -> tuple[NDArray, Estimate]:
        """Ids (T,) and estimates of the first tracker's reported tracks, predicted to a time [s] after its scan."""
        reported = self.tracks.reported
        return reported.id, advance(reported.estimate, time - self.scene.time)

    @property
    def frame(self) -> Frame:
        """That of the last scan."""
        self._catch_up(0)
        return self._frame

    @property
    def knows_truth(self) -> bool:
        """True if the planner gets the truth."""
        return next(iter(self.trackers.values())) is None

    @property
    def tracks(self) -> Tracks:
        """All tracks of the first tracker."""
        if self.only_truth:
            return truth_tracks(self.scene)
        return next(iter(self.frame.outputs.values()))[0]

    def _due(self) -> bool:
        """Whether the simulated frame at hand has a scan."""
        if self.radar.rate is None or self._frequency is None:
            return True
        scans = self.radar.rate / self._frequency  # a frame
        return int(self.steps * scans + 1e-9) > int((self.steps - 1) * scans + 1e-9)  # (RAD.24)

    def _scan(self, scene: Scene) -> tuple[Scan, Origin]:
        """The scan of a scene, with faults."""
        start = perf_counter()
        scan, origin = self.radar.scan(scene, self._rng)
        scan, origin = apply_faults(self.faults, self._fault_rngs, self.radar.models, scene, scan, origin)
        self.seconds["sense"] += perf_counter() - start
        return scan, origin

    def _catch_up(self, left: int) -> None:
        """Scan deferred scenes, where the truth is the only tracker, until so many are left."""
        while len(self._deferred) > left:
            step, scene, action, plan = self._deferred.popleft()
            scan, origin = self._scan(scene)
            start = perf_counter()
            truth = truth_tracks(scene), truth_info(scene, origin)
            self._frame = Frame(step, scene, scan, origin, dict.fromkeys(self.trackers, truth), action, plan)
            for name in self.trackers:
                self._count(name, perf_counter() - start, truth[1])

    def _count(self, name: str, seconds: float, info: StepInfo) -> None:
        """Add a step of a tracker to what it has cost."""
        self.seconds["track"] += seconds
        self.costs[name] = self.costs[name].after(seconds, info)

"""One whole run, live or on a recording; frames reach whoever watches as they are made."""

from collections.abc import Callable, Sequence
from contextlib import closing
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np

from scenarios.lanes import lane_shapes
from scenarios.stage import Phase
from testbed.environment.episode import Step, drive
from testbed.environment.perception import Cost, Perception, radar_of
from testbed.experiments.run import Run
from testbed.frame import Frame, Observer
from testbed.log.record import RoadGeometry
from testbed.log.road_geometry import road_geometry
from testbed.planners import find as find_planner
from testbed.replay.recording import Recording
from testbed.replay.rescan import replay, rescan


class Played(NamedTuple):
    """What a run leaves beside its frames."""

    steps: tuple[Step, ...]  # decisions; of a recording none
    costs: dict[str, Cost]  # by name of the tracker
    seconds: dict[str, float]  # wall time: tracking, and of a live run simulation and sensing
    cpu: float  # [s] of this process
    drawn: RoadGeometry


class _Watched:
    """Calls observers with each frame, those with a `begin` first with the phases, and measures the time they take."""

    def __init__(self, observers: Sequence[Observer], phases: Callable[[], tuple[Phase, ...]]) -> None:
        self.seconds = 0.0
        self._observers, self._phases, self._begun = observers, phases, False

    def __call__(self, frame: Frame) -> None:
        before = perf_counter()
        if not self._begun:
            self._begun = True
            for observer in self._observers:
                if hasattr(observer, "begin"):
                    observer.begin(self._phases())
        for observer in self._observers:
            observer(frame)
        self.seconds += perf_counter() - before


def episode(run: Run, observers: Sequence[Observer], recording: Recording | None = None) -> Played:
    """Make a run from its first frame to its last.

    Args:
        run: in open loop its recording is given too.
        observers: called with every `Frame`; `begin(phases)` of those that have it is called before the first.
        recording: the drive whose scenes, and scans if its radar is that of the run, are given to the source.
    """
    return _live(run, observers) if recording is None else _recorded(run, observers, recording)


def _live(run: Run, observers: Sequence[Observer]) -> Played:
    start, cpu = perf_counter(), process_time()
    with closing(run.environment()) as env:
        tracked: Any = env
        watched = _Watched(observers, lambda: tuple(getattr(tracked.unwrapped, "phases", ())))
        tracked.attach(watched)
        steps = tuple(drive(env, find_planner(run.planner), run.seed))
        cpu = process_time() - cpu
        spent, costs = tracked.seconds, tracked.costs
        drawn = road_geometry(lane_shapes(tracked.unwrapped.road.network))
    sensing, tracking = spent["sense"], spent["track"]
    seconds = {"simulation": perf_counter() - start - sensing - tracking - watched.seconds}
    return Played(steps, costs, seconds | {"sensing": sensing, "tracking": tracking}, cpu, drawn)


def _recorded(run: Run, observers: Sequence[Observer], recording: Recording) -> Played:
    cpu, watched = process_time(), _Watched(observers, lambda: recording.phases)
    perception: Perception
    if run.recorded_with is None:
        perception = replay(recording, (run.source,), [watched], run.faults)
    else:
        rng = np.random.default_rng([recording.seed, 1])  # radars that draw alike see alike
        perception = rescan(recording, radar_of(run.radar), rng, (run.source,), [watched], run.faults)
    tracking = {"tracking": perception.seconds["track"]}
    return Played((), perception.costs, tracking, process_time() - cpu, recording.drawn)

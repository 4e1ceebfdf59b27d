"""One closed-loop run from start to table."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import gymnasium as gym

from scenarios import find as find_scenario
from sensors import faults_of
from sensors import find as find_radar
from sensors.faults import chosen
from testbed.command_line.interruption import interruptible
from testbed.environment.perception import tracker_of
from testbed.environment.recorder import check_level
from testbed.evaluation.tracking import jsonable
from testbed.files import make_directory, noting_losses
from testbed.frame import Observer
from testbed.limits import check_duration, check_folder, check_names, check_seeds
from testbed.planners import begin
from testbed.planners import find as find_planner
from testbed.planners import settings as planner_settings
from trackers import DEFAULT


@dataclass(frozen=True)
class RunConfig:
    """What `testbed run` varies; names as in the catalogues."""

    scenario: str
    trackers: tuple[str, ...] = (DEFAULT,)  # the planner uses the first; all get the same detections
    radar: str = "surround"
    planner: str = "idm"
    seed: int = 0
    duration: float | None = None  # [s], None: the scenario's own
    out: str = "runs"
    log: str = "full"
    metrics: bool = True  # False: nothing is compared with the truth; with log "off" only
    faults: tuple[str, ...] = ()  # of the radar, all at once

    def __post_init__(self) -> None:
        check_names("trackers", self.trackers)
        check_duration(self.duration)
        check_seeds(self.seed)
        check_folder(self.out)
        if not (isinstance(self.faults, tuple) and all(isinstance(fault, str) for fault in self.faults)):
            raise ValueError(f"faults must be a tuple of texts, got {self.faults!r}; write faults=('drop:0.2',)")


@dataclass(frozen=True)
class RunResult:
    """Results and files of a run."""

    config: RunConfig
    result: dict[str, Any]  # see `Recorder.result`
    json: Path | None  # None where it could not be written
    rrd: Path | None  # None where there is no log
    exit_status: int  # 0, 128 + signal where one ended the run early, 2 where something could not be written
    lost: tuple[str, ...] = ()  # what could not be written, in sentences

    @property
    def interrupted(self) -> bool:
        """Whether there is more of the scenario than was run."""
        return bool(self.result["interrupted"])


def check(config: RunConfig) -> None:
    """Raise LookupError, ValueError or OSError, in one sentence, for a configuration that cannot be run."""
    find_scenario(config.scenario)
    radar = find_radar(config.radar)
    for fault in faults_of(config.faults):
        chosen(fault.sensors, radar.models)
    for name in config.trackers:
        tracker_of(name, radar)
    find_planner(config.planner)
    check_level(config.log, config.metrics)
    make_directory(Path(config.out))


def make_env(config: RunConfig) -> gym.Env:
    """The scenario's environment with radar and trackers, writing its files to `config.out`."""
    planner = find_planner(config.planner)
    settings = planner_settings(planner) | ({} if config.duration is None else {"duration": config.duration})
    first = "truth" if planner.knows_truth else config.trackers[0]
    also = config.trackers if planner.knows_truth else config.trackers[1:]
    return gym.make(
        f"testbed/{config.scenario}-v0",
        config=settings,
        tracker=first,
        also=list(also),
        radar=config.radar,
        out=config.out,
        log=config.log,
        planner=config.planner,
        metrics=config.metrics,
        faults=config.faults,
    )


def run(
    config: RunConfig, progress: Callable[[float, float], None] | None = None, observers: Sequence[Observer] = ()
) -> RunResult:
    """Drive one scenario to its end; progress(simulated, total) [s] is called once a decision.

    Observers are called with a `Frame` after every scan, see `TrackedEnv.attach`.

    Ctrl-C or SIGTERM ends the run after the decision at hand: what was measured until then is written and returned.
    A disk that becomes full on the way does not end it: a `LostFileWarning` and `RunResult.lost` say what is missing.

    Raises:
        LookupError: an unknown scenario, tracker, radar or planner; the nearest name is suggested.
        OSError: log or results cannot be written where they belong; raised before the run begins.
    """
    planner = find_planner(config.planner)
    with interruptible() as interrupt, closing(make_env(config)) as env:
        tracked: Any = env
        for observer in observers:
            tracked.attach(observer)
        env.reset(seed=config.seed)
        begin(planner, env)
        recorder = tracked.recorder
        total = float(env.unwrapped.config["duration"])  # type: ignore[attr-defined]
        start, cpu, done = perf_counter(), process_time(), False
        try:
            while not done and interrupt.signal is None:
                action, tracked.plan = planner.choose(env)
                _, _, terminated, truncated, _ = env.step(action)
                done = terminated or truncated
                if progress:
                    progress(tracked.truth.time, total)
        finally:
            timing = {**tracked.seconds, **recorder.seconds, "wall": perf_counter() - start}
            timing["cpu"] = process_time() - cpu
            timing["trackers"] = {name: jsonable(cost.row()) for name, cost in tracked.costs.items()}
            with noting_losses(recorder.lost):
                recorder.close(interrupted=not done, timing=timing)
    status = (0 if done else interrupt.exit_status) or (2 if recorder.lost else 0)
    files = recorder.written, recorder.log.file
    return RunResult(config, recorder.close(), *files, status, tuple(recorder.lost))

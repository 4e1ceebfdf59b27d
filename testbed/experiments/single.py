"""One closed-loop run with its log and results, as `testbed run` makes it."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property, partial
from hashlib import sha256
from math import inf
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import gymnasium as gym

from scenarios import Scenario
from sensors import faults_of
from sensors import find as find_radar
from sensors.faults import chosen
from testbed import planners
from testbed.command_line.interruption import interruptible
from testbed.environment.episode import decisions
from testbed.environment.episode import start as start_episode
from testbed.environment.perception import tracker_of
from testbed.environment.recorder import check_level
from testbed.environment.registration import make, scenario_of
from testbed.environment.validation import OF_USERS
from testbed.evaluation.tracking import jsonable
from testbed.experiments.identity import own_code, own_module, own_names, tracker_digest
from testbed.files import make_directory, noting_losses
from testbed.frame import Observer
from testbed.limits import LONGEST, UnfitPolicy, check_duration, check_folder, check_names, check_seeds
from trackers import DEFAULT
from trackers.json_file import read_json

EXAMPLE = '{"vehicles_count": 30}'
OF_CONFIGS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)  # what environments raise about them


class Unusable(ValueError):
    """The environment, or the planner, does not take what the user has configured; one sentence says what."""


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
    config: str | None = None  # JSON file of the environment's config
    focus: int | None = None  # id of the object with a page of its own in the log; None: that of the worst moment
    after: float | None = None  # [s] from the end of the maneuver, at which the run ends; None: with its duration

    def __post_init__(self) -> None:
        check_names("trackers", self.trackers)
        check_duration(self.duration)
        check_duration(self.after, "after", "a run that ends with its duration")
        check_seeds(self.seed)
        check_folder(self.out)
        if not (self.config is None or isinstance(self.config, str | Path)):
            raise ValueError(f"config must be a JSON file like {EXAMPLE}, got {self.config!r}")
        if not (self.focus is None or (isinstance(self.focus, int) and self.focus >= 0)):
            raise ValueError(f"focus must be the number of a vehicle, such as 3 for veh_03, got {self.focus!r}")
        if self.focus is not None and self.log == "off":
            raise ValueError(f"focus {self.focus} is of the log, which --log off does not write")
        if not (isinstance(self.faults, tuple) and all(isinstance(fault, str) for fault in self.faults)):
            raise ValueError(f"faults must be a tuple of texts, got {self.faults!r}; write faults=('drop:0.2',)")

    @cached_property
    def settings(self) -> dict[str, Any]:
        """What is in the JSON file of the config, read once; empty without one, ValueError for what is no config."""
        if self.config is None:
            return {}
        try:
            found = read_json(Path(self.config))
        except (OSError, ValueError) as error:
            raise ValueError(f"config: cannot read {self.config}: {error}; give a JSON file like {EXAMPLE}") from None
        if not isinstance(found, dict):
            raise ValueError(f"config: {self.config} must hold one JSON object like {EXAMPLE}")
        check_duration(found.get("duration"))
        return found


@dataclass(frozen=True)
class RunResult:
    """Results and files of a run."""

    config: RunConfig
    result: dict[str, Any]  # see `Recorder.result`
    json: Path | None  # None where it could not be written
    rrd: Path | None  # None where there is no log
    exit_status: int  # 0, 128 + signal where one ended the run early, 2 where `lost` says something
    lost: tuple[str, ...] = ()  # in sentences, what could not be written, or why a tracker or planner ended the run

    @property
    def interrupted(self) -> bool:
        """Whether there is more of the scenario than was run."""
        return bool(self.result["interrupted"])


def check(config: RunConfig) -> None:
    """Raise LookupError, ValueError or OSError, in one sentence, for a configuration that cannot be run."""
    if not isinstance(scenario_of(config.scenario), Scenario) and config.after is not None:
        raise ValueError(f"after: {config.scenario} is of highway-env and has no maneuver; give --duration")
    _ = config.settings  # refuses what is no config
    radar = find_radar(config.radar)
    for fault in faults_of(config.faults):
        chosen(fault.sensors, radar.models)
    for name in config.trackers:
        tracker_of(name, radar)
    planners.find(config.planner)
    check_level(config.log, config.metrics)
    make_directory(Path(config.out))


def make_env(config: RunConfig) -> gym.Env:
    """The scenario's environment with radar and trackers, writing its files to `config.out`."""
    planner, scenario = planners.find(config.planner), scenario_of(config.scenario)
    settings = deepcopy(config.settings) | planners.settings(planner)  # an environment may change what is nested in it
    if config.duration is not None and (isinstance(scenario, Scenario) or "duration" in scenario.default):
        settings["duration"] = config.duration
    if config.after is not None:
        settings["after"] = config.after
    first = "truth" if planner.knows_truth else config.trackers[0]
    also = config.trackers if planner.knows_truth else config.trackers[1:]
    env: Any = make(
        config.scenario,
        settings,
        tracker=first,
        also=list(also),
        radar=config.radar,
        out=config.out,
        log=config.log,
        planner=config.planner,
        metrics=config.metrics,
        faults=config.faults,
    )
    own = own_names([config.scenario], [config.radar], [config.planner])
    env.notes |= own_code(own) | {
        f"code of tracker {name}": tracker_digest(name) for name in config.trackers if own_module(name, "tracker")
    }
    if config.config is not None:
        digest = sha256(json.dumps(config.settings, sort_keys=True).encode()).hexdigest()[:6]
        env.title = f"{config.scenario}+{Path(config.config).stem}-{digest}"
    return env


@contextmanager
def _configured(config: RunConfig) -> Iterator[None]:
    """Around what depends on a config or an environment of highway-env: an error there is one of the user's choice."""
    try:
        yield
    except UnfitPolicy:
        raise
    except OF_CONFIGS as error:
        if not config.settings and isinstance(scenario_of(config.scenario), Scenario):
            raise
        what = f"{config.scenario} with {config.config}" if config.settings else config.scenario
        kind = "" if type(error) is ValueError else f"{type(error).__name__}: "
        raise Unusable(f"{what} cannot be run: {kind}{error}; change the config or the planner") from error


def length(config: RunConfig) -> float:
    """Simulated time [s] after which a run ends at the latest."""
    given = config.duration or config.settings.get("duration") or scenario_of(config.scenario).duration
    return min(float(given), LONGEST)


def run(
    config: RunConfig, progress: Callable[[float, float], None] | None = None, observers: Sequence[Observer] = ()
) -> RunResult:
    """Drive one scenario to its end; progress(simulated, total) [s] is called once a decision.

    Observers are called with a `Frame` after every scan, see `TrackedEnv.attach`.

    Ctrl-C or SIGTERM ends the run after the decision at hand: what was measured until then is written and returned.
    A disk that becomes full on the way does not end it: a `LostFileWarning` and `RunResult.lost` say what is missing.
    Tracks that cannot be right, an action that the environment does not have and a policy of another observation end it
    with what was measured until then, and a sentence in `RunResult.lost`.

    Raises:
        LookupError: an unknown scenario, tracker, radar or planner; the nearest name is suggested.
        Unusable: the environment does not take the config, or the planner of the catalogue not the environment.
        WrongTracks: a tracker returns no tracks at the first scan.
        OSError: log or results cannot be written where they belong; raised before the run begins.
    """
    planner = planners.find(config.planner)
    choice = nullcontext if own_module(config.planner, "planner") else partial(_configured, config)
    with _configured(config):
        env = make_env(config)
    with interruptible() as interrupt, closing(env):
        tracked: Any = env
        for observer in observers:
            tracked.attach(observer)
        start_episode(env, planner, config.seed)
        recorder = tracked.recorder
        if config.focus is not None:
            recorder.log.focus_on(config.focus)
        total = length(config)
        until = inf if "duration" in env.unwrapped.config else total  # type: ignore[attr-defined]
        start, cpu, done = perf_counter(), process_time(), False

        def stop() -> bool:
            return interrupt.signal is not None or tracked.truth.time >= until

        try:
            for step in decisions(env, planner, stop, choice):
                done = step.terminated or step.truncated or tracked.truth.time >= until
                if progress:
                    progress(tracked.truth.time, total)
        except OF_USERS as error:
            recorder.lost.append(f"{error}; the run ends at {tracked.truth.time:.2f} s")
        finally:
            timing = {**tracked.seconds, **recorder.seconds, "wall": perf_counter() - start}
            timing["cpu"] = process_time() - cpu
            timing["trackers"] = {name: jsonable(cost.row()) for name, cost in tracked.costs.items()}
            with noting_losses(recorder.lost):
                recorder.close(interrupted=not done, timing=timing)
    status = (0 if done else interrupt.exit_status) or (2 if recorder.lost else 0)
    files = recorder.written, recorder.log.file if recorder.log else None
    return RunResult(config, recorder.close(), *files, status, tuple(recorder.lost))

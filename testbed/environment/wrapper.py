"""The gymnasium wrapper: any highway-env environment, with a radar and trackers between the world and the planner.

Three hooks, none of which changes the simulation (docs/methods/environment.md):

- frame tap: while `step` runs, `Perception.step` is called at the end of every simulated frame;
- belief view: observation types read the belief road, which holds the tracks;
- road swap: between calls `env.unwrapped.road` is the belief road, so planners that read or copy it plan on tracks.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from os import PathLike
from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.envs.common.action import ActionType, MultiAgentAction
from highway_env.road.road import Road
from numpy.typing import ArrayLike, NDArray

from scenarios.adapter import SceneReader
from scenarios.constants import ProtectedConstants
from scenarios.highway import ScenarioEnv, check_clock, is_positive
from scenarios.lanes import lane_shapes
from scenarios.record import Scenario
from scenarios.roads import cacheable, cached
from scenarios.vehicles import CourseVehicle
from sensors.fault_text import faults_of
from sensors.faults import streams
from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.belief import (
    BeliefPictures,
    BeliefView,
    NoReset,
    RoadSwap,
    attach_view,
    belief_road,
    mirror_road,
)
from testbed.environment.observation import without_frames
from testbed.environment.perception import Cost, Perception, advance, label
from testbed.environment.recorder import Recorder, check_level
from testbed.environment.track_observation import observed
from testbed.evaluation.driving import drive_frame
from testbed.files import versions
from testbed.frame import Observer
from testbed.limits import check_choice
from testbed.log.record import RunMeta, run_id
from testbed.log.road_geometry import road_geometry
from testbed.planners import find as find_planner
from testbed.planners.hidden import View, view_of
from trackers import DEFAULT
from trackers.multi.road import RoadMap
from trackers.multi.tracks import Tracks
from trackers.scan import Scan

ROADS = ("cached", "stock")
RADAR = "surround"  # mounted where no radar is named
SLOWEST_CRUISE = 8.0  # [m/s] lower limit of the cruise speed, which is the ego's speed at the reset
MOST_VIEWS = 50  # decisions of which it is known what was in sight: 10 s at 5 Hz
SENSOR_STREAM, BELIEF_STREAM, ACTION_STREAM = 1, 2, 3  # spawn keys beside the traffic's own stream
OPTIONS = ("config",)  # of `reset`, as in highway-env


def describe_action(action_type: ActionType, action: Any) -> str:
    """An action in words."""
    if isinstance(action_type, MultiAgentAction):
        return " / ".join(map(describe_action, action_type.agents_action_types, action))
    if action is None:
        return "none"
    if hasattr(action_type, "actions"):
        return action_type.actions.get(int(action), str(action))
    return " ".join(f"{value:+.2f}" for value in np.ravel(action))


def is_within(space: gym.Space, action: Any) -> bool:
    """Whether a space contains an action; for a box, numbers of any type and in any sequence."""
    if isinstance(space, gym.spaces.Tuple):
        complete = isinstance(action, tuple) and len(action) == len(space.spaces)
        return complete and all(map(is_within, space.spaces, action))
    if isinstance(space, gym.spaces.Box):
        try:
            action = np.asarray(action, space.dtype)
        except (TypeError, ValueError):
            return False
    return space.contains(action)


def check_mountable(env: gym.Env) -> None:
    """Raise TypeError or ValueError for an environment on which no radar can be mounted."""
    if not isinstance(env, gym.Env) or not isinstance(env.unwrapped, AbstractEnv):
        found = env.unwrapped if isinstance(env, gym.Env) else env
        raise TypeError(f"env must be a highway-env environment, got {found!r}; try gym.make('highway-v0')")
    inner = env
    while isinstance(inner, gym.Wrapper):
        if isinstance(inner, TrackedEnv):
            raise ValueError(
                f"env has a radar and trackers already, got {env}; give tracker and radar to the gym.make or "
                "TrackedEnv that made it"
            )
        inner = inner.env
    check_clock(inner.config)  # type: ignore[attr-defined]


def check_options(options: Any) -> None:
    """Raise TypeError or ValueError, in one sentence, for options that no reset takes."""
    if options is None:
        return
    if not isinstance(options, Mapping):
        raise TypeError(f"options must be a dict or None, got {options!r}; write options={{'config': {{...}}}}")
    if unknown := [key for key in options if key not in OPTIONS]:
        known = ", ".join(map(repr, OPTIONS))
        raise ValueError(f"options has no key {unknown[0]!r}; known: {known}, the configuration of highway-env")
    if not isinstance(options.get("config", {}), Mapping):
        raise TypeError(f"options['config'] must be a dict, got {options['config']!r}; leave it out")


def planner_name(planner: Any) -> str:
    """The name of a planner of the catalogue, or of an object with a name; LookupError or TypeError for others."""
    if isinstance(planner, str):
        return find_planner(planner).name
    if not isinstance(getattr(planner, "name", None), str):
        raise TypeError(f"planner must be a name, or an object with a name, got {planner!r}; try 'idm'")
    return planner.name


@contextmanager
def frame_tap(road: Road, perception: Perception, action: str, plan: NDArray) -> Iterator[None]:
    """Call `perception.step` after each step of the road. Do not copy the road meanwhile: the copy would call it."""
    step = road.step

    def tapped(dt: float) -> None:
        step(dt)
        perception.step(action, plan)

    road.step = tapped
    try:
        yield
    finally:
        del road.step


class TrackedEnv(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """A highway-env environment whose observation, and whose road between calls, are built from tracks.

    Reward, termination and truncation are those of the true world. Traffic draws from the environment's own generator,
    the radar from another: the same seed and actions give the same traffic whatever is mounted.

    A deep copy has no radar and no tracker until it is reset. Its road is a copy of the belief road, and stepping it
    predicts the tracks as traffic, for planners that search with copies of the environment.
    """

    def __init__(
        self,
        env: gym.Env,
        tracker: Any = DEFAULT,
        radar: Any = RADAR,
        also: Sequence[Any] = (),
        out: str | None = None,
        log: str = "full",
        planner: Any = "idm",
        warm_up: float = 0.0,
        every_episode: int = 1,
        metrics: bool = True,
        road: str = "cached",
        faults: Any = (),
    ) -> None:
        """Mount a radar and trackers on the first controlled vehicle.

        Args:
            env: any highway-env environment.
            tracker: the one whose tracks the planner gets: a name (also with parameters, or MODULE:OBJECT, as
                `trackers.build` takes it), {"name": name, parameter: value, ...}, "truth" for perfect tracks, a filter,
                or an object with `start` and `step` as `MultiObjectTracker` has them.
            radar: a name of `sensors.RADARS`, {"name": name, parameter: value, ...}, or an object like `sensors.Radar`.
            also: further trackers that get the same detections.
            out: directory for the log and the results of every episode; None: nothing is written.
            log: what goes into the log: full, metrics, or off for results only.
            planner: the planner that will choose the actions, for the names of the files: a name of
                `testbed.PLANNERS`, or an object with a `name`.
            warm_up: seconds of traffic before the first observation, in which no action is taken, so that the trackers
                have tracks by then. Scenes are timed from the reset; steps and duration of the episode count from the
                first observation.
            every_episode: of the episodes since the last seeded reset, only the first and every k-th after it has
                files.
            metrics: whether results hold measures of tracks and drive; False takes their time off, with log="off" only.
            road: "cached" puts `scenarios.roads.CachedRoad` under the environment, for the same states in less time;
                "stock" leaves the road as it is, as does a road of a class that cannot be cached.
            faults: of the radar: texts such as "front:outage:3:5", or objects of `sensors.faults`; times count from
                the reset.

        Raises:
            TypeError: `env` is no highway-env environment; a tracker, radar or planner is neither a name nor an object
                that can do its work; `also` or `faults` is no sequence; an unknown parameter.
            ValueError: `env` has a radar already, or its frequencies make no frame; an unknown `log`, two trackers of
                one name, a dict without "name", a fault that is none, or of sensors that the radar has not, or a value
                of a parameter, `warm_up` or `every_episode` that is refused.
            LookupError: an unknown tracker, radar or planner; the nearest name is suggested.
        """
        check_mountable(env)
        if isinstance(also, str | Mapping) or not isinstance(also, Iterable):
            raise TypeError(f"also must be a sequence of trackers, got {also!r}; write also=[TRACKER]")
        if out is not None and not isinstance(out, str | PathLike):
            raise TypeError(f"out must be a directory or None, got {out!r}; write out='runs'")
        faults_of(faults)
        also, faults = list(also), [faults] if isinstance(faults, str) else list(faults)  # as a spec gives them back
        gym.utils.RecordConstructorArgs.__init__(
            self,
            tracker=tracker,
            radar=radar,
            also=also,
            out=out,
            log=log,
            planner=planner,
            warm_up=warm_up,
            every_episode=every_episode,
            metrics=metrics,
            road=road,
            faults=faults,
        )
        gym.Wrapper.__init__(self, env)
        check_level(log, metrics)
        check_choice("road", road, ROADS)
        if warm_up != 0 and not is_positive(warm_up):
            raise ValueError(f"warm_up must be finite and not negative, got {warm_up!r}; give seconds")
        if isinstance(every_episode, bool) or not isinstance(every_episode, int) or every_episode < 1:
            raise ValueError(f"every_episode must be a whole number from 1 on, got {every_episode!r}")
        self.warm_up, self.every_episode = warm_up, every_episode
        self.out, self.log, self.planner = out, log, planner_name(planner)
        self.metrics, self._road = metrics, road
        self.title: str | None = None  # of the scenario in the files; None: its own name
        self.notes: dict[str, Any] = {}  # what else the files are to say about the run
        self.plan: NDArray = np.zeros((0, 2))  # (P, 2) [m] the planner's path; set before `step`, for the observers
        self.cruise_speed = SLOWEST_CRUISE  # [m/s] of a planner on a free road
        self._radar = radar
        self._mount(Perception.mount(radar, (tracker, *also), faults))
        self._clear()
        self._fence = ProtectedConstants()  # `intersection-*` writes into IDMVehicle at every reset
        self._episode = 0
        self._ended = False  # whether the episode is over
        self._belief: tuple[int, Road] | None = None  # frame, road
        self._views: deque[View] = deque(maxlen=MOST_VIEWS)
        self._decided: Scene | None = None  # the truth at the last decision
        self.recorder: Recorder | None = None  # of the episode that goes on, when `out` is given

    # The last scan

    @property
    def truth(self) -> Scene:
        """The scene of the last scan; for metrics and logs only."""
        return self._perception.scene

    @property
    def scan(self) -> Scan:
        """The last scan."""
        return self._perception.frame.scan

    @property
    def origin(self) -> Origin:
        """Where the detections of the last scan came from; for metrics and logs only."""
        return self._perception.frame.origin

    @property
    def tracks(self) -> Tracks:
        """All tracks of the first tracker after the last scan, unreported ones included."""
        return self._perception.tracks

    @property
    def current_tracks(self) -> Tracks:
        """`tracks` predicted to the present frame, as on the belief road; for planners that want uncertainty."""
        perception, tracks = self._perception, self.tracks
        now = perception.steps / self._core.config["simulation_frequency"]
        return tracks._replace(estimate=advance(tracks.estimate, now - perception.scene.time))

    @property
    def views(self) -> tuple[View, ...]:
        """What was in sight at the last decisions, by the boxes of the tracks; none where the planner has the truth.

        For planners that care for what was never seen: the place of the memory, as planners keep nothing between calls.
        """
        return tuple(self._views)

    def observe_tracks(self, size: int, existence: float, scale: bool) -> tuple[dict[str, NDArray], NDArray]:
        """The observation of `TrackObservation` now, and the ids (K,) of its rows: for learned policies."""
        return observed(self.current_tracks, self._core.vehicle, size, existence, scale)

    @property
    def all_tracks(self) -> dict[str, Tracks]:
        """The tracks of every tracker after the last scan, by name."""
        return {name: tracks for name, (tracks, _) in self._perception.frame.outputs.items()}

    @property
    def observers(self) -> list[Observer]:
        """What is called after every scan."""
        return self._perception.observers

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time [s] so far: "sense" for scene and radar, "track" for all trackers."""
        return self._perception.seconds

    @property
    def costs(self) -> dict[str, Cost]:
        """What each tracker has cost so far, by name."""
        return self._perception.costs

    def attach(self, observer: Observer) -> None:
        """Call `observer(frame)` after every scan with a `testbed.frame.Frame`, the first time at the next reset.

        A frame holds `step`, the count of simulated frames; `time` [s]; the true `scene`; the `scan` and the `origin`
        of its detections; `outputs`, the (Tracks, StepInfo) of each tracker by name; the planner's last `action` in
        words, and `plan` (P, 2) [m], what it put into `env.plan`. A simulated frame in which a slow radar does not scan
        makes no call. What the observer returns is ignored; what it raises ends the step.
        """
        self._perception.observers.append(observer)

    # The interface of gymnasium

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; the first scan and the warm-up come before the first observation.

        docs/contract.md has all that `reset` and `step` return.

        Raises:
            TypeError, ValueError: `options` is no dict, or has another key than "config".
        """
        check_options(options)
        if self._mounted is None:
            self._mount(Perception(*deepcopy(self._parts)))
        self._swap.show()
        self._episode = 0 if seed is not None else self._episode + 1
        self._belief, self.plan = None, np.zeros((0, 2))
        self._views.clear()
        self._decided = None
        self._ended = False
        with self._viewed_from_the_start(), self._fence:
            observation, info = self.env.reset(seed=seed, options=options)
        self.cruise_speed = max(SLOWEST_CRUISE, float(self._core.vehicle.speed))
        self._swap.hide(self._belief_now())
        return observation, self._report(info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Simulate one period of the planner; None applies no action, as in highway-env.

        Raises:
            gymnasium.error.ResetNeeded: `reset` was not called before, or the episode is over.
            gymnasium.error.InvalidAction: the action is not in the action space; nothing was simulated.
        """
        core = self._core
        if core.road is None:
            raise gym.error.ResetNeeded("step was called before reset; call env.reset(seed=...) first")
        if self._ended:
            raise gym.error.ResetNeeded("step was called after the end of the episode; call env.reset() first")
        if action is not None and not is_within(self.action_space, action):
            raise gym.error.InvalidAction(
                f"action {action!r} is not in the action space {self.action_space}; "
                "check it with env.action_space.contains(action); env.action_space.sample() is one"
            )
        if self._mounted is None:
            return self.env.step(action)
        belief = self._belief_now()  # until there is a new one, which a step that fails does not have
        self._swap.show()
        words = describe_action(core.action_type, action)
        attach_view(core.observation_type, self._view)
        try:
            with frame_tap(core.road, self._mounted, words, self.plan), self._fence:
                observation, reward, terminated, truncated, info = self.env.step(action)
            belief = self._belief_now()
        finally:
            self._swap.hide(belief)
        self._ended = bool(terminated or truncated)
        return observation, reward, terminated, truncated, self._report(info)

    def render(self) -> Any:
        """Picture of what the planner knows, or in the mode "human" of the true world, in a window.

        Raises:
            gymnasium.error.ResetNeeded: `reset` was not called before.
        """
        if self._core.road is None:
            raise gym.error.ResetNeeded("render was called before reset; call env.reset(seed=...) first")
        if self.render_mode != "human" or self._mounted is None or not self._swap.hidden:
            return self.env.render()
        self._swap.show()
        try:
            return self.env.render()
        finally:
            self._swap.hide(self._belief_now())

    def close(self) -> None:
        """Finish the files of the last episode, and close the environment."""
        self._stop_recording()
        self.env.close()

    def __getstate__(self) -> dict[str, Any]:
        """All but the open files: an unpickled environment goes on alike, and writes from its next reset on."""
        if self.recorder is None:
            return self.__dict__.copy()
        return {**self.__dict__, "recorder": None, "_mounted": self._perception.without(self.recorder)}

    def __deepcopy__(self, memo: dict) -> "TrackedEnv":
        """A copy that knows nothing of the truth and writes no files; a reset mounts copies of radar and trackers."""
        other = memo[id(self)] = type(self).__new__(type(self))
        unmounted = dict.fromkeys(("_mounted", "_swap", "_view", "_reader", "_belief", "_decided", "recorder", "out"))
        kept = {key: deepcopy(value, memo) for key, value in self.__dict__.items() if key not in {*unmounted, "_parts"}}
        other.__dict__ |= {**kept, **unmounted, "_parts": self._parts, "_views": deque(maxlen=MOST_VIEWS)}
        return other

    # Inner workings

    def _mount(self, perception: Perception) -> None:
        """Put a radar and trackers between the environment and whoever looks at it."""
        core = self._core
        self._mounted: Perception | None = perception
        self._parts = perception.radar, perception.trackers, perception.faults  # for the reset of a copy
        self._swap, self._view = RoadSwap(core), BeliefView(core, self._belief_now)
        core.reset = NoReset()
        if self.render_mode == "rgb_array":
            core.render = BeliefPictures(core, self._view)

    def _clear(self) -> None:
        """Leave no road, where no episode has begun."""
        self._core.road, self._core.controlled_vehicles = None, []

    def _begin(self) -> None:
        """The first scan, and the warm-up: traffic without an action of the ego."""
        core, perception = self._core, self._perception
        if self._road == "cached" and cacheable(core.road):
            cached(core.road)
        self._belief_now()
        self._record()
        perception.notify()
        frequency = core.config["simulation_frequency"]
        with frame_tap(core.road, perception, "reset", self.plan):
            for _ in range(round(self.warm_up * frequency)):
                core.road.act()
                core.road.step(1 / frequency)

    def _record(self) -> None:
        """Start the files of an episode, if files are wanted."""
        self._stop_recording()
        if self.out is None or self._episode % self.every_episode:
            return
        core, perception = self._core, self._perception
        ours = isinstance(core, ScenarioEnv)
        scenario = self.title or (core.scenario.name if ours else core.spec.id)
        names, radar = tuple(perception.trackers), label(self._radar)
        usual = core.scenario.duration if ours else core.default_config().get("duration")
        duration = core.config.get("duration", usual)
        named = None if duration == usual else duration
        faults = tuple(map(str, perception.faults))
        name = run_id(scenario, names, radar, self.planner, core.np_random_seed, named, faults)
        keys = ("simulation_frequency", "policy_frequency", "duration")
        meta = RunMeta(
            run_id=name if self._episode == 0 else f"{name}-episode{self._episode}",
            scenario=scenario,
            seed=core.np_random_seed,
            radar=radar,
            trackers=names,
            planner=self.planner,
            config={key: core.config[key] for key in keys if key in core.config}
            | ({"faults": list(faults)} if faults else {})
            | self.notes,
            versions=versions(),
        )
        courses = [v for v in core.road.vehicles if isinstance(v, CourseVehicle)]
        most_agile = max(courses, key=lambda v: v.table.peak_acceleration, default=None)
        self.recorder = Recorder(
            meta,
            self.out,
            self.log,
            phases=getattr(core, "phases", ()),
            road=road_geometry(lane_shapes(core.road.network)),
            sensors=perception.radar.models,
            focus=None if most_agile is None else self._reader.number(most_agile),
            trackers=perception.trackers,
            metrics=self.metrics,
            faults=perception.faults,
            happened=getattr(core.road, "events", None),
        )
        perception.observers.append(self.recorder)

    def _stop_recording(self) -> None:
        if self.recorder is not None:
            self._perception.observers.remove(self.recorder)
            self.recorder.close()
            self.recorder = None

    @property
    def _core(self) -> Any:
        """The highway-env environment."""
        return self.unwrapped

    @property
    def _perception(self) -> Perception:
        if self._mounted is None:
            raise AttributeError("a deep copy of the environment has no radar and no tracker; use the original")
        return self._mounted

    def _read(self, steps: int) -> Scene:
        """The scene after so many simulated frames; highway-env counts a frame only after the road has stepped."""
        return self._reader.read(self._core)._replace(time=steps / self._core.config["simulation_frequency"])

    def _belief_now(self) -> Road:
        """The belief road of the current frame, made once a frame."""
        perception = self._perception
        if self._belief is None:
            sensor, self._rng = self._streams()
            self._reader = SceneReader()
            shapes = lane_shapes(self._core.road.network)
            lanes: list[tuple[ArrayLike, float]] = [(lane.centre, lane.width) for lane in shapes]
            frequency, seed = self._core.config["simulation_frequency"], self._core.np_random_seed
            rngs = streams(perception.faults, seed, self._episode)
            perception.start(self._read, RoadMap.of(lanes), sensor, frequency, fault_rngs=rngs)
        if self._belief is None or self._belief[0] != perception.steps:
            self._belief = perception.steps, self._belief_of(perception)
        return self._belief[1]

    def _belief_of(self, perception: Perception) -> Road:
        core = self._core
        if perception.knows_truth:
            return mirror_road(core.road, core.controlled_vehicles, self._rng)
        ids, estimate = perception.estimate(perception.steps / core.config["simulation_frequency"])
        road = belief_road(core.road, core.controlled_vehicles, ids, estimate, self._rng)
        self._views.append(view_of(core.vehicle, road.vehicles))
        return road

    def _streams(self) -> tuple[np.random.Generator, np.random.Generator]:
        """Generators of the radar and of the belief."""
        return np.random.default_rng(self._seed_of(SENSOR_STREAM)), np.random.default_rng(self._seed_of(BELIEF_STREAM))

    def _seed_of(self, stream: int) -> np.random.SeedSequence:
        """Seed of a stream, from the seed of the environment and the count of episodes."""
        return np.random.SeedSequence(self.unwrapped.np_random_seed, spawn_key=(self._episode, stream))

    @contextmanager
    def _viewed_from_the_start(self) -> Iterator[None]:
        """Let every observation type that the reset makes use the belief view, before its first observation.

        highway-env defines its spaces twice in a reset: before it makes the road, and just before it observes.
        """
        core = self._core
        define_spaces, last = core.define_spaces, core.road

        def define_and_attach() -> None:
            define_spaces()
            without_frames(core.observation_type)
            attach_view(core.observation_type, self._view)
            if core.road is not last:
                core.action_space.seed(int(self._seed_of(ACTION_STREAM).generate_state(1)[0]))  # `info["action"]`
                self._begin()

        core.define_spaces = define_and_attach
        del core.reset
        begun = False
        try:
            yield
            begun = True
        finally:
            core.reset = NoReset()
            del core.define_spaces
            if not begun:
                self._clear()

    def _report(self, info: dict[str, Any]) -> dict[str, Any]:
        """The environment's info, the numbers of reported tracks of the first tracker and of detections, and the drive.

        Where the truth is the only tracker, detections are not counted: nothing is scanned until the scan is read.
        `info["drive"]` is a `DriveFrame` as a dict: the true risk ahead now, and the acceleration since the last
        decision, NaN at the reset.
        """
        perception = self._perception
        now = perception.steps / self._core.config["simulation_frequency"]
        scene = perception.scene if perception.scene.time == now else self._read(perception.steps)
        drive, self._decided = drive_frame(scene, self._decided)._asdict(), scene
        counts = {"tracks": len(self.tracks.reported.id)}
        if not perception.only_truth:
            counts["detections"] = int(self.scan.mask.sum())
        return {**info, **counts, "drive": drive}


def scenario_env(
    scenario: str | Scenario,
    tracker: Any = DEFAULT,
    radar: Any = RADAR,
    also: Sequence[Any] = (),
    out: str | None = None,
    log: str = "full",
    planner: Any = "idm",
    config: dict[str, Any] | None = None,
    render_mode: str | None = None,
    warm_up: float = 0.0,
    every_episode: int = 1,
    metrics: bool = True,
    road: str = "cached",
    faults: Any = (),
) -> TrackedEnv:
    """What `gym.make("testbed/SCENARIO-v0", ...)` calls; arguments as in `TrackedEnv` and highway-env."""
    env = ScenarioEnv(scenario=scenario, config=config, render_mode=render_mode)
    return TrackedEnv(env, tracker, radar, also, out, log, planner, warm_up, every_episode, metrics, road, faults)

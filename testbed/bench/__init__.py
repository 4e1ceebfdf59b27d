"""Benchmarks: ratios measured side by side in one run, because absolute times belong to one machine."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any, NamedTuple

import gymnasium as gym
import highway_env  # noqa: F401  registers the ids
import numpy as np
from highway_env.envs.common.observation import LidarObservation
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from scenarios.adapter import SceneReader
from scenarios.roads import cached as cached_road
from sensors import find as find_radar
from sensors.raycast import cast_bodies
from testbed.environment.registration import make
from testbed.environment.track_observation import TrackObservation
from testbed.environment.wrapper import TrackedEnv
from testbed.frame import TRUTH
from testbed.planners import PLANNERS, Planner
from testbed.planners import find as find_planner
from testbed.planners import settings as planner_settings
from trackers import DEFAULT, Scan, prior
from trackers import find as find_tracker
from trackers.compiled import form as compiled_form
from trackers.filter import Filter
from trackers.range_rate import RangeRates

Progress = Callable[[float, float, str], None]  # done, total, name of the next benchmark
PLANNER = "idm"
IDLE = 1  # of DiscreteMetaAction
VEHICLES = (10, 20, 50)
ROAD_VEHICLES = (10, 20, 50, 100)
RAYS = 3600
OBJECTS = (1, 100)
DETECTIONS = 20  # of each object
CAR = (np.array([20.0, 3.0]), np.array([4.8, 1.8]), 30.0)  # [m] centre and size ahead of the sensor, [m/s] speed
FRAME = 0.1  # [s]


def seconds(function: Callable[[], Any], repeat: int, clock: Callable[[], float] = perf_counter) -> float:
    """Median time [s] of a call, on the wall unless another clock is given."""
    times = []
    for _ in range(repeat):
        start = clock()
        function()
        times.append(clock() - start)
    return median(times)


def highway(vehicles: int) -> gym.Env:
    """The stock highway with so many other vehicles."""
    return gym.make("highway-v0", config={"vehicles_count": vehicles, "duration": 1000})


def frames_of(env: gym.Env) -> int:
    """Simulated frames of a decision."""
    config = env.unwrapped.config  # type: ignore[attr-defined]
    return config["simulation_frequency"] // config["policy_frequency"]


def stepping(env: gym.Env, steps: int) -> float:
    """Wall time [s] of so many idle decisions."""
    start = perf_counter()
    for _ in range(steps):
        env.step(IDLE)
    return perf_counter() - start


def perception(steps: int) -> Table:
    """Radar and tracker a frame, against a frame of the stock environment."""
    table = _table("perception against simulation, per frame", "vehicles", "highway-env [ms]", "radar [ms]",
                   "tracker [ms]", "ratio (goal 1.0)")  # fmt: skip
    for n in VEHICLES:
        native, tracked = highway(n), TrackedEnv(highway(n), tracker="rm-feldmann", radar="surround")
        native.reset(seed=0)
        tracked.reset(seed=0)
        simulation = [stepping(native, 1) for _ in range(steps)]
        before = dict(tracked.seconds)
        stepping(tracked, steps)
        frames = frames_of(native)
        frame = median(simulation) / frames * 1e3
        radar, track = ((tracked.seconds[k] - before[k]) / (steps * frames) * 1e3 for k in ("sense", "track"))
        table.add_row(str(n), f"{frame:.2f}", f"{radar:.2f}", f"{track:.2f}", f"{(radar + track) / frame:.2f}")
    return table


def closed_loop(steps: int) -> Table:
    """A decision with radar and default tracker against one of the stock environment, in turns."""
    table = _table(f"a decision with {DEFAULT} on surround against stock, CPU time", "vehicles", "highway-env [ms]",
                   "with tracks [ms]", "ratio", f"ratio, {compiled_form()}")  # fmt: skip
    for n, goal in ((20, "1.0"), (50, "0.6")):
        forms = ":compiled=off", ":compiled=on"
        envs = [highway(n), *(TrackedEnv(highway(n), f"{DEFAULT}{off}", f"surround{off}") for off in forms)]
        for env in envs:
            env.reset(seed=0)
            env.step(IDLE)
        times = np.empty((steps, 3))
        for row in times:
            for k, env in enumerate(envs):
                start, over = process_time(), any(env.step(IDLE)[2:4])
                row[k] = process_time() - start
                if over:
                    env.reset(seed=0)
        stock, numpy, fast = np.median(times, 0)
        table.add_row(str(n), f"{1e3 * stock:.0f}", f"{1e3 * numpy:.0f}, {1e3 * fast:.0f}", f"{numpy / stock:.2f}",
                      f"{fast / stock:.2f} (goal {goal})")  # fmt: skip
    return table


def ghosts(scans: int) -> Table:
    """A rig with ghosts against the same without, CPU time a scan, scenes of stock traffic between rails."""
    table = _table("ghosts against none, CPU time", "scenario", "radar [ms]", "with ghosts [ms]", "ratio (goal 1.5)")
    for scenario in ("cut-in", "dense-traffic", "tunnel", "beside-truck"):
        with closing(gym.make(f"testbed/{scenario}-v0", tracker=TRUTH, radar="front")) as env:
            env.reset(seed=0)
            scene, rng = env.get_wrapper_attr("truth"), np.random.default_rng(0)
        plain, extra = (partial(find_radar(name).scan, scene, rng) for name in ("surround", "surround-ghosts"))
        pairs = interleaved(plain, extra, scans)
        times = [float(np.median(t)) for t in pairs]
        table.add_row(scenario, *(f"{1e3 * t:.2f}" for t in times), f"{times[1] / times[0]:.2f}")
    return table


class Pairs(NamedTuple):
    """Times of two ways to do the same piece of work, N pieces, each done both ways one after the other."""

    plain: NDArray  # (N,) [s]
    extra: NDArray  # (N,) [s] with the addition whose cost is asked for

    @property
    def added(self) -> float:
        """Median time [s] that the addition takes in a piece."""
        return float(np.median(self.extra - self.plain))

    @property
    def ratio(self) -> float:
        """Median ratio of the second way to the first."""
        return float(np.median(self.extra / self.plain))

    @property
    def share(self) -> float:
        """Median share of the addition in the time of a piece with it."""
        return float(np.median(1 - self.plain / self.extra))


def interleaved(
    plain: Callable[[], Any], extra: Callable[[], Any], count: int, clock: Callable[[], float] = process_time
) -> Pairs:
    """Do both in turns, so many times; the first of a pair is the second of the next.

    The default clock counts the CPU time of this process, so what other processes do is not in it.
    """

    def timed(function: Callable[[], Any]) -> float:
        start = clock()
        function()
        return clock() - start

    times = np.empty((count, 2))
    for i, row in enumerate(times):
        for k in (0, 1) if i % 2 == 0 else (1, 0):
            row[k] = timed((plain, extra)[k])
    return Pairs(*times.T)


def logging(duration: float) -> Table:
    """The share of the log in the closed loop: the same run with and without a log, a simulated second in turns."""
    table = _table("log against the loop, CPU time", "scenario", "loop [ms a frame]", "log [ms a frame]",
                   "share (goal 0.3)")  # fmt: skip
    planner = find_planner(PLANNER)
    for scenario in ("cut-in", "dense-traffic"):
        with TemporaryDirectory() as out, ExitStack() as stack:
            runs = []
            for level in ("off", "full"):
                options = {"tracker": "rm-feldmann", "out": f"{out}/{level}", "log": level}
                env = stack.enter_context(closing(make(scenario, {"duration": duration}, **options)))
                env.reset(seed=0)
                runs.append(partial(deciding, env, planner, env.unwrapped.config["policy_frequency"]))  # type: ignore[attr-defined]
            bare, logged = runs
            pairs = interleaved(bare, logged, int(duration))
            frames = env.unwrapped.config["simulation_frequency"]  # type: ignore[attr-defined]
        loop, log = (1e3 * t / frames for t in (float(np.median(pairs.extra)), pairs.added))
        table.add_row(scenario, f"{loop:.1f}", f"{log:.2f}", f"{pairs.share:.2f}")
    return table


def deciding(env: Any, planner: Planner, decisions: int) -> None:
    """Let the planner decide and the environment step, so many times."""
    for _ in range(decisions):
        action, env.plan = planner.choose(env)
        env.step(action)


def roads(steps: int) -> Table:
    """The cached road against the stock road, same states."""
    table = _table(
        "cached road against stock road", "vehicles", "stock [ms a frame]", "cached [ms a frame]", "speed-up"
    )
    for n in ROAD_VEHICLES:
        stock, cached = highway(n), highway(n)
        stock.reset(seed=0)
        cached.reset(seed=0)
        cached_road(cached.unwrapped.road)  # type: ignore[attr-defined]
        times = [(stepping(stock, 1), stepping(cached, 1)) for _ in range(steps)]
        a, b = (median(column) / 15 * 1e3 for column in zip(*times, strict=True))
        table.add_row(str(n), f"{a:.2f}", f"{b:.2f}", f"{a / b:.1f}")
    return table


def rays(repeat: int) -> Table:
    """Our ray caster against highway-env's LidarObservation: same rays, same vehicles."""
    table = _table(f"ray caster against LidarObservation, {RAYS} rays", "vehicles", "lidar [ms]", "ours [ms]",
                   "lidar [rays x rectangles / s]", "ours", "speed-up")  # fmt: skip
    for n in (10, 30):
        env: Any = highway(n).unwrapped
        env.reset(seed=0)
        lidar = LidarObservation(env, cells=RAYS, maximum_range=150.0)
        bodies = SceneReader().read(env).bodies
        origin, bearing = env.vehicle.position, np.linspace(-np.pi, np.pi, RAYS, endpoint=False)
        slow = seconds(lambda lidar=lidar: lidar.observe(), repeat)  # type: ignore[misc]
        fast = seconds(lambda o=origin, b=bearing, bodies=bodies: cast_bodies(o, b, bodies), repeat)  # type: ignore[misc]
        pairs = RAYS * len(bodies.owner)
        table.add_row(str(n), f"{slow * 1e3:.2f}", f"{fast * 1e3:.2f}", f"{pairs / slow:.2e}", f"{pairs / fast:.2e}",
                      f"{slow / fast:.1f}")  # fmt: skip
    return table


def decisions(repeat: int) -> Table:
    """The observation of tracks and the planners, with the vehicles of `dense-traffic` in view, on the same tracks."""
    table = _table("one decision in dense-traffic, CPU time", "what", "[ms]", "goal")
    for name in ("observation of tracks", *PLANNERS):
        planner: Any = PLANNERS.get(name)
        with closing(gym.make("testbed/dense-traffic-v0", config=planner_settings(planner), warm_up=1.0)) as env:
            env.reset(seed=0)
            if planner is None:
                watch = TrackObservation(env)
                work: Callable[[], Any] = watch.observation
            else:
                work = partial(planner.choose, env)
            work()
            goal = "0.1" if planner is None else ""
            table.add_row(name, f"{1e3 * seconds(work, repeat, process_time):.3f}", goal)
    return table


def scan_of(objects: int) -> Scan:
    """Detections (objects, 20) all over a car ahead, by a radar that moves with it."""
    rng, (centre, size, speed) = np.random.default_rng(0), CAR
    xy = centre + rng.uniform(-size / 2, size / 2, (objects, DETECTIONS, 2))
    polar = np.stack([np.hypot(xy[..., 0], xy[..., 1]), np.arctan2(xy[..., 1], xy[..., 0]), np.zeros(xy.shape[:2])], -1)
    noise = np.array([[0.15, 0.01, 0.1]])
    polar += noise * rng.standard_normal(polar.shape)
    return Scan(polar, np.ones(polar.shape[:2], bool), np.zeros((1, 3)), np.array([[speed, 0.0]]), noise)


def cycling(filter: Filter, objects: int) -> Callable[[], Any]:
    """One prediction and update of so many objects, to be called."""
    (centre, _, speed), scan = CAR, scan_of(objects)
    before = np.tile([centre[0] - FRAME * speed, centre[1], 0.0], (objects, 1))
    state = filter.init(prior(before, velocity=np.tile([speed, 0.0], (objects, 1))))
    return lambda: filter.update(filter.predict(state, FRAME), scan)


def cycle(filter: Filter, objects: int, repeat: int) -> float:
    """Wall time [s] of one prediction and update, per object."""
    return seconds(cycling(filter, objects), repeat) / objects


def filters(repeat: int) -> Table:
    """Filters of the later papers beside the plain random matrix."""
    table = _table(f"filters, {DETECTIONS} detections an object, per scan", "filter", "as", "one object [ms]", "goal",
                   "one of 100 [ms]", "goal", "times rm-feldmann", "of 100")  # fmt: skip
    paper = find_tracker("pmht-spline", model="yao2021", visibility="none", rates=RangeRates(weight=0.0), outward=0.0)
    cases = (
        ("rm-feldmann", "", find_tracker("rm-feldmann"), "", ""),
        ("edra-imm", "sequential", find_tracker("edra-imm", form="sequential"), "3", "0.3"),
        ("edra-imm", "soft", find_tracker("edra-imm", form="soft"), "3", "0.3"),
        ("pmht-spline", "the paper's", paper, "0.9", "0.25"),
        ("pmht-spline", "shipped", find_tracker("pmht-spline"), "", ""),
        ("pmht-spline-adaptive", "shipped", find_tracker("pmht-spline-adaptive"), "", ""),
    )
    plain: list[float] = []
    for name, form, filter, *goals in cases:
        times = [cycle(filter, objects, repeat) for objects in OBJECTS]
        plain = plain or times
        one, many = times
        table.add_row(name, form, f"{one * 1e3:.2f}", goals[0], f"{many * 1e3:.3f}", goals[1],
                      f"{one / plain[0]:.1f}", f"{many / plain[1]:.1f}")  # fmt: skip
    return table


def measure(quick: bool = False, progress: Progress | None = None) -> list[Table]:
    """All benchmarks; progress(done, total, name) is called before each."""
    notify = progress or (lambda done, total, what: None)
    steps = 3 if quick else 10
    parts: tuple[tuple[str, Callable[[], Table]], ...] = (
        ("perception", lambda: perception(steps)),
        ("closed loop", lambda: closed_loop(2 * steps)),
        ("ghosts", lambda: ghosts(10 * steps)),
        ("log", lambda: logging(4.0 if quick else 20.0)),
        ("roads", lambda: roads(steps)),
        ("rays", lambda: rays(10 * steps)),
        ("decisions", lambda: decisions(10 * steps)),
        ("filters", lambda: filters(10 * steps)),
    )
    tables = []
    for i, (what, part) in enumerate(parts):
        notify(i, len(parts), what)
        tables.append(part())
    notify(len(parts), len(parts), "done")
    return tables


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title)
    for column in columns:
        table.add_column(escape(column), justify="right")
    return table

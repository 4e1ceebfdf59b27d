"""Goals for speed: pieces of work timed in turns with what they are held against, as ratios of CPU times."""

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from studies.speed import training
from studies.speed.growth import Growth, exponent
from studies.speed.training import tracked_steps
from testbed.bench import OBJECTS, Pairs, cycling, deciding, interleaved
from testbed.experiments.single import RunConfig, make_env
from testbed.frame import TRUTH
from testbed.planners import find as find_planner
from trackers import DEFAULT
from trackers import find as find_tracker

PLAIN = "rm-feldmann"
STARTING = "importing numpy and scipy"
FLOOR = "import numpy, scipy.linalg, scipy.optimize, scipy.special"  # a process that tracks needs these in any case
FIRST_RESET = """
import time, gymnasium, testbed, testbed.experiments.single
env = gymnasium.make("testbed/cut-in-v0")
start = time.process_time()
env.reset(seed=0)
print(time.process_time() - start)
"""


class Goal(NamedTuple):
    """One ratio and its goal."""

    what: str
    against: str
    goal: float  # at most
    found: float

    @property
    def met(self) -> bool:
        """Whether the goal is reached."""
        return self.found <= self.goal


def run_seconds(settings: tuple[dict[str, Any], dict[str, Any]], scenario: str, seconds: int) -> Pairs:
    """Simulated seconds of two runs with the default tracker and different settings, in turns."""
    planner = find_planner(RunConfig.planner)
    with TemporaryDirectory() as out, ExitStack() as stack:
        runs = []
        for i, changes in enumerate(settings):
            config = RunConfig(scenario, duration=float(seconds + 1), out=f"{out}/{i}", **changes)
            env = stack.enter_context(closing(make_env(config)))
            env.reset(seed=config.seed)
            runs.append(partial(deciding, env, planner, env.unwrapped.config["policy_frequency"]))  # type: ignore[attr-defined]
        plain, other = runs
        return interleaved(plain, other, seconds)


def process_seconds(*arguments: str) -> float:
    """CPU time [s] of a fresh Python process that keeps byte code, as installed libraries have theirs."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    keeping = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=keeping)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def starts(repeat: int) -> list[Goal]:
    """What a process costs before it simulates, in units of importing numpy and scipy."""
    what = {
        "`import testbed.experiments.single`": (("-c", "import testbed.experiments.single"), 2.0),
        "`testbed --help`": (("-m", "testbed", "--help"), 1.1),
    }
    for arguments, _ in what.values():
        process_seconds(*arguments)  # the first process of all may have to compile
    floor = median(process_seconds("-c", FLOOR) for _ in range(repeat))
    found = [
        Goal(name, STARTING, goal, median(process_seconds(*arguments) for _ in range(repeat)) / floor)
        for name, (arguments, goal) in what.items()
    ]
    first = [
        float(subprocess.run([sys.executable, "-c", FIRST_RESET], check=True, capture_output=True, text=True).stdout)
        for _ in range(repeat)
    ]
    return [*found, Goal(f"first reset of `{DEFAULT}`", STARTING, 0.1, median(first) / floor)]


def updates(repeat: int) -> list[Goal]:
    """Prediction and update of the default tracker's filter, without its layers, against the plain random matrix."""
    plain, ours = (find_tracker(name) for name in (PLAIN, DEFAULT))
    return [
        Goal(
            f"prediction and update of {objects} objects, filter of `{DEFAULT}`", f"`{PLAIN}`", goal,
            interleaved(cycling(plain, objects), cycling(ours, objects), repeat).ratio,
        )
        for objects, goal in zip(OBJECTS, (2.0, 1.5), strict=True)
    ]  # fmt: skip


def growing(found: Sequence[Growth]) -> list[Goal]:
    """How time and memory of a step grow with the number of tracks, as exponents."""
    objects, seconds, peak = (
        np.array([getattr(g, name) for g in found], float) for name in ("objects", "seconds", "peak")
    )
    span = f"{objects[0]:.0f} to {objects[-1]:.0f} tracks, all in sight, exponent"
    return [
        Goal(f"{what} of a step, {span}", "linear: 1", 1.1, exponent(objects, values))
        for what, values in (("time", seconds), ("memory", peak))
    ]


def lasting(early: int, late: int) -> list[Goal]:
    """What many resets leave behind in a process."""
    memory, files = training.resets(early, late)
    name, against = f"after {late:,} resets of cut-in, a decision each", f"after {early:,}"
    return [Goal(f"peak memory {name}", against, 1.05, memory), Goal(f"open files {name}", against, 1.0, files)]


def measure(quick: bool, found: Sequence[Growth], progress: Callable[[float, float, str], None]) -> list[Goal]:
    """All goals; progress(done, total, name) is called before each part.

    found: growth with the number of tracks, which was measured before.
    """
    steps, seconds = (3, 3) if quick else (12, 20)
    native = "a step of stock highway-v0"
    off: dict[str, Any] = {"log": "off"}
    bare = {**off, "metrics": False}

    def step(vehicles: int, tracker: str, goal: float) -> list[Goal]:
        name = f"step of `TrackedEnv(highway-v0)`, {vehicles} vehicles, `{tracker}`"
        return [Goal(name, native, goal, tracked_steps(vehicles, steps, tracker=tracker).ratio)]

    def run(name: str, settings: tuple[dict[str, Any], dict[str, Any]], against: str, goal: float) -> list[Goal]:
        return [Goal(name, against, goal, run_seconds(settings, "cut-in", seconds).ratio)]

    def seen(scenario: str, goal: float) -> Goal:
        name = f"scene, radar and `{DEFAULT}` in {scenario}, a simulated frame"
        return Goal(name, "a frame of stock highway-v0, 20 vehicles", goal, training.perception(scenario, 2 * steps))

    def processes(count: int) -> Goal:
        name = "a step of two environments, a process each"
        return Goal(name, "a step of one in a process", 2 / 1.9, training.two_processes(count))

    parts: tuple[tuple[str, Callable[[], list[Goal]]], ...] = (
        ("20 vehicles", lambda: step(20, DEFAULT, 1.0)),
        ("perfect tracks", lambda: step(20, TRUTH, 0.8)),
        ("50 vehicles", lambda: step(50, DEFAULT, 0.6)),
        ("no contour", lambda: [*step(20, "imm-htg", 1.2), *step(50, "imm-htg", 0.7)]),
        ("perception", lambda: [seen("cut-in", 0.35), seen("dense-traffic", 0.6)]),
        ("metrics", lambda: run("`testbed run cut-in` with metrics", (bare, off), "without", 1.05)),
        ("log", lambda: run("`testbed run cut-in` with the full log", (off, {"log": "full"}), "without a log", 1.1)),
        ("start", lambda: starts(1 if quick else 5)),
        ("update", lambda: updates(10 if quick else 100)),
        ("growth", lambda: growing(found)),
        ("two processes", lambda: [processes(2 * steps)]),
        ("resets", lambda: lasting(*((5, 10) if quick else (200, 1000)))),
    )
    goals = []
    for i, (what, part) in enumerate(parts):
        progress(i, len(parts), what)
        goals += part()
    progress(len(parts), len(parts), "done")
    return goals

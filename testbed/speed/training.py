"""What training pays: what a decision is made of, environments in two processes, a thousand resets in one."""

import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from testbed.bench import IDLE, highway, interleaved, stepping
from testbed.environment.wrapper import TrackedEnv
from testbed.frame import TRUTH
from trackers import DEFAULT

VEHICLES = 20
RATES = (5, 2)  # scans a second, fewer than the 15 simulated frames of highway-v0
RESETS = """
import os, resource, sys
import gymnasium
import testbed
env = gymnasium.make("testbed/cut-in-v0")
early, late = map(int, sys.argv[1:])
for seed in range(late):
    env.reset(seed=seed)
    env.step(1)
    if seed + 1 in (early, late):
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, len(os.listdir("/dev/fd")))
"""


class Step(NamedTuple):
    """A decision of a highway with some radar and tracker."""

    what: str
    ratio: float  # of its CPU time to that of the stock highway


def steps(count: int) -> list[Step]:
    """What is added to a decision of the stock highway, one piece after the other, and what fewer scans save."""
    default: dict[str, Any] = {"tracker": DEFAULT}
    found = [
        Step("perfect tracks, nothing is scanned", against_native({"tracker": TRUTH}, count)),
        Step("scans on top, no tracker", against_native({"tracker": TRUTH}, count, watched=True)),
        Step("scans and `rm-feldmann`", against_native({"tracker": "rm-feldmann"}, count)),
        Step(f"scans and `{DEFAULT}`", against_native(default, count)),
    ]
    for rate in RATES:
        slow = default | {"radar": {"name": "surround", "rate": rate}}
        found.append(Step(f"the same, {rate} scans a second instead of 15", against_native(slow, count)))
    return found


def against_native(settings: dict[str, Any], count: int, watched: bool = False) -> float:
    """CPU time of a decision with radar and tracker over that of the stock highway, median of so many pairs."""
    with closing(highway(VEHICLES)) as native, closing(TrackedEnv(highway(VEHICLES), **settings)) as tracked:
        if watched:
            tracked.attach(lambda frame: None)  # perfect tracks need no scan, an observer gets one
        native.reset(seed=0)
        tracked.reset(seed=0)
        pairs = interleaved(partial(stepping, native, 1), partial(stepping, tracked, 1), count)
        return median(pairs.extra / pairs.plain)


def tracked_highway() -> gym.Env:
    """The highway with the default radar and tracker, as each process of a vector environment makes it."""
    return TrackedEnv(highway(VEHICLES))


def two_processes(count: int) -> float:
    """Wall time of a step of a vector of two environments, a process each, over that of a vector of one."""
    with ExitStack() as stack:
        vectors = [gym.vector.AsyncVectorEnv([tracked_highway] * n) for n in (1, 2)]
        for vector in vectors:
            stack.callback(vector.close)
            vector.reset(seed=0)
        one, two = (partial(waiting, vector) for vector in vectors)
        pairs = interleaved(one, two, count, perf_counter)
        return median(pairs.extra / pairs.plain)


def waiting(vector: gym.vector.VectorEnv) -> None:
    """One step of each environment of the vector, all of them idle."""
    vector.step(np.full(vector.num_envs, IDLE))


def resets(early: int, late: int) -> tuple[float, float]:
    """Peak memory and open files of a process after so many resets, a decision each, over those after fewer."""
    command = [sys.executable, "-c", RESETS, str(early), str(late)]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    memory, files, more_memory, more_files = map(float, found)
    return more_memory / memory, more_files / files


def perception(scenario: str, count: int) -> float:
    """Wall time that scene, radar and default tracker take of a simulated frame, over a frame of the stock highway."""
    with closing(highway(VEHICLES)) as native, closing(gym.make(f"testbed/{scenario}-v0")) as tracked:
        native.reset(seed=0)
        tracked.reset(seed=0)
        spent: Callable[[], dict[str, float]] = tracked.get_wrapper_attr("seconds").copy
        ratios = []
        for _ in range(count):
            frame = stepping(native, 1) / frames(native)
            before = sum(spent().values())
            tracked.step(IDLE)
            ratios.append((sum(spent().values()) - before) / frames(tracked) / frame)
        return median(ratios)


def frames(env: gym.Env) -> int:
    """Simulated frames of a decision."""
    config = env.unwrapped.config  # type: ignore[attr-defined]
    return config["simulation_frequency"] // config["policy_frequency"]

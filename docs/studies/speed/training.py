"""What training pays: what a decision is made of, environments in two processes, a thousand resets in one."""

import os
import subprocess
import sys
from contextlib import ExitStack, closing
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from testbed.bench import IDLE, Pairs, frames_of, highway, interleaved, stepping
from testbed.environment.sources.conditions import parse, source
from testbed.environment.wrapper import TrackedEnv
from testbed.frame import TRUTH
from trackers import DEFAULT
from trackers.compiled import REFUSED

VEHICLES = 20
RATES = (5, 2)  # scans a second, fewer than the 15 simulated frames of highway-v0
LEARNERS = (TRUTH, "in-view", "rm-koch", "imm-htg", DEFAULT)  # what a learner may be given
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
    cases: list[tuple[str, dict[str, Any]]] = [
        ("perfect tracks, nothing is scanned", {"tracker": TRUTH}),
        ("scans on top, no tracker", {"tracker": TRUTH, "watched": True}),
        ("scans and `rm-feldmann`", {"tracker": "rm-feldmann"}),
        (f"scans and `{DEFAULT}`", {"tracker": DEFAULT}),
    ]
    for rate in RATES:
        slow = {"tracker": DEFAULT, "radar": {"name": "surround", "rate": rate}}
        cases.append((f"the same, {rate} scans a second instead of 15", slow))
    return [Step(what, tracked_steps(VEHICLES, count, **settings).ratio) for what, settings in cases]


def tracked_steps(vehicles: int, count: int, watched: bool = False, **settings: Any) -> Pairs:
    """Decisions of the stock highway, and of the same one with radar and tracker, in turns."""
    with closing(highway(vehicles)) as native, closing(TrackedEnv(highway(vehicles), **settings)) as tracked:
        if watched:
            tracked.attach(lambda frame: None)  # perfect tracks need no scan, an observer gets one
        native.reset(seed=0)
        tracked.reset(seed=0)
        return interleaved(partial(stepping, native, 1), partial(stepping, tracked, 1), count)


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
        return interleaved(one, two, count, perf_counter).ratio


def waiting(vector: gym.vector.VectorEnv) -> None:
    """One step of each environment of the vector, all of them idle."""
    vector.step(np.full(vector.num_envs, IDLE))


def throughput(count: int, rounds: int = 2) -> dict[str, tuple[float, float]]:
    """Decisions a second of cut-in, two environments with a process each: in numpy, and compiled where that can be.

    Wall time, all cases in turns; of so many rounds the fastest, which other work disturbed least.
    """
    best = {tracker: [0.0, 0.0] for tracker in LEARNERS}
    before = os.environ.get(REFUSED, "")
    try:
        for _ in range(rounds):
            for tracker, rates in best.items():
                for form, switch in enumerate(("off", before)):
                    os.environ[REFUSED] = switch  # the processes of the vector inherit it
                    rates[form] = max(rates[form], decisions(tracker, count))
    finally:
        os.environ[REFUSED] = before
    return {tracker: (numpy, compiled) for tracker, (numpy, compiled) in best.items()}


def decisions(tracker: str, count: int) -> float:
    """Decisions a second of both environments of a vector together, after some that do not count."""
    made = gym.make_vec(
        "testbed/cut-in-v0", num_envs=2, vectorization_mode="async", vector_kwargs={"autoreset_mode": "SameStep"},
        tracker=source(parse(tracker), "surround", 0), radar="surround",
    )  # fmt: skip
    with closing(made) as vector:
        vector.reset(seed=0)
        for _ in range(3):
            waiting(vector)
        start = perf_counter()
        for _ in range(count):
            waiting(vector)
        return vector.num_envs * count / (perf_counter() - start)


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
        spent, ratios = tracked.get_wrapper_attr("seconds"), []  # it counts on
        for _ in range(count):
            frame = stepping(native, 1) / frames_of(native)
            before = sum(spent.values())
            tracked.step(IDLE)
            ratios.append((sum(spent.values()) - before) / frames_of(tracked) / frame)
        return median(ratios)

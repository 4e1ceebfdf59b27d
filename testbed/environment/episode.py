"""The one loop over an episode: a planner acts in a tracked environment from its reset to its end."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NamedTuple

import gymnasium as gym

from testbed import planners


class Step(NamedTuple):
    """One decision of the planner, and what came of it."""

    time: float  # [s] of the scene that it rests on
    action: Any
    reward: float
    terminated: bool
    truncated: bool


def never() -> bool:
    """False: for an episode that goes on to its end."""
    return False


def drive(env: gym.Env, planner: Any, seed: int) -> Iterator[Step]:
    """One whole episode, decision by decision; frames reach the observers of the environment as they are made."""
    start(env, planner, seed)
    yield from decisions(env, planner)


def start(env: gym.Env, planner: Any, seed: int) -> None:
    """Reset the environment, and say so to the planner."""
    env.reset(seed=seed)
    planners.begin(planner, env)


def decisions(
    env: gym.Env,
    planner: Any,
    stop: Callable[[], bool] = never,
    around: Callable[[], AbstractContextManager[Any]] = nullcontext,
) -> Iterator[Step]:
    """The decisions of an episode that has been started, until it is over or `stop()` says so.

    around: a context for each choice of the planner, which may turn its errors into others.
    """
    done = False
    while not (done or stop()):
        with around():
            action, plan = planner.choose(env)
        env.set_wrapper_attr("plan", plan)
        time = env.get_wrapper_attr("truth").time
        _, reward, terminated, truncated, _ = env.step(action)
        done = terminated or truncated
        yield Step(time, action, float(reward), bool(terminated), bool(truncated))

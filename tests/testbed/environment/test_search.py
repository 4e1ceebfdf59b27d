"""The protocol of planners that search with copies of the environment: simplify, copy, step hundreds of copies.

A miniature of the deterministic planners of rl-agents: the state is `env.unwrapped`; a node is a deep copy of it, and
its children are made by stepping copies with every available action.
"""

from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest

import testbed


class Node:
    """A copy of the environment with the rewards on the way to it."""

    def __init__(self, state, worth=0.0, depth=0, done=False, first=None):
        self.state, self.worth, self.depth, self.done, self.first = state, worth, depth, done, first

    def children(self, discount=0.8):
        """One for each available action; without them all actions."""
        for action in self.state.get_available_actions():
            state = deepcopy(self.state)
            _, reward, terminated, truncated, _ = state.step(action)
            first = action if self.first is None else self.first
            worth = self.worth + discount**self.depth * float(reward)
            yield Node(state, worth, self.depth + 1, terminated or truncated, first)

    def bound(self, discount=0.8):
        return self.worth + (0.0 if self.done else discount**self.depth / (1 - discount))


def plan(env, expansions):
    """The first action of the best sequence, and the number of steps that copies made."""
    state = env.unwrapped
    if hasattr(state, "simplify"):
        state = state.simplify()
    leaves, steps, best = [Node(state)], 0, None
    for _ in range(expansions):
        leaf = max(leaves, key=Node.bound)
        if leaf.done:
            break
        leaves.remove(leaf)
        for child in leaf.children():
            leaves.append(child)
            steps += 1
            best = child if best is None or child.worth > best.worth else best
    return best.first, steps


def make(name):
    """The environment of an id with a radar and a tracker."""
    config = {} if name.startswith("testbed/") else {"vehicles_count": 6}
    if config:
        return testbed.TrackedEnv(gym.make(name, config=config), tracker="rm-feldmann", warm_up=1.0)
    return gym.make(name, tracker="rm-feldmann", warm_up=1.0)


@pytest.mark.parametrize("name", ["testbed/hard-brake-v0", "highway-fast-v0"])
def test_a_planner_that_searches_with_copies_leaves_no_trace(name):
    """Hundreds of copies are stepped; then the environment goes on as one does that was never copied."""
    env, twin = make(name), make(name)
    env.reset(seed=2)
    twin.reset(seed=2)
    road, tracks = env.unwrapped.road, env.tracks
    action, steps = plan(env, 50)
    assert steps >= 150
    assert env.action_space.contains(action)
    assert env.unwrapped.road is road
    assert env.tracks is tracks
    np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])
    np.testing.assert_array_equal(env.scan.polar, twin.scan.polar)

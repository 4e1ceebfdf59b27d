"""Drives of learned policies: the same episodes on the truth and on tracks."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from studies.page import steps as progress_of
from testbed.environment.episode import drive
from testbed.environment.registration import make
from testbed.frame import TRUTH
from testbed.planners.learned import Learned

ENVIRONMENT = "highway-fast-v0"
RADAR = {"name": "surround", "rate": 5}  # as docs/examples/train.py has it
WARM_UP = 1.0  # [s]
FIRST = 1000  # seed of the first episode; those of the training are others
EPISODES = 50


class Policy(NamedTuple):
    """One trained policy."""

    trained: str  # what its observations came from: truth or a tracker
    seed: int  # of the training
    file: Path


class Drive(NamedTuple):
    """One episode."""

    scenario: int  # seed of the training: what `studies.effects` takes as strata
    tracker: str  # that the policy was trained on
    driven: str  # that it drives on
    seed: int  # of the episode
    length: int  # [decisions]
    reward: float  # sum over the episode, by the environment's own function
    crashed: bool


def policies(folder: Path) -> list[Policy]:
    """The policies of a folder, files `TRACKER-SEED.npz`; ValueError where it holds none."""
    found = [Policy(*_named(path), path) for path in sorted(folder.glob("*-*.npz"))]
    if not found:
        raise ValueError(f"policies: {folder} holds no TRACKER-SEED.npz; docs/examples/train.py --out writes them")
    return sorted(found, key=lambda policy: (policy.trained != TRUTH, policy))


def _named(path: Path) -> tuple[str, int]:
    trained, _, seed = path.stem.rpartition("-")
    if not (trained and seed.isdigit()):
        raise ValueError(f"policies: {path.name} is not named TRACKER-SEED.npz; rename it, such as imm-spline-0.npz")
    return trained, int(seed)


def drives(found: Sequence[Policy], episodes: int = EPISODES) -> pd.DataFrame:
    """One row a drive: every policy on everything that any of them was trained on, in the same episodes."""
    driven = list(dict.fromkeys(policy.trained for policy in found))
    rows: list[Drive] = []
    with progress_of(len(found) * len(driven)) as step:
        for policy in found:
            for on in driven:
                step(f"{policy.file.stem} on {on}")
                rows += _episodes(policy, on, episodes)
    return pd.DataFrame(rows, columns=list(Drive._fields)).astype({"crashed": int})


def _episodes(policy: Policy, on: str, episodes: int) -> Iterator[Drive]:
    env = make(ENVIRONMENT, tracker=on, radar=RADAR, warm_up=WARM_UP)
    planner = Learned(str(policy.file))
    try:
        for seed in range(FIRST, FIRST + episodes):
            steps = list(drive(env, planner, seed))
            total, crashed = sum(step.reward for step in steps), steps[-1].terminated
            yield Drive(policy.seed, policy.trained, on, seed, len(steps), total, crashed)
    finally:
        env.close()

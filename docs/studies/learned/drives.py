"""Drives of learned policies: the same episodes on the truth and on tracks."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import pandas as pd
import pyarrow as pa

from studies.runs import made
from testbed.environment.episode import drive
from testbed.environment.registration import make
from testbed.experiments.engine import Engine
from testbed.experiments.store import Store
from testbed.experiments.study import WHOLE_RUN, Kept, Study
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


class Driven(NamedTuple):
    """A policy on one source of tracks: the unit of work."""

    policy: Policy
    on: str

    @property
    def name(self) -> str:
        """Stem of its file."""
        return f"{self.policy.file.stem}-on-{self.on}".replace(":", "~")

    @property
    def key(self) -> dict[str, Any]:
        """All of it as JSON types."""
        return {"policy": sha256(self.policy.file.read_bytes()).hexdigest()[:12], "on": self.on}


@dataclass(frozen=True, kw_only=True)
class Drives(Study):
    """Every policy on everything that any of them was trained on, in the same episodes."""

    found: tuple[Policy, ...] = ()
    episodes: int = EPISODES

    name: ClassVar[str] = "learned-policies"
    schema: ClassVar[pa.Schema] = pa.schema([("seed", pa.int64()), ("length", pa.int64()), ("reward", pa.float64()),
                                             ("crashed", pa.int64())])  # fmt: skip
    modules: ClassVar[tuple[str, ...]] = ("studies.learned.drives", "testbed.planners")

    def work(self) -> list[Driven]:
        """Each policy on each source."""
        sources = dict.fromkeys(policy.trained for policy in self.found)
        return [Driven(policy, on) for policy in self.found for on in sources]

    def together(self, work: Driven) -> Policy:
        """The drives of a policy."""
        return work.policy

    def columns(self, work: Driven) -> dict[str, Any]:
        """What names a unit in tables."""
        return {"scenario": work.policy.seed, "tracker": work.policy.trained, "driven": work.on}

    def settings(self) -> dict[str, Any]:
        """What all drives have in common."""
        return {"episodes": self.episodes}

    def make(self, work: Driven, store: Store) -> Kept:
        """All episodes of a policy on one source."""
        rows = []
        planner = Learned(str(work.policy.file))
        with closing(make(ENVIRONMENT, tracker=work.on, radar=RADAR, warm_up=WARM_UP)) as env:
            for seed in range(FIRST, FIRST + self.episodes):
                steps = list(drive(env, planner, seed))
                total, crashed = sum(step.reward for step in steps), int(steps[-1].terminated)
                rows.append({"seed": seed, "length": len(steps), "reward": total, "crashed": crashed})
        return Kept(pa.Table.from_pylist(rows, self.schema), [{"phase": WHOLE_RUN}])


def drives(found: Sequence[Policy], out: str, engine: Engine, episodes: int = EPISODES) -> pd.DataFrame:
    """One row a drive, with the columns scenario (the seed of the training), tracker (trained on), driven, seed."""
    study = Drives(found=tuple(found), episodes=episodes, out=out)
    results = made(study, engine)
    parts = [results.store.table(work).to_pandas().assign(**study.columns(work)) for work in study.work()]
    table = pd.concat(parts, ignore_index=True)
    return table[["scenario", "tracker", "driven", "seed", "length", "reward", "crashed"]]

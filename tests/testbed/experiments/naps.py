"""A study of works that sleep: what the store, the engine and the command do, without any simulation."""

import time
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import pyarrow as pa

from testbed.experiments.study import WHOLE_RUN, Findings, Kept, Study

SCHEMA = pa.schema([("k", pa.int64())])


class Nap(NamedTuple):
    """A work that sleeps."""

    k: int
    seconds: float

    @property
    def name(self):
        return f"nap{self.k}"

    @property
    def key(self):
        return {"k": self.k}


@dataclass(frozen=True)
class Naps(Study):
    """So many naps; those in `bad` fail."""

    count: int = 6
    seconds: float = 0.0
    bad: tuple[int, ...] = ()
    settings: str = "soft"

    name: ClassVar[str] = "naps"
    schema: ClassVar[pa.Schema] = SCHEMA

    def work(self):
        return [Nap(k, self.seconds) for k in range(self.count)]

    def together(self, work):
        return work.k // 2

    def columns(self, work):
        return {"k": work.k}

    def shared(self) -> dict[str, Any]:
        return {"settings": self.settings}

    def make(self, work, store):
        time.sleep(work.seconds)
        if work.k in self.bad:
            raise ZeroDivisionError(f"nap {work.k}")
        return Kept(pa.table([[work.k]], schema=SCHEMA), [{"phase": WHOLE_RUN, "slept": work.seconds}])

    def judge(self, results, tally):
        return Findings([f"{len(results.metas)} naps"])


@dataclass(frozen=True)
class FreshNaps(Naps):
    """The same, which delete runs of other settings."""

    fresh: ClassVar[bool] = True
    whole: ClassVar[bool] = True

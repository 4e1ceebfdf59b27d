"""The papers whose experiments can be repeated, by name; `testbed reproduce` over them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from studies.papers.hoher2022 import experiment as hoher2022
from studies.papers.report import HERE, PaperReport, Progress, Stopped
from studies.papers.xia2020 import experiment as xia2020
from studies.papers.xu2023 import experiment as xu2023
from studies.papers.yao2021 import experiment as yao2021
from testbed.command_line.interruption import interruptible
from testbed.experiments.engine import Engine
from testbed.experiments.engine import check as check_engine
from testbed.files import make_directory
from testbed.limits import check_seeds, check_whole
from trackers.lookup import look_up

MOST_RUNS = 100_000  # of each case


@dataclass(frozen=True)
class Paper:
    """One paper and its experiment."""

    name: str
    source: str
    run: Callable[..., PaperReport]  # runs, out, progress, seed, engine


PAPERS: Mapping[str, Paper] = MappingProxyType(
    {
        p.name: p
        for p in (
            Paper(
                hoher2022.PAPER,
                "Hoher et al. (2022), from a project report: virtual measurement model",
                hoher2022.run,
            ),
            Paper(
                xia2020.PAPER,
                "Xia et al., slides: hierarchical truncated Gaussian with online bounds",
                xia2020.run,
            ),
            Paper(
                xia2020.LEARNED_PAPER,
                "Xia et al. (2020), paper: the same density, learned offline",
                partial(xia2020.run, learned=True),
            ),
            Paper(
                xu2023.PAPER,
                "Xu et al. (2023): data-region association with interacting motion models",
                xu2023.run,
            ),
            Paper(
                yao2021.PAPER,
                "Yao et al. (2021): chained ellipses on a B-spline, probabilistic multi-hypothesis tracking",
                yao2021.run,
            ),
        )
    }
)


class Reproduction(NamedTuple):
    """The report of a reproduction, and how the command ends."""

    report: PaperReport
    exit_status: int  # 0; 1 where a claim is not confirmed; 2 where a file is missing; 128 + signal: it ended early


def find(name: str) -> Paper:
    """The paper of that name; raises LookupError with the nearest one otherwise."""
    return look_up(name, PAPERS, "paper")


def check(name: str, runs: int, seed: int, out: Path, engine: Engine = HERE) -> None:
    """Raise LookupError, ValueError or OSError, in one sentence, for what cannot be run."""
    find(name)
    check_whole("runs", runs, 1, MOST_RUNS)
    check_seeds(seed)
    check_engine(engine)
    make_directory(out)


def reproduce(name: str, runs: int, seed: int, out: Path, progress: Progress, engine: Engine = HERE) -> Reproduction:
    """Repeat the experiment of a paper and write its figures and JSON into the folder `out`.

    Ctrl-C or SIGTERM ends it after the step at hand: the rows that are finished are written and returned.
    """
    with interruptible() as request:

        def stoppable(done: float, total: float, what: str) -> None:
            if request.signal is not None:
                raise Stopped
            progress(done, total, what)

        report = find(name).run(runs, out, stoppable, seed, engine=engine)
    status = request.exit_status if report.interrupted else 2 if report.lost else int(not report.holds)
    return Reproduction(report, status)

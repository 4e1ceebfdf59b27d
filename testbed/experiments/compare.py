"""`testbed compare`: trackers on common random numbers, in open or closed loop."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console, RenderableType

from sensors.fault_text import split_faults
from testbed.evaluation.metric import METRICS
from testbed.experiments import statistics
from testbed.experiments.engine import Engine
from testbed.experiments.report import tables, words
from testbed.experiments.report.comparison import write_report
from testbed.experiments.report.grid import terminal, warnings
from testbed.experiments.report.texts import counted
from testbed.experiments.rows import SCHEMA, Rows
from testbed.experiments.run import Run
from testbed.experiments.statistics import DRIVE, MAIN
from testbed.experiments.store import RUNS, Results
from testbed.experiments.study import Findings, Progress, Study, Tally, check_sample
from testbed.files import atomic_file
from testbed.limits import MOST_RUNS, check_names

UNITS = {"seed": "1", "start": "s", "end": "s"}  # of the columns of `RUNS` that are numbers and no metrics
FEW = 3  # trackers that stand side by side in 80 columns with their intervals
SHOWN = ("measure", "mean difference", "interquartile mean", "probability of improvement", "verdict")


@dataclass(frozen=True)
class Settings:
    """What all runs of a results folder have in common; runs of other settings are not comparable with them."""

    radar: str = "surround"
    loop: str = "open"  # open: recorded scans are replayed; closed: the planner uses the tracks of each
    planner: str = "idm"  # in closed loop; recordings use the planner that knows the truth
    duration: float | None = None  # [s] of a run at most, None: the scenario's own
    after: float | None = None  # [s] from the end of the maneuver, at which a run ends; None: with its duration
    settle: float = 0.0  # [s] from the start, of which no scan enters a mean

    def __post_init__(self) -> None:
        for name in ("radar", "planner"):
            check_names(name, (getattr(self, name),))
        Run("any", **asdict(self))  # which refuses what no run can have

    @property
    def length(self) -> str:
        """How long a run is, in words."""
        if self.after is None:
            return f"{self.duration:g} s" if self.duration else "the scenarios' own"
        most = f"{self.duration:g} s" if self.duration else "the scenario's own length"
        return f"to {self.after:g} s after the maneuver, {most} at most"


RECORD = Settings(duration=60.0, after=3.0, settle=2.0)
"""What the comparison of record and the baselines of `testbed regress` are made with."""


@dataclass(frozen=True)
class Comparison(Study):
    """All combinations of scenarios, trackers and seeds."""

    scenarios: tuple[str, ...]  # NAME, or with faults of the radar NAME+FAULT+FAULT
    trackers: tuple[str, ...]
    seeds: tuple[int, ...]
    settings: Settings = Settings()
    reference: str | None = None  # tracker that the others are compared with, None: the first

    name: ClassVar[str] = "compare"
    schema: ClassVar[pa.Schema] = SCHEMA

    def __post_init__(self) -> None:
        check_names("scenarios", self.scenarios)
        check_names("trackers", self.trackers)
        check_sample(self.seeds, "compare")
        if (runs := len(self.scenarios) * len(self.trackers) * len(self.seeds)) > MOST_RUNS:
            raise ValueError(f"a comparison has at most {MOST_RUNS} runs, got {runs}; take fewer seeds or trackers")
        if not isinstance(self.settings, Settings):
            raise ValueError(f"settings must be Settings, got {self.settings!r}; leave them out for those of a command")
        super().__post_init__()
        if self.reference is not None and not (isinstance(self.reference, str) and self.reference in self.trackers):
            raise ValueError(
                f"reference {self.reference!r} is not compared; choose one of {', '.join(self.trackers)}, or add it"
            )

    @property
    def baseline(self) -> str:
        """The tracker that the others are compared with."""
        return self.reference or self.trackers[0]

    def work(self) -> list[Run]:
        """All runs, those on the same detections next to each other."""
        return [
            self.run(case, tracker, seed) for case in self.scenarios for seed in self.seeds for tracker in self.trackers
        ]

    def run(self, case: str, tracker: str, seed: int) -> Run:
        """One run, of a scenario with its faults."""
        scenario, faults = split_faults(case)
        return Run(scenario, seed, tracker, faults=faults, **self.shared())

    def shared(self) -> dict[str, Any]:
        """The settings."""
        return asdict(self.settings)

    def facts(self) -> list[tuple[str, str]]:
        """What else a report says of the runs."""
        return []

    def check(self) -> None:
        """Raise LookupError or ValueError for what cannot be run, or for a case that is written in another way."""
        super().check()
        for case in self.scenarios:
            if case != (written := self.run(case, self.trackers[0], 0).case):
                raise ValueError(f"scenarios: {case!r} is written {written!r}; write it so, as its file is named by it")

    def watch(self, run: Run) -> Rows:
        """Keeps the rows of the tracker."""
        return Rows(run)

    def judge(self, results: Results, tally: Tally) -> Findings:
        """Means, and differences to the reference, of the main measures over all scenarios."""
        main, drives = (list(statistics.cells(results, measures)) for measures in (MAIN, DRIVE))
        return Findings([*_overview(results, main, drives), *warnings(words.unresolved(main))])

    def write(self, results: Results, found: Findings, console: Console) -> None:
        """Write what is known of every run as one table, with the units of its columns."""
        console.print(f"runs     {write_runs(results)}", soft_wrap=True)

    def page(self, results: Results, found: Findings, tally: Tally, engine: Engine, progress: Progress) -> Path | None:
        """The report, with figures and logs."""
        return write_report(results, tally, engine, progress)


def write_runs(results: Results) -> Path:
    """Write the table of all runs and phases into the folder; OSError, in one sentence, where that cannot be."""
    path = Path(results.study.out) / RUNS
    table = pa.Table.from_pandas(results.spans, preserve_index=False)
    units = {name: METRICS[name].unit if name in METRICS else UNITS.get(name, "") for name in table.column_names}
    fields = [field.with_metadata({"unit": units[field.name]}) for field in table.schema]
    with atomic_file(path) as file:
        pq.write_table(table.cast(pa.schema(fields, table.schema.metadata)), file)
    return path


def _overview(
    results: Results, main: Sequence[statistics.Cell], drives: Sequence[statistics.Cell]
) -> Iterator[RenderableType]:
    study = results.study
    runs = f"{counted(len(study.scenarios), 'scenario')}, {counted(len(study.seeds), 'seed')}"
    for what, group in (("means", main), ("the drives", drives)):
        if group:
            means, few = tables.overview(group, study.baseline), len({c.tracker for c in group}) <= FEW
            title = f"{runs}, {study.settings.loop} loop: {what} with 95 % intervals"
            yield terminal(means.transposed("measure") if few else means, title, narrow=not few, no_wrap=few)
    if len(study.trackers) > 1:
        found = tables.differences(main, study.baseline).only(*SHOWN)
        yield terminal(found, f"difference to {study.baseline} on the same seeds; negative is better")

"""`testbed regret`: what tracking error costs in driving, by drives on the truth, on what is in view, and on tracks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console, RenderableType
from rich.markup import escape

from testbed.environment.sources import conditions
from testbed.environment.sources.conditions import IN_VIEW
from testbed.environment.sources.substitution import GROUPS, subsets
from testbed.evaluation.metric import METRICS
from testbed.experiments import pairs, study
from testbed.experiments.drives import SCHEMA, DriveWatch
from testbed.experiments.engine import Engine
from testbed.experiments.pairs import Drive, key_of
from testbed.experiments.report import junit, words
from testbed.experiments.report import tables_regret as tables
from testbed.experiments.report.grid import terminal, warnings
from testbed.experiments.report.regret import TABLE, Findings, find, write_report
from testbed.experiments.report.texts import say
from testbed.experiments.run import Run
from testbed.experiments.store import Results
from testbed.experiments.study import Progress, Study, Tally, check_sample
from testbed.files import atomic_file
from testbed.frame import TRUTH
from testbed.limits import MOST_RUNS, check_duration, check_names
from testbed.planners import find as find_planner
from trackers.lookup import look_up

DRIVES, PAIRS = "drives.parquet", "pairs.parquet"  # tables in the folder
SHOWN = ("score", "tit", "progress")  # beside the scenario, in 80 columns


class Limit(NamedTuple):
    """How much worse than the truth the mean over the seeds may be, in each scenario with each planner and tracker."""

    measure: str
    most: float  # in the unit of the measure

    @classmethod
    def parse(cls, text: str) -> "Limit":
        """From `NAME=VALUE`; raises LookupError or ValueError, in one sentence."""
        name, _, value = text.partition("=")
        measure = look_up(name, {key: key for key in TABLE if METRICS[key].better}, "limit")
        try:
            most = float(value)
        except ValueError:
            most = nan
        if not (isfinite(most) and most >= 0):
            raise ValueError(f"limit must be NAME=VALUE with a number from 0 on, such as collisions=0, got {text!r}")
        return cls(measure, most)

    def exceeded(self, cell: pairs.Cell) -> str:
        """A sentence where the change of a cell is over the limit, else nothing."""
        worse = -METRICS[cell.measure].better * cell.change.mean.value
        if cell.measure != self.measure or not worse > self.most:
            return ""
        where = f"{cell.condition}, {cell.planner}, {cell.scenario}"
        return f"{where}: {METRICS[self.measure].title} worse by {worse:.3g} than the truth, allowed {self.most:g}"


@dataclass(frozen=True)
class Regret(Study):
    """All scenarios with all planners, conditions and seeds."""

    scenarios: tuple[str, ...]  # NAME or NAME:parameter=value,parameter=value
    planners: tuple[str, ...]
    trackers: tuple[str, ...]  # or conditions of a tracker, such as NAME+covariance=4 or NAME+drop:0.2
    seeds: tuple[int, ...]
    radar: str = "surround"
    duration: float | None = None  # [s], None: the scenario's own
    attribute: bool = False  # also drive with groups of errors
    inject: tuple[str, ...] = ()  # errors put into what is in view, one condition each
    warm_up: float = 1.0  # [s] before the first decision, so that no tracker starts blind; the truth waits as long
    limits: tuple[Limit, ...] = ()  # that decide whether the answer is no

    name: ClassVar[str] = "regret"
    what: ClassVar[str] = "drives"
    schema: ClassVar[pa.Schema] = SCHEMA
    modules: ClassVar[tuple[str, ...]] = (
        "testbed.planners", "testbed.environment.sources", "testbed.experiments.drives",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_names("scenarios", self.scenarios)
        check_names("planners", self.planners)
        if self.trackers or not self.inject:
            check_names("trackers", self.trackers)
        check_sample(self.seeds, "regret")
        if len(set(self.inject)) < len(self.inject):
            raise ValueError(f"inject must differ, got {', '.join(self.inject)}; drop the repetition")
        super().__post_init__()
        check_duration(self.duration)
        if (runs := len(self.work())) > MOST_RUNS:
            raise ValueError(f"a study has at most {MOST_RUNS} drives, got {runs}; take fewer seeds or trackers")

    @property
    def injected(self) -> tuple[str, ...]:
        """The conditions with an injected error."""
        return tuple(str(conditions.parse(f"{IN_VIEW}+{text}")) for text in self.inject)

    @property
    def attributed(self) -> tuple[str, ...]:
        """The trackers whose errors are taken apart: all, or none."""
        return tuple(t for t in self.trackers if is_plain(t)) if self.attribute else ()

    @property
    def conditions(self) -> tuple[str, ...]:
        """All conditions of every seed."""
        partial = [f"{t}:{groups}" for t in self.attributed for groups in subsets() if groups not in ("", GROUPS)]
        return (TRUTH, IN_VIEW, *self.trackers, *partial, *self.injected)

    def work(self) -> list[Run]:
        """All drives, those of one seed next to each other; the self-test of the attribution is of the first seed."""
        found = []
        for seed in self.seeds:
            test = [f"{t}:{GROUPS}" for t in self.attributed if seed == self.seeds[0]]
            for scenario in self.scenarios:
                every = (*self.conditions, *test)
                found += [self.run(Drive(scenario, p, c, seed)) for p in self.planners for c in every]
        return found

    def run(self, drive: Drive) -> Run:
        """One drive."""
        condition = conditions.parse(drive.condition)
        source = str(condition._replace(faults=()))
        return Run(drive.scenario, drive.seed, source, drive.planner, faults=condition.faults, **self.shared())

    def together(self, work: Run) -> int:
        """A seed: what an interruption leaves are whole pairs."""
        return work.seed

    def columns(self, work: Run) -> dict[str, Any]:
        """Scenario, planner, condition and seed."""
        return key_of(work)._asdict()

    def shared(self) -> dict[str, Any]:
        """Radar, duration and warm-up."""
        return {"radar": self.radar, "duration": self.duration, "warm_up": self.warm_up}

    def check(self) -> None:
        """Raise LookupError or ValueError, in one sentence, for what cannot be driven."""
        for planner in self.planners:
            if find_planner(planner).knows_truth:
                raise ValueError(f"planner {planner} has no regret, it plans on the truth; choose another")
        for tracker in self.trackers:
            if conditions.parse(tracker).tracker is None:
                raise ValueError(
                    f"{tracker} is no tracker; truth and in-view are driven anyway, errors are for --inject"
                )
        super().check()

    def watch(self, run: Run) -> DriveWatch:
        """Keeps the curves of a drive."""
        return DriveWatch(run)

    def judge(self, results: Results, tally: Tally) -> study.Findings:
        """The regret by tracker and planner, the changes by scenario, and the self-test of the attribution."""
        same = pairs.self_test(results)
        driven, table = pairs.scored(drives(results), pairs.table(results))
        found = None if table.empty else find(driven, table)
        shown = [] if found is None else list(_overview(found))
        shown += [
            f"[red]self-test[/red] {drive.name} differs from the drive of the tracker itself"
            for drive, equal in same.items()
            if not equal
        ]
        over = (
            [text for cell in found.total for limit in self.limits if (text := limit.exceeded(cell))] if found else []
        )
        shown += [f"[red]limit[/red] {escape(text)}" for text in over]
        if self.limits and not over:
            shown.append(f"within the limits: {', '.join(f'{m}={most:g}' for m, most in self.limits)}")
        failed = found is None or not all(same.values()) or bool(over)
        return study.Findings(shown, failed, Judged(driven, table, found, same))

    def write(self, results: Results, found: study.Findings, console: Console) -> None:
        """Write the tables of drives and of pairs."""
        for name, table in ((DRIVES, found.data.drives), (PAIRS, found.data.pairs)):
            console.print(f"{name:16} {write_table(table, Path(self.out) / name)}", soft_wrap=True)

    def page(self, results: Results, found: Any, tally: Tally, engine: Engine, progress: Progress) -> Path | None:
        """The report, with figures and logs of the worst pairs."""
        return None if found.data.found is None else write_report(results, found.data.found, tally, engine, progress)

    def junit(self, results: Results, found: study.Findings, tally: Tally, path: Path) -> None:
        """A suite a planner and tracker, a case a scenario, which fails where a limit is exceeded.

        Without limits it fails where tracks collide.
        """
        junit.write("regret", list(suites(found.data, tally, self.limits)), path)


class Judged(NamedTuple):
    """What the drives say."""

    drives: pd.DataFrame
    pairs: pd.DataFrame
    found: Findings | None  # None without any pair
    same: dict[Drive, bool]  # whether a drive with all groups of errors is that of its tracker


def suites(found: Judged, tally: Tally, limits: Sequence[Limit] = ()) -> Iterator[junit.Suite]:
    """A suite a planner and tracker, a case a scenario with its changes; then the self-test, and what failed."""
    total = found.found.total if found.found else []
    against_truth = pairs.compared_with(found.pairs, TRUTH)
    for (planner, condition), part in against_truth.groupby(["planner", "condition"], sort=False):
        cases = []
        for scenario, rows in part.groupby("scenario", sort=False):
            own = [c for c in total if (c.scenario, c.planner, c.condition) == (scenario, planner, condition)]
            crashed = rows.loc[rows["collisions"] > 0, "seed"].tolist()
            failure = say("collides", crashed=crashed, seeds=len(rows)) if crashed else ""
            kind, output = "collision", "\n".join(map(sentence, own))
            if limits:
                kind, failure = "limit", "\n".join(filter(None, (limit.exceeded(c) for c in own for limit in limits)))
            cases.append(junit.Case(f"{planner}.{condition}", str(scenario), None, "", kind, failure, output=output))
        yield junit.Suite(f"{planner} {condition}", cases)
    tested = [junit.Case("self-test", drive.name, kind="self-test") for drive in found.same]
    tested = [c if ok else c._replace(failure=say("self-test differs")) for c, ok in zip(tested, found.same.values())]
    failed = [junit.Case("drive", outcome.name, error=outcome.note) for outcome in tally.failed]
    yield junit.Suite("drives", [*tested, *failed])


def sentence(cell: pairs.Cell) -> str:
    """A change in words."""
    v, metric = cell.change.mean, METRICS[cell.measure]
    return f"{metric.title}: {v.value:+.4g} [{v.low:+.4g}, {v.high:+.4g}], {cell.verdict}"


def is_plain(tracker: str) -> bool:
    """Whether a condition is a tracker without groups, injected errors and faults."""
    condition = conditions.parse(tracker)
    return condition.groups is None and not condition.errors.sizes and not condition.faults


def drives(results: Results) -> pd.DataFrame:
    """One row a drive: scenario, planner, condition, seed, measures, errors of its tracker, CPU time [s]."""
    return results.runs.drop(columns="phase")


def write_table(table: pd.DataFrame, path: Path) -> Path:
    """Write a table of drives or of pairs; raises OSError, in one sentence, where it cannot be written."""
    with atomic_file(path) as file:
        pq.write_table(pa.Table.from_pandas(table, preserve_index=False), file)
    return path


def _overview(found: Findings) -> Iterator[RenderableType]:
    """The regret by tracker and planner, the changes by scenario, and what the seeds cannot resolve."""
    if found.together:
        yield terminal(tables.overview(found.together, ""), "regret against the truth, all scenarios")
    for cells, title in ((found.total, "change against the truth"), (found.doses, "change against what is in view")):
        if cells:
            shown = [c for c in cells if c.measure in SHOWN]
            yield terminal(tables.changes(shown, ""), title, narrow=True)
    sentences = [*found.verdict, *words.one_sided(found.total)]
    sentences += words.unresolved_pairs([c for c in found.together if c.measure == pairs.SCORE])
    yield from warnings(sentences)

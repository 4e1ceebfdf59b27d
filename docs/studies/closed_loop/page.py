"""Trackers side by side in closed loop: the page docs/closed-loop.md, its tables and its figure.

The planner uses the first tracker; all get the same detections.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Annotated, Any, ClassVar

import pyarrow as pa
import typer

from scenarios import SCENARIOS, find
from studies.closed_loop.figure import draw
from studies.closed_loop.length_errors import FEWEST, LengthErrors, LengthSamples
from studies.page import DOCS, Docs, Page, fill
from studies.runs import made
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.tables import number
from testbed.command_line.terminal import user_input
from testbed.environment.episode import drive
from testbed.environment.registration import make
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.metric import COSTS, METRICS
from testbed.evaluation.metrics import CUTOFF, mean
from testbed.evaluation.tracking import jsonable
from testbed.experiments.engine import Engine
from testbed.experiments.identity import tracker_digest
from testbed.experiments.run import Run
from testbed.experiments.store import Results, Store
from testbed.experiments.study import WHOLE_RUN, Kept, Study, check_runs
from testbed.files import make_directory, versions, write_atomic
from testbed.frame import Frame
from testbed.limits import check_names, check_seeds
from testbed.log.text import markdown_table
from testbed.planners import find as find_planner

TRACKERS = ("imm-spline", "imm-htg", "htg-map", "edra-imm", "pmht-spline-adaptive", "rm-feldmann")
LONGEST = 20.0  # [s] of a run; only the courses of papers are longer
MEANS = (  # of a tracker's summary or cost
    "gospa", "missed_percent", "false_per_scan", "rmse_position", "rmse_velocity", "rmse_length", "nees_position",
    "nees_velocity", *COSTS,
)  # fmt: skip
TOTALS = ("lost", "switches", "jumps")
RESULTS = "closed-loop.csv"  # GOSPA by scenario
SCHEMA = pa.schema([("tracker", pa.string()), *((name, pa.float64()) for name in LengthSamples._fields)])


class LengthRows(LengthErrors):
    """Watches the drive, and the errors of all trackers in it."""

    def __init__(self, trackers: Sequence[str]) -> None:
        super().__init__(trackers)
        self.drive = DriveEvaluator()

    def __call__(self, frame: Frame) -> None:
        """Take one frame."""
        super().__call__(frame)
        self.drive.step(frame.scene)

    @property
    def table(self) -> pa.Table:
        """One row a vehicle, frame and tracker."""
        parts = [{"tracker": [name] * len(s.error), **s._asdict()} for name, s in self.samples.items()]
        return pa.concat_tables([pa.table(part, SCHEMA) for part in parts])


@dataclass(frozen=True, kw_only=True)
class Family(Study):
    """Trackers side by side in the same drives."""

    trackers: tuple[str, ...] = TRACKERS
    asked: tuple[Run, ...] = ()

    name: ClassVar[str] = "closed-loop"
    schema: ClassVar[pa.Schema] = SCHEMA
    modules: ClassVar[tuple[str, ...]] = ("studies.closed_loop",)

    def work(self) -> list[Run]:
        """All drives."""
        return list(self.asked)

    def settings(self) -> dict[str, Any]:
        """The trackers, the first of which the planner uses."""
        return {"trackers": list(self.trackers), **{f"code of {name}": tracker_digest(name) for name in self.trackers}}

    def make(self, work: Run, store: Store) -> Kept:
        """One drive with all trackers."""
        watch, start, cpu = LengthRows(self.trackers), perf_counter(), process_time()
        first, *others = self.trackers
        options = {"tracker": first, "also": others, "radar": work.radar, "planner": work.planner}
        with closing(make(work.scenario, work.settings, **options)) as env:
            tracked: Any = env
            tracked.attach(watch)
            for _ in drive(env, find_planner(work.planner), work.seed):
                pass
            costs = {name: jsonable(cost.row()) for name, cost in tracked.costs.items()}
        result = {
            "drive": jsonable(watch.drive.summary()),
            "trackers": {name: jsonable(e.summary()) | costs[name] for name, e in watch.evaluators.items()},
        }
        seconds = {"wall": perf_counter() - start, "cpu": process_time() - cpu}
        return Kept(watch.table, [{"phase": WHOLE_RUN}], seconds, {"result": result})


def main(
    docs: Docs = DOCS,
    out: Annotated[str, typer.Option(help="Directory of the runs; those that are there are kept.")] = "runs/family",
    tracker: Annotated[
        list[str] | None, typer.Option(help="Repeat; the planner uses the first. Six of them without it.")
    ] = None,
    scenario: Annotated[list[str] | None, typer.Option(help="Repeat; all without it.")] = None,
    seed: Annotated[list[int] | None, typer.Option(help="Repeat; 0 without it.")] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds; the scenarios' own, 20 at most, without it.")] = None,
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Run trackers side by side in closed loop and write the page closed-loop.md with its tables and its figure.

    Example: PYTHONPATH=docs python -m studies closed-loop --scenario cut-in --tracker htg-map --tracker rm-feldmann
    """
    with user_input():
        trackers = tuple(tracker or TRACKERS)
        check_names("trackers", trackers)
        check_runs([Run("cut-in", source=name) for name in trackers])
        asked = [
            Run(name, s, trackers[0], duration=duration or min(find(name).duration, LONGEST))
            for name in scenario or SCENARIOS
            for s in seed or (0,)
        ]
        check_seeds(*(run.seed for run in asked))
        page = Page("closed-loop", docs)
    results = made(Family(trackers=trackers, asked=tuple(asked), out=out), Engine(jobs, dask))
    draw(lengths(results), page.picture("length-error"))
    make_directory(docs / "results")
    scenarios = [(run.scenario, meta["result"]) for run, meta in results.metas.items()]
    write_atomic(docs / "results" / RESULTS, by_scenario(scenarios))
    page.write(render(results.metas, trackers))


def lengths(results: Results) -> dict[str, LengthSamples]:
    """Length errors of all runs, by tracker."""
    table = pa.concat_tables([results.store.table(run) for run in results.metas]).to_pandas()
    return {
        name: LengthSamples(*own[list(LengthSamples._fields)].to_numpy().T)
        for name, own in table.groupby("tracker", sort=False)
    }


def render(metas: Mapping[Run, Mapping[str, Any]], trackers: Sequence[str]) -> str:
    """What the page says about some runs with the same trackers."""
    first, results, seconds = (
        next(iter(metas)),
        [m["result"] for m in metas.values()],
        [m["seconds"] for m in metas.values()],
    )
    return fill(
        "closed_loop/page.md.j2",
        runs=len(results),
        seconds=sum(r["drive"]["elapsed"] for r in results),
        radar=first.radar,
        first=trackers[0],
        planner=first.planner,
        collisions=sum(r["drive"]["collisions"] for r in results),
        versions=", ".join(f"{name} {version}" for name, version in versions().items()),
        cpu=100 * sum(s["cpu"] for s in seconds) / sum(s["wall"] for s in seconds),
        table=overview(results),
        cutoff=CUTOFF,
        results=RESULTS,
        fewest=FEWEST,
    )


def overview(results: Sequence[Mapping[str, Any]]) -> str:
    """One row a tracker: means and totals over the runs; means are over the runs that measured a figure."""
    rows = []
    for name in results[0]["trackers"]:
        found = [r["trackers"][name] for r in results]
        means = [number(_mean([row[key] for row in found]), METRICS[key].digits) for key in MEANS]
        rows.append((f"`{name}`", *means, *(str(sum(row[key] for row in found)) for key in TOTALS)))
    return markdown_table(("tracker", *(METRICS[key].title for key in MEANS), *TOTALS), rows)


def by_scenario(results: Sequence[tuple[str, Mapping[str, Any]]]) -> str:
    """GOSPA of each tracker as CSV, one row a scenario, means over its seeds; results with their scenarios."""
    names = list(results[0][1]["trackers"])
    rows = [("scenario", *names)]
    for scenario in dict.fromkeys(scenario for scenario, _ in results):
        own = [r["trackers"] for name, r in results if name == scenario]
        rows.append((scenario, *(number(_mean([r[n]["gospa"] for r in own]), 2) for n in names)))
    return "".join(f"{','.join(row)}\n" for row in rows)


def _mean(values: Sequence[float | None]) -> float | None:
    """Mean of what was measured, None where nothing was."""
    known = [v for v in values if v is not None]
    return mean(known) if known else None

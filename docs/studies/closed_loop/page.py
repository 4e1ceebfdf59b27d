"""Trackers side by side in closed loop: the page docs/closed-loop.md, its tables and its figure.

The planner uses the first tracker; all get the same detections.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

from scenarios import SCENARIOS, find
from studies.closed_loop.figure import draw
from studies.closed_loop.length_errors import FEWEST, LengthErrors, LengthSamples, joined
from studies.page import DOCS, Docs, Page, command_line, fill
from testbed.command_line.tables import number
from testbed.command_line.terminal import user_input
from testbed.evaluation.metrics import CUTOFF, mean
from testbed.files import atomic_file
from testbed.log.record import run_id
from testbed.log.text import markdown_table
from testbed.run import RunConfig, check, run

TRACKERS = ("imm-spline", "imm-htg", "htg-map", "edra-imm", "pmht-spline-adaptive", "rm-feldmann")
LONGEST = 20.0  # [s] of a run; only the courses of papers are longer
REUSE = "--reuse"
MEANS = (  # key of a tracker's summary or cost, label, digits
    ("gospa", "GOSPA [m]", 2),
    ("missed_percent", "missed [%]", 1),
    ("false_per_scan", "false a scan", 2),
    ("rmse_position", "position [m]", 2),
    ("rmse_velocity", "velocity [m/s]", 2),
    ("rmse_length", "length [m]", 2),
    ("nees_position", "NEES position", 1),
    ("nees_velocity", "NEES velocity", 1),
    ("ms_per_scan", "ms a scan", 1),
    ("us_per_update", "us an update", 0),
)
TOTALS = ("lost", "switches", "jumps")


class StoredRun(NamedTuple):
    """One run, as it lies in its files."""

    result: dict[str, Any]  # see `Recorder.result`
    lengths: dict[str, LengthSamples]  # by tracker
    date: datetime


def simulate(config: RunConfig, progress: Callable[[float, float], None]) -> StoredRun:
    """Run once; leaves the length errors beside the JSON of the run. typer.Exit when a signal ended it early."""
    probe = LengthErrors(config.trackers)
    files(config)[1].unlink(missing_ok=True)
    done = run(config, progress, [probe])
    if done.interrupted:
        raise typer.Exit(done.exit_status)
    for sentence in done.lost:
        raise OSError(sentence)
    lengths = probe.samples
    with atomic_file(files(config)[1]) as file:
        arrays: dict[str, Any] = {name: np.stack(samples) for name, samples in lengths.items()}
        np.savez_compressed(file, **arrays)
    return StoredRun(done.result, lengths, datetime.now(UTC))


def files(config: RunConfig) -> tuple[Path, Path]:
    """Where a run leaves its results, and its length errors: `LengthSamples` as an array (3, n) for each tracker."""
    duration = None if duration_of(config) == find(config.scenario).duration else config.duration
    stem = run_id(config.scenario, config.trackers, config.radar, config.planner, config.seed, duration)
    return Path(config.out) / f"{stem}.json", Path(config.out) / f"{stem}.npz"


def stored(config: RunConfig) -> StoredRun | None:
    """The complete run with these settings that an earlier call left, or None."""
    results, lengths = files(config)
    if not lengths.exists():
        return None
    result = json.loads(results.read_text())
    with np.load(lengths, allow_pickle=False) as arrays:
        samples = {name: LengthSamples(*arrays[name]) for name in config.trackers}
    return StoredRun(result, samples, datetime.fromtimestamp(lengths.stat().st_mtime, UTC))


def duration_of(config: RunConfig) -> float:
    """Simulated time [s] of a run."""
    return config.duration or find(config.scenario).duration


def run_all(configs: Sequence[RunConfig], reuse: bool) -> list[StoredRun]:
    """All runs, in turn, with a progress bar and one line a run."""
    runs: list[StoredRun] = []
    ends = np.cumsum([duration_of(config) for config in configs])
    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=ends[-1])
        for config, end in zip(configs, ends.tolist(), strict=True):
            what = f"{config.scenario}, seed {config.seed}"
            bar.update(task, description=what)

            def show(done: float, total: float, end: float = end) -> None:
                bar.update(task, completed=end - total + done)

            runs.append((stored(config) if reuse else None) or simulate(config, show))
            bar.update(task, completed=end)
            gospa = [f"{name} {row['gospa']:.2f}" for name, row in runs[-1].result["trackers"].items()]
            bar.console.print(f"{what}: GOSPA {', '.join(gospa)}", soft_wrap=True)
    return runs


def main(
    docs: Docs = DOCS,
    out: Annotated[Path, typer.Option(help="Directory for the results of the runs.")] = Path("runs/family"),
    tracker: Annotated[
        list[str] | None, typer.Option(help="Repeat; the planner uses the first. Six of them without it.")
    ] = None,
    scenario: Annotated[list[str] | None, typer.Option(help="Repeat; all without it.")] = None,
    seed: Annotated[list[int] | None, typer.Option(help="Repeat; 0 without it.")] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds; the scenarios' own, 20 at most, without it.")] = None,
    reuse: Annotated[
        bool, typer.Option(REUSE, help="Take complete runs that lie in OUT instead of repeating them.")
    ] = False,
) -> None:
    """Run trackers side by side in closed loop and write the page closed-loop.md with its tables and its figure.

    Example: PYTHONPATH=docs python -m studies closed-loop --scenario cut-in --tracker htg-map --tracker rm-feldmann
    """
    with user_input():
        configs = [
            RunConfig(
                name,
                tuple(tracker or TRACKERS),
                seed=s,
                duration=duration or min(find(name).duration, LONGEST),
                out=str(out),
                log="off",
            )
            for name in scenario or SCENARIOS
            for s in seed or (0,)
        ]
        for config in configs:
            check(config)
        page = Page("closed-loop", docs)
    runs = run_all(configs, reuse)
    draw(joined([r.lengths for r in runs]), page.picture("length-error"))
    page.write(render([r.result for r in runs]), command_line(REUSE), f"{max(r.date for r in runs):%Y-%m-%d}")


def render(results: Sequence[Mapping[str, Any]]) -> str:
    """What the page says about some runs with the same trackers."""
    first = results[0]["run"]
    return fill(
        "closed_loop/page.md.j2",
        runs=len(results),
        seconds=sum(r["drive"]["elapsed"] for r in results),
        radar=first["radar"],
        first=first["trackers"][0],
        planner=first["planner"],
        collisions=sum(r["drive"]["collisions"] for r in results),
        versions=", ".join(f"{name} {version}" for name, version in first["versions"].items()),
        cpu=100 * sum(r["timing"]["cpu"] for r in results) / sum(r["timing"]["wall"] for r in results),
        table=overview(results),
        cutoff=CUTOFF,
        gospa=by_scenario(results),
        fewest=FEWEST,
    )


def overview(results: Sequence[Mapping[str, Any]]) -> str:
    """One row a tracker: means and totals over the runs; means are over the runs that measured a figure."""
    rows = []
    for name in results[0]["trackers"]:
        found = [r["trackers"][name] | r["timing"]["trackers"][name] for r in results]
        means = [number(_mean([row[key] for row in found]), digits) for key, _, digits in MEANS]
        rows.append((f"`{name}`", *means, *(str(sum(row[key] for row in found)) for key in TOTALS)))
    return markdown_table(("tracker", *(label for _, label, _ in MEANS), *TOTALS), rows)


def by_scenario(results: Sequence[Mapping[str, Any]]) -> str:
    """GOSPA of each tracker, one row a scenario, means over its seeds."""
    names = list(results[0]["trackers"])
    rows = []
    for scenario in dict.fromkeys(r["run"]["scenario"] for r in results):
        own = [r for r in results if r["run"]["scenario"] == scenario]
        rows.append((scenario, *(number(_mean([r["trackers"][n]["gospa"] for r in own]), 2) for n in names)))
    return markdown_table(("scenario", *names), rows)


def _mean(values: Sequence[float | None]) -> float | None:
    """Mean of what was measured, None where nothing was."""
    known = [v for v in values if v is not None]
    return mean(known) if known else None

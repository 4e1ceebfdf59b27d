"""The page "How the trackers compare": docs/comparison.md, made from committed results."""

from pathlib import Path
from typing import Annotated

import typer

from studies.comparison.publish import read, read_part
from studies.page import DOCS, Docs, Page, fill
from testbed.command_line.terminal import user_input
from testbed.evaluation.metric import METRICS
from testbed.evaluation.metrics import CUTOFF
from testbed.experiments.report import tables
from testbed.experiments.report.grid import markdown
from testbed.experiments.statistics import DRIVE, MAIN, cells
from testbed.experiments.store import Results
from trackers import DEFAULT

BY_SCENARIO = ("gospa", "rmse_position", "rmse_length")
BIRTHS = ("birth_delay", "unborn_percent", "never")
DIFFERENCES = ("measure", "mean difference", "probability of improvement", "verdict")


def main(
    docs: Docs = DOCS,
    results: Annotated[Path, typer.Option(help="Directory of the committed results.")] = Path("docs/results"),
) -> None:
    """Write the page "How the trackers compare" from committed results."""
    with user_input((OSError, ValueError)):
        Page("comparison", docs).write(render(results))


def render(folder: Path) -> str:
    """What the page says about the results in a folder."""
    results, known, _ = read(folder)
    comparison = results.study
    settings, baseline = comparison.settings, comparison.baseline
    versions = {k.removeprefix("version of "): v for k, v in known["identity"].items() if k.startswith("version of ")}
    main_cells = list(cells(results, MAIN))
    return fill(
        "comparison/page.md.j2",
        date=known["date"],
        trackers=len(comparison.trackers),
        scenarios=len(comparison.scenarios),
        seeds=len(comparison.seeds),
        runs=len(comparison.work()),
        length=settings.length,
        settle=settings.settle,
        births=markdown(tables.overview(list(cells(results, BIRTHS)), baseline)),
        closed=closed(read_part("closed", folder)),
        radar=settings.radar,
        versions=", ".join(f"{name} {version}" for name, version in versions.items()),
        code=known["identity"]["code"],
        reference=baseline,
        overview=markdown(tables.overview(main_cells, baseline)),
        differences=markdown(tables.differences(main_cells, baseline).only(*DIFFERENCES)),
        layers=layers(read_part("layers", folder)),
        by_scenario="\n\n".join(scenario_part(results, measure) for measure in BY_SCENARIO),
        by_phase=markdown(tables.by_phase(list(cells(results, ("gospa",), by="phase")), baseline, every=True)),
    )


def layers(results: Results | None) -> str:
    """The default tracker with a layer off, held against the complete one."""
    if results is None:
        return "No run was made without a layer."
    comparison = results.study
    return fill(
        "comparison/layers.md.j2",
        default=DEFAULT,
        scenarios=len(comparison.scenarios),
        seeds=len(comparison.seeds),
        length=comparison.settings.length,
        table=markdown(tables.differences(list(cells(results, MAIN)), DEFAULT).only(*DIFFERENCES)),
    )


def scenario_part(results: Results, measure: str) -> str:
    """Every tracker in every scenario by one measure."""
    found = tables.by_scenario(list(cells(results, (measure,), by="scenario")), results.study.baseline)
    note = f"\n\nc = {CUTOFF:g} m, over the rooted Gaussian Wasserstein distance." if measure == "gospa" else ""
    return f"## {METRICS[measure].title} by scenario{note}\n\n{markdown(found)}"


def closed(results: Results | None) -> str:
    """Every tracker with a planner that drives on its tracks: the drives, then the errors."""
    if results is None:
        return "No run was made in closed loop."
    comparison, settings = results.study, results.study.settings
    drives, errors = (list(cells(results, measures)) for measures in (DRIVE, MAIN))
    return fill(
        "comparison/closed.md.j2",
        planner=settings.planner,
        scenarios=", ".join(comparison.scenarios),
        seeds=len(comparison.seeds),
        runs=len(comparison.work()),
        drives=markdown(tables.overview(drives, comparison.baseline)),
        errors=markdown(tables.overview(errors, comparison.baseline)),
    )

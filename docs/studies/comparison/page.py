"""The page "How the trackers compare": docs/comparison.md, made from committed results."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from studies.comparison import committed
from studies.comparison.publish import read, read_part
from studies.page import DOCS, Docs, Page, fill
from testbed.command_line.terminal import user_input
from testbed.evaluation.metric import METRICS
from testbed.evaluation.metrics import CUTOFF
from testbed.experiments.report import tables
from testbed.experiments.report.grid import Grid, markdown
from testbed.experiments.statistics import DRIVE, MAIN, cells
from testbed.experiments.store import Results
from testbed.log.text import markdown_table
from trackers import DEFAULT

BY_SCENARIO = ("gospa", "rmse_position", "rmse_length")
BIRTHS = ("birth_delay", "unborn_percent", "never")
ERRORS = ("position", "velocity", "length")
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
    results, known, frames = read(folder)
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
        by_range=bands(frames["range"]),
        by_visible=bands(frames["visible"]),
        consistency=consistency(tables.consistency(frames["consistency"], baseline)),
        verdicts=verdicts(committed.read(folder / "reproduce")),
        calibration=calibration(json.loads((folder / "calibration.json").read_text())),
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


def bands(table: pd.DataFrame) -> str:
    """Errors by range or by visible share; trackers down, one block of rows a band."""
    rows = []
    for band in dict.fromkeys(table["band"]):
        for _, row in table[table["band"] == band].iterrows():
            errors = (f"{row[e]:.2f} [{row[f'{e}_low']:.2f}, {row[f'{e}_high']:.2f}]" for e in ERRORS)
            rows.append((band, f"`{row['tracker']}`", f"{100 * row['held']:.0f} %", *errors, f"{row['frames']:.0f}"))
    return markdown_table(
        ("band", "tracker", "with a track", "position [m]", "velocity [m/s]", "length [m]", "frames"), rows
    )


def consistency(grid: Grid) -> str:
    """NEES, NIS and coverage; tracker and phase down, the share inside the limits in parentheses behind each mean."""
    rows = []
    for name, (phase, *fields) in grid.lines:
        numbers = [field.text for field in fields]
        means, inside, covered = numbers[:6:2], numbers[1:6:2], numbers[6:]
        shares = (f"{mean} ({share} %)" for mean, share in zip(means, inside, strict=True))
        rows.append((f"`{name}`", phase.text, *shares, *(f"{share} %" for share in covered)))
    heads = ("tracker", "phase", "NEES position", "NEES velocity", "NIS", "length inside", "width inside")
    return markdown_table(heads, rows)


def verdicts(papers: Sequence[dict[str, Any]]) -> str:
    """Claims and verdicts of every paper; a sentence where it was not reproduced."""
    parts = []
    for paper in papers:
        if not paper["verdicts"]:
            parts.append(f"**{paper['title']}**: not reproduced yet.")
            continue
        settings = paper["settings"]
        command = f"`testbed reproduce {paper['paper']} --runs {settings['runs']} --seed {settings['seed']}`"
        rows = [(f"{v['claim']} ({v['source']})", v["outcome"]) for v in paper["verdicts"]]
        parts.append(
            f"**{paper['title']}** ({command}, {paper['date']})\n\n{markdown_table(('claim', 'verdict'), rows)}"
        )
    return "\n\n".join(parts) + "\n\nThe figures behind the verdicts: [reproductions.md](reproductions.md)."


def calibration(known: dict[str, Any]) -> str:
    """Simulated beside real cars."""
    parts = [known["note"]]
    for table in known["tables"]:
        parts.append(f"{table['title']}\n\n{markdown_table(tuple(table['heads']), [tuple(r) for r in table['rows']])}")
    return "\n\n".join(parts)

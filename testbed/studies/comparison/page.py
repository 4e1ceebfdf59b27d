"""The page "How the trackers compare": docs/comparison.md, made from committed results."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from testbed.command_line.terminal import user_input
from testbed.compare.report.tables_terminal import label, text
from testbed.compare.runs.results import Results
from testbed.compare.statistics.analysis import PHASES, Cell, cells
from testbed.compare.statistics.measures import KEYS, MAIN
from testbed.evaluation.metrics import CUTOFF
from testbed.log.text import markdown_table
from testbed.studies.comparison import committed
from testbed.studies.comparison.publish import read
from testbed.studies.page import DOCS, Docs, Page

BY_SCENARIO = ("gospa", "rmse_position", "rmse_length")
ERRORS = ("position", "velocity", "length")
CONSISTENCY = ("nees_position", "nees_velocity", "nis")

PAGE = """# How the trackers compare

From the committed results of {date}: {trackers} trackers, {scenarios} scenarios, {seeds} seeds each, {runs} runs of
{seconds} on common random numbers.
In every scenario and seed all trackers get the same detections of the radar `{radar}`, recorded once with a planner
that knows the truth. Brackets hold 95 % bootstrap intervals over seeds. [results.md](results.md) defines the
measures, [comparing.md](comparing.md) the statistics; `make comparison` repeats the runs.

Versions: {versions}. Digest of the code behind the runs: `{code}`.

The same as one page with figures: [comparison/report.html](comparison/report.html).

## All scenarios

Means over scenarios of the means over seeds. A consistent filter has a NEES of 2.

{overview}

## Differences to `{reference}`

Tracker minus reference on the same seeds; negative is better. For the NEES it is the distance from 2 that is compared.
A verdict is given where the interval leaves out zero.

{differences}

{by_scenario}

## GOSPA [m] by phase of the maneuver

{by_phase}

## By range

RMSE of counted vehicles with a track that fits, and the share of frames that have one.

{by_range}

## By visible share

Visible is the share of the outline facing the sensors that other vehicles do not hide. A vehicle counts while the radar
could see it within the last second, so "hidden" is that second.

{by_visible}

## Do they know how wrong they are?

Means over the frames of all phases, ideal 2, and in parentheses the share of instants at which the mean over runs and
objects keeps its 95 % chi-square limits. "Length inside" and "width inside" are the shares of frames in which the truth
lies in the 95 % interval that the tracker claims.

{consistency}

![NEES of the position over time against its limits](comparison/figures/time_nees_position.png)

## What the papers claim

{verdicts}

## The radar against real detections

{calibration}
"""


def main(
    docs: Docs = DOCS,
    results: Annotated[Path, typer.Option(help="Directory of the committed results.")] = Path("docs/results"),
) -> None:
    """Write the page "How the trackers compare" from committed results."""
    with user_input((OSError, ValueError)):
        Page("comparison", docs).write(render(results))


def render(folder: Path) -> str:
    """What the page says about the results in a folder."""
    results, known, tables = read(folder)
    comparison = results.comparison
    settings = comparison.settings
    versions = {k.removeprefix("version of "): v for k, v in known["identity"].items() if k.startswith("version of ")}
    main_cells = list(cells(results, MAIN))
    return PAGE.format(
        date=known["date"],
        trackers=len(comparison.trackers),
        scenarios=len(comparison.scenarios),
        seeds=len(comparison.seeds),
        runs=len(comparison.tasks),
        seconds=f"{settings.duration:g} s" if settings.duration else "the scenarios' own length",
        radar=settings.radar,
        versions=", ".join(f"{name} {version}" for name, version in versions.items()),
        code=known["identity"]["code"],
        reference=comparison.baseline,
        overview=grid(main_cells, list(MAIN), across="measure"),
        differences=differences(main_cells),
        by_scenario="\n\n".join(scenario_part(results, measure) for measure in BY_SCENARIO),
        by_phase=grid(list(cells(results, ("gospa",), by="phase")), list(PHASES), across="group"),
        by_range=bands(tables["range"]),
        by_visible=bands(tables["visible"]),
        consistency=consistency(tables["consistency"]),
        verdicts=verdicts(committed.read(folder / "reproduce")),
        calibration=calibration(json.loads((folder / "calibration.json").read_text())),
    )


def grid(found: Sequence[Cell], columns: Sequence[str], across: str) -> str:
    """Trackers down, measures or groups across."""
    at = {(c.tracker, getattr(c, across)): text(c.mean, KEYS[c.measure].digits) for c in found}
    heads = [label(c) if across == "measure" else c for c in columns]
    trackers = dict.fromkeys(c.tracker for c in found)
    rows = [(f"`{t}`", *(at.get((t, column), "–") for column in columns)) for t in trackers]
    return markdown_table(("tracker", *heads), rows)


def differences(found: Sequence[Cell]) -> str:
    """Every paired difference with its verdict."""
    rows = []
    for c in found:
        d = c.difference
        if d is not None:
            digits = KEYS[c.measure].digits + 1
            rows.append((f"`{c.tracker}`", label(c.measure), text(d.mean, digits), text(d.improvement, 2), d.verdict))
    return markdown_table(("tracker", "measure", "mean difference", "probability of improvement", "verdict"), rows)


def scenario_part(results: Results, measure: str) -> str:
    """Every tracker in every scenario by one measure."""
    found = list(cells(results, (measure,), by="scenario"))
    at = {(c.group, c.tracker): text(c.mean, KEYS[measure].digits) for c in found}
    trackers = results.comparison.trackers
    rows = [(s, *(at.get((s, t), "–") for t in trackers)) for s in results.comparison.scenarios]
    note = f"\n\nc = {CUTOFF:g} m, over the rooted Gaussian Wasserstein distance." if measure == "gospa" else ""
    return f"## {label(measure)} by scenario{note}\n\n" + markdown_table(("scenario", *trackers), rows)


def bands(table: pd.DataFrame) -> str:
    """Errors by range or by visible share; trackers down, one block of rows a band."""
    rows = []
    for band in dict.fromkeys(table["band"]):
        for _, row in table[table["band"] == band].iterrows():
            errors = (f"{row[e]:.2f} [{row[f'{e}_low']:.2f}, {row[f'{e}_high']:.2f}]" for e in ERRORS)
            rows.append((band, f"`{row['tracker']}`", f"{100 * row['held']:.0f} %", *errors, f"{row['looks']:.0f}"))
    return markdown_table(
        ("band", "tracker", "with a track", "position [m]", "velocity [m/s]", "length [m]", "frames"), rows
    )


def consistency(table: pd.DataFrame) -> str:
    """NEES, NIS and coverage, tracker and phase down."""
    rows = []
    for _, row in table.iterrows():
        shares = (f"{row[q]:.1f} ({100 * row[f'{q}_inside']:.0f} %)" for q in CONSISTENCY)
        covered = (f"{100 * row[f'{side}_covered']:.0f} %" for side in ("length", "width"))
        rows.append((f"`{row['tracker']}`", row["phase"], *shares, *covered))
    heads = ("tracker", "phase", "NEES position", "NEES velocity", "NIS", "length inside", "width inside")
    return markdown_table(heads, rows)


def verdicts(papers: Sequence[dict[str, Any]]) -> str:
    """What became of every claim; papers without a reproduction say so."""
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

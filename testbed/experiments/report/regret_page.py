"""The report page of a study: tables, figures, logs of the worst pairs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from testbed.environment.sources.conditions import IN_VIEW
from testbed.experiments import pairs as analysis
from testbed.experiments.pairs import Cell
from testbed.experiments.report import links
from testbed.experiments.report import regret_logs as logs
from testbed.experiments.report import regret_tables as tables
from testbed.experiments.report import regret_words as words
from testbed.experiments.report.figures import FOLDER, FigureFiles
from testbed.experiments.report.grouping import failures
from testbed.experiments.report.links import LogFiles, href
from testbed.experiments.report.page import seeds_text, template
from testbed.experiments.report.regret_figures import draw
from testbed.experiments.run import FAILED, Outcome
from testbed.experiments.store import Results
from testbed.experiments.study import Tally
from testbed.files import write_atomic
from testbed.frame import TRUTH

NAME = "report.html"
TEMPLATE = "regret.html.j2"
REGRET = "Drive score on the truth minus that on tracks [s]."
TABLE = (
    "drive_score", "collisions", "drac_max", "tit", "progress", "deceleration_max", "extra_braking", "changed",
)  # fmt: skip
ATTRIBUTED = ("drive_score", "drac_max", "progress")  # measures that are taken apart
PARTS = (
    ("verdict", "Verdict"), ("overview", "Overview"), ("total", "Total"), ("tracking", "Tracking"),
    ("sensing", "Sensing"), ("attribution", "Attribution"), ("doses", "Doses"), ("errors", "Errors"),
    ("figures", "Figures"), ("worst", "Worst pairs"), ("runs", "Failures"),
    ("about", "Provenance"),
)  # fmt: skip


class Findings(NamedTuple):
    """Everything that a page shows, from the tables of drives and of pairs alone."""

    together: list[Cell]  # over all scenarios, against the truth
    total: list[Cell]  # by scenario, against the truth
    tracking: list[Cell]  # by scenario, against what is in view
    sensing: list[Cell]  # by scenario, what is in view against the truth
    sensing_together: list[Cell]
    doses: list[Cell]  # by scenario, injected errors against what is in view
    shares: list[analysis.Attribution]
    errors: pd.DataFrame
    ranks: list[analysis.Correlation]
    worst: list[analysis.WorstPair]
    verdict: list[str]


def find(drives: pd.DataFrame, pairs: pd.DataFrame) -> Findings:
    """All findings of a study."""
    injected = pairs["condition"].str.startswith(f"{IN_VIEW}+")
    tracked, doses = pairs[~injected], analysis.compared_with(pairs[injected], IN_VIEW)
    total = analysis.compared_with(tracked, TRUTH)
    sensing = analysis.compared_with(tracked, TRUTH, sensing=True)
    together = list(analysis.cells(total, TABLE, together=True))
    apart = list(analysis.cells(sensing, ("drive_score",), together=True))
    shares = list(analysis.attributions(drives, ATTRIBUTED))
    errors = analysis.error_and_regret(drives, total)
    ranks = analysis.correlations(errors)
    of_score = [a for a in shares if a.measure == "drive_score"]
    return Findings(
        together=together,
        total=list(analysis.cells(total, TABLE)),
        tracking=list(analysis.cells(analysis.compared_with(tracked, IN_VIEW), TABLE)),
        sensing=list(analysis.cells(sensing, TABLE)),
        sensing_together=apart,
        doses=list(analysis.cells(doses, TABLE)),
        shares=shares,
        errors=errors,
        ranks=ranks,
        worst=analysis.worst_pairs(total),
        verdict=words.verdict([c for c in together if c.measure == "drive_score"], apart, of_score, ranks, total),
    )


def write_page(results: Results, found: Findings, tally: Tally) -> Path:
    """Write the page, its figures and the logs of the worst pairs; returns its path.

    Raises OSError, in one sentence, where the disk is full or must not be written.
    """
    folder = Path(results.study.out)
    drawn = draw(*drawable(found), folder / FOLDER)
    outcomes = logs.write(found.worst, results.study)
    path = folder / NAME
    write_atomic(path, render(results, found, tally, drawn, outcomes))
    return path


def render(
    results: Results,
    found: Findings,
    tally: Tally,
    drawn: Sequence[FigureFiles] = (),
    outcomes: Sequence[Outcome] = (),
) -> str:
    """The page itself."""
    study, folder = results.study, Path(results.study.out)
    facts = [
        ("scenarios", ", ".join(study.scenarios)),
        ("planners", ", ".join(study.planners)),
        ("trackers", ", ".join(study.trackers) or "none"),
        ("seeds", f"{len(study.seeds)}: {seeds_text(study.seeds)}"),
        ("radar", study.radar),
        ("drives", f"{len(results.metas)} of {len(study.work())}"),
        ("CPU time of the drives", f"{results.runs['cpu'].sum():.0f} s"),
    ]
    return template(TEMPLATE).render(
        title=f"Regret of {len(study.trackers)} trackers" if study.trackers else "Regret of injected errors",
        parts=PARTS,
        verdict=found.verdict,
        facts=facts,
        open_questions=analysis.unresolved(found.total),
        one_sided=analysis.one_sided(found.total),
        figures=[(d, href(d.svg, folder), href(d.png, folder)) for d in drawn],
        logs=[_log(pair, o, folder) for pair, o in zip(found.worst, outcomes, strict=False)],
        failures=failures(tally.failed),
        missing=results.missing,
        **grids(found),
    )


def grids(found: Findings) -> dict[str, Any]:
    """All tables by their names in the template, None for what there are no data for."""
    vs_truth, vs_view = "Drive on tracks minus drive on the truth.", "Drive minus drive on what is in view."
    return {
        "overview": found.together and tables.overview(ranked(found.together), REGRET),
        "total": found.total and tables.changes(found.total, vs_truth),
        "tracking": found.tracking and tables.changes(found.tracking, vs_view),
        "sensing": found.sensing
        and tables.changes(found.sensing, "Drive on what is in view minus drive on the truth."),
        "attribution": found.shares and tables.attribution(found.shares),
        "doses": found.doses and tables.changes(found.doses, vs_view),
        "errors": found.ranks and tables.correlation(found.ranks),
        "worst": found.worst and tables.worst(found.worst),
    }


def ranked(cells: Sequence[Cell]) -> list[Cell]:
    """Cells over all scenarios, those of the condition with the least mean regret over the planners first."""
    cost: dict[str, list[float]] = {}
    for cell in _only_score(cells):
        cost.setdefault(cell.condition, []).append(-cell.change.mean.value)
    return sorted(cells, key=lambda c: float(np.mean(cost.get(c.condition, [np.inf]))))


def drawable(
    found: Findings,
) -> tuple[list[Cell], list[analysis.Attribution], pd.DataFrame, list[Cell]]:
    """What `figures.draw` takes: all of it in the drive score."""
    return (
        _only_score(found.total),
        [a for a in found.shares if a.measure == "drive_score"],
        found.errors,
        _only_score(found.doses),
    )


def _only_score(cells: Sequence[Cell]) -> list[Cell]:
    return [c for c in cells if c.measure == "drive_score"]


def _log(pair: analysis.WorstPair, outcome: Outcome, folder: Path) -> tuple[str, LogFiles]:
    """Name of a pair, and its log."""
    if outcome.status == FAILED:
        return pair.drive.name, LogFiles(note=outcome.note)
    return pair.drive.name, links.found(logs.log_path(pair.drive, folder), folder, "not here")

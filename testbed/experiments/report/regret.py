"""The page of a study of regret: tables, figures, logs of the worst pairs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from testbed.environment.sources.conditions import IN_VIEW
from testbed.experiments import pairs as analysis
from testbed.experiments.engine import Engine
from testbed.experiments.pairs import Cell
from testbed.experiments.report import figures_regret, logs, words
from testbed.experiments.report import tables_regret as tables
from testbed.experiments.report.page import Page, Step, write_page
from testbed.experiments.report.texts import numbered, say, seeds_fact
from testbed.experiments.run import FAILED
from testbed.experiments.store import Results
from testbed.experiments.study import Progress, Tally
from testbed.frame import TRUTH
from trackers import DEFAULT

TEMPLATE = "regret.html.j2"
TABLE = (
    "score", "collisions", "drive_value", "drac_max", "tit", "progress", "deceleration_max", "extra_braking", "changed",
)  # fmt: skip
ATTRIBUTED = ("score", "drive_value", "drac_max", "progress")  # measures that are taken apart


class Findings(NamedTuple):
    """Everything that a page shows, from the tables of drives and of pairs alone."""

    together: list[Cell]  # over all scenarios, against the truth
    orders: list[Cell]  # score by scenario, other trackers against the first
    total: list[Cell]  # by scenario, against the truth
    tracking: list[Cell]  # by scenario, against what is in view
    sensing: list[Cell]  # by scenario, what is in view against the truth
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
    tracking = analysis.compared_with(tracked, IN_VIEW)
    together = list(analysis.cells(total, TABLE, together=True))
    shares = list(analysis.attributions(drives, ATTRIBUTED))
    errors = analysis.error_and_regret(drives, total)
    ranks = analysis.correlations(errors)
    of_score = [a for a in shares if a.measure == analysis.SCORE]
    trackers = [name for name in total["condition"].unique() if IN_VIEW not in name]
    first = DEFAULT if DEFAULT in trackers else next(iter(trackers), "")
    orders = [
        cell._replace(condition=f"{cell.condition}{words.MINUS}{first}")
        for cell in analysis.cells(analysis.against(drives, first), (analysis.SCORE,))
    ]
    on_truth, on_view, of_view, of_doses = (
        list(analysis.cells(part, TABLE)) for part in (total, tracking, sensing, doses)
    )
    worst = analysis.worst_pairs(total)
    scores, in_view = _only_score(on_truth), _only_score(of_view)
    verdict = words.regret(scores, orders, in_view, of_score, ranks, total)
    return Findings(together, orders, on_truth, on_view, of_view, of_doses, shares, errors, ranks, worst, verdict)


def write_report(
    results: Results, found: Findings, tally: Tally, engine: Engine, progress: Progress | None = None
) -> Path:
    """Write the page, its figures and the logs of the worst pairs; returns its path. OSError as in `write_page`."""
    folder = Path(results.study.out)

    def links(step: Step | None) -> list[tuple[str, logs.LogFiles]]:
        paths = {pair: logs.pair_path(pair.drive, folder) for pair in found.worst}
        outcomes = logs.write_missing(paths, logs.write_pair_log, results.study, engine, step)
        notes = {outcome.name: outcome.note for outcome in outcomes if outcome.status == FAILED}
        return [(pair.name, logs.found(path, folder, notes.get(pair.name, "not here"))) for pair, path in paths.items()]

    return write_page(page_of(results, found, tally)._replace(links=links), folder, progress)


def page_of(results: Results, found: Findings, tally: Tally) -> Page:
    """The page without its logs."""
    study = results.study
    facts = [
        numbered("scenario", study.scenarios),
        numbered("planner", study.planners),
        numbered("tracker", study.trackers),
        seeds_fact(study.seeds),
        ("radar", study.radar),
        ("drives", f"{len(results.metas)} of {len(study.work())}"),
        ("CPU time of the drives", f"{results.runs['cpu'].sum():.0f} s"),
    ]
    values = {
        "title": say("regret title", trackers=study.trackers),
        "verdict": found.verdict,
        "caveats": words.few_seeds(results.runs, ["scenario", "planner", "condition"], len(study.seeds)),
        "facts": facts,
        "open_questions": words.unresolved_pairs(found.total),
        "one_sided": words.one_sided(found.total),
        "planners": len(study.planners),
        "pairs": len(found.worst),
        **grids(found),
    }
    return Page(TEMPLATE, values, figures_regret.plots(*drawable(found)), tally.failed, results.missing)


def grids(found: Findings) -> dict[str, Any]:
    """All tables by their names in the template, None for what there are no data for."""
    vs_truth, vs_view, sensing = (say(k) for k in ("tracks minus truth", "drive minus in view", "in view minus truth"))
    return {
        "overview": found.together and tables.overview(ranked(found.together), say("regret")),
        "total": found.total and tables.changes(found.total, vs_truth),
        "tracking": found.tracking and tables.changes(found.tracking, vs_view),
        "sensing": found.sensing and tables.changes(found.sensing, sensing),
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


def drawable(found: Findings) -> tuple[list[Cell], list[analysis.Attribution], pd.DataFrame, list[Cell]]:
    """What `figures_regret.plots` takes: all of it in the drive score."""
    shares = [share for share in found.shares if share.measure == analysis.SCORE]
    return _only_score(found.total), shares, found.errors, _only_score(found.doses)


def _only_score(cells: Sequence[Cell]) -> list[Cell]:
    return [c for c in cells if c.measure == analysis.SCORE]

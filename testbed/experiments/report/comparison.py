"""The page of a comparison: the verdict in words, all tables, the figures and links to the logs."""

from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from testbed.experiments.engine import Engine
from testbed.experiments.report import figures, logs, tables, words
from testbed.experiments.report.page import Page, Step, stage, write_page
from testbed.experiments.report.texts import numbered, say, seeds_fact
from testbed.experiments.run import FAILED, Outcome
from testbed.experiments.series import BANDS, by_band, consistency
from testbed.experiments.statistics import DRIVE, MAIN, cells
from testbed.experiments.store import Results
from testbed.experiments.study import Progress, Tally

TEMPLATE = "compare.html.j2"
BY_PHASE = ("gospa", "missed_percent", "rmse_position")
NO_LOG = "not here: the command that made the runs leaves it beside its own report"


class LogLink(NamedTuple):
    """A line of the table of logs."""

    pick: logs.Pick
    log: logs.LogFiles


def write_report(
    results: Results,
    tally: Tally,
    engine: Engine = Engine(),  # noqa: B008 - frozen
    progress: Progress | None = None,
) -> Path:
    """Write OUT/report.html with its figures and the logs of the picked runs; returns the path of the page.

    progress: progress(done, total, what) with what is being made: tables, figures, then logs. Raises OSError, in one
    sentence, where the disk is full or must not be written.
    """
    folder = Path(results.study.out)
    page = page_of(results, tally, stage(progress, "tables"))

    def links(step: Step | None) -> list[LogLink]:
        return links_of(results, folder, logs.write(results, engine, step))

    return write_page(page._replace(links=links), folder, progress)


def page_of(results: Results, tally: Tally | None, step: Step | None = None) -> Page:
    """The page without its logs; without a tally it shows which runs are missing, but not why."""
    show = step or (lambda done, total: None)
    show(0, 2)
    bands = {band: pd.DataFrame() if results.runs.empty else by_band(results, band) for band in BANDS}
    show(1, 2)
    values = _about(results, tally) | _tables(results, bands)
    show(2, 2)
    return Page(TEMPLATE, values, figures.plots(results, bands), tally.failed if tally else [], results.missing)


def links_of(results: Results, folder: Path, outcomes: Sequence[Outcome] = ()) -> list[LogLink]:
    """A line of each of the picked runs, with its log where that is there."""
    notes = {outcome.name: outcome.note for outcome in outcomes if outcome.status == FAILED}
    return [
        LogLink(pick, logs.found(logs.log_path(pick, folder), folder, notes.get(pick.name, NO_LOG)))
        for pick in logs.picks(results)
    ]


def _tables(results: Results, bands: dict[str, pd.DataFrame]) -> dict[str, Any]:
    """All tables by their names in the template, None for what there are no data for, and the sentences."""
    baseline = results.study.baseline if len(results.study.trackers) > 1 else ""
    main = list(cells(results, MAIN))
    scenarios = list(cells(results, ("gospa",), by="scenario"))
    phases = list(cells(results, BY_PHASE, by="phase"))
    drives = list(cells(results, DRIVE))
    known = pd.DataFrame() if results.runs.empty else consistency(results)
    several = any(c.difference for c in main)
    return {
        "verdict": words.verdict(results, main),
        "caveats": words.caveats(results, main),
        "open_questions": words.unresolved(main),
        "differences_known": sum(c.difference is not None for c in main),
        "ranking": tables.ranking(results, main),
        "reach": words.reach(results),
        "overview": tables.overview(main, baseline) if main else None,
        "drives": tables.overview(drives, baseline, "signs") if drives else None,
        "differences": tables.differences(main, baseline) if several else None,
        "by_scenario": tables.by_scenario(scenarios, baseline) if scenarios else None,
        "by_phase": tables.by_phase(phases, baseline) if phases else None,
        **{f"by_{band}": None if t.empty else tables.by_band(t, band, baseline) for band, t in bands.items()},
        "consistency": None if known.empty else tables.consistency(known, baseline),
    }


def _about(results: Results, tally: Tally | None) -> dict[str, Any]:
    """What was compared, as (term, text) pairs, and where the time went as (part, seconds, share)."""
    comparison = results.study
    settings = comparison.settings
    made = len(comparison.work()) - len(results.missing)
    shares = results.shares
    total = sum(shares.values())
    facts = [
        numbered("tracker", comparison.trackers),
        *([("reference", comparison.baseline)] if len(comparison.trackers) > 1 else []),
        numbered("scenario", comparison.scenarios),
        seeds_fact(comparison.seeds),
        *comparison.facts(),
        ("length of a run", settings.length),
        ("not in the means", f"the first {settings.settle:g} s of each run" if settings.settle else "nothing"),
        ("radar", settings.radar),
        ("loop", say(f"{settings.loop} loop", planner=settings.planner)),
        ("runs", say("runs made", made=made, runs=len(comparison.work()), missing=len(results.missing))),
        ("made", _date(results)),
        *_identity(results),
    ]
    if tally and tally.wall:
        facts.append(("wall time", say("wall time", seconds=f"{tally.wall:.0f}", done=tally.done, found=tally.found)))
    return {
        "title": say("comparison title", trackers=comparison.trackers),
        "facts": facts,
        "shares": [(part, seconds, seconds / total) for part, seconds in shares.items()] if total else [],
        "total": total,
        "reference": comparison.baseline,
        "trackers": len(comparison.trackers),
        "scenarios": len(comparison.scenarios),
        "runs": made,
    }


def _identity(results: Results) -> list[tuple[str, str]]:
    """Versions, and the digest of the code, of the folder with the runs; nothing where it does not say."""
    known = dict[str, Any]()
    with suppress(ValueError):  # it is damaged
        known = results.store.about()
    if not known:
        return []
    prefix = "version of "
    versions = ", ".join(f"{k.removeprefix(prefix)} {v}" for k, v in known.items() if k.startswith(prefix))
    return [("versions", versions), ("digest of the code", str(known["code"]))]


def _date(results: Results) -> str:
    times = [path.stat().st_mtime for run in results.metas if (path := results.store.path(run)).exists()]
    return f"{datetime.fromtimestamp(max(times), UTC):%Y-%m-%d %H:%M} UTC" if times else "not yet"

"""The report of a comparison: one page with the verdict in words, all tables, the figures and links to the logs."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from testbed.experiments.bands import BANDS, by_band, consistency
from testbed.experiments.engine import Engine
from testbed.experiments.report import figures, grouping
from testbed.experiments.report import links as report_links
from testbed.experiments.report import logs as log_files
from testbed.experiments.report import tables as report_tables
from testbed.experiments.report import words as report_words
from testbed.experiments.report.links import LogFiles, href
from testbed.experiments.report.ranking import ranking
from testbed.experiments.report.tables import Grid
from testbed.experiments.run import FAILED
from testbed.experiments.statistics import DRIVE, MAIN, cells, unresolved
from testbed.experiments.store import Results
from testbed.experiments.study import Progress, Tally
from testbed.files import make_directory, write_atomic

NAME = "report.html"
TEMPLATE = "report.html.j2"
BY_PHASE = ("gospa", "missed_percent", "rmse_position")
NO_LOG = "not here: the command that made the runs leaves it beside its own report"


class LogLink(NamedTuple):
    """A line of the table of logs."""

    pick: log_files.Pick
    log: LogFiles


def write_report(
    results: Results,
    tally: Tally | None = None,
    out: Path | None = None,
    logs: bool = True,
    engine: Engine = Engine(),  # noqa: B008 - frozen
    progress: Progress | None = None,
) -> Path:
    """Write OUT/report.html with its figures and, where asked for, its logs; returns the path of the page.

    Args:
        results: of a folder.
        tally: how the runs ended; without it the page shows which are missing, but not why.
        out: where page and figures go; None: the folder of the results.
        logs: whether to replay, or to drive again, the best, the median and the worst run of each tracker. Their logs
            go into the folder of the results, and only a page there has links to them.
        engine: on which the logs are made.
        progress: progress(done, total, what) with what is being made: tables, figures, then logs.

    Raises OSError, in one sentence, where the disk is full or must not be written.
    """
    folder = Path(out or results.study.out)
    make_directory(folder)
    show = _stage(progress, "tables") or (lambda done, total: None)
    show(0, 2)
    bands = bands_of(results)
    show(1, 2)
    tables = tables_of(results, bands)
    show(2, 2)
    drawn = figures.draw(results, bands, folder, _stage(progress, "figures"))
    links = _logs(results, folder, logs, engine, _stage(progress, "logs"))
    path = folder / NAME
    write_atomic(path, render(results, tally, tables, drawn, links, folder))
    return path


def render(
    results: Results,
    tally: Tally | None,
    tables: dict[str, Any],
    drawn: Sequence[figures.FigureFiles] = (),
    links: Sequence[LogLink] = (),
    folder: Path = Path(),
) -> str:
    """The page itself, for a folder in which figures and logs lie; tables as from `tables_of`."""
    return template(TEMPLATE).render(
        **_about(results, tally),
        **tables,
        figures=[(d, href(d.svg, folder), href(d.png, folder)) for d in drawn],
        links=links,
        no_logs=_common_note(links),
        failures=grouping.failures(tally.failed if tally else []),
        missing=results.missing,
    )


def bands_of(results: Results) -> dict[str, pd.DataFrame]:
    """Errors by range and by visible share; empty tables where no run is finished."""
    return {band: pd.DataFrame() if results.runs.empty else by_band(results, band) for band in BANDS}


def template(name: str) -> Any:
    """One of the pages, from the folder of templates."""
    loader = PackageLoader("testbed.experiments.report", "templates")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template(name)


def _stage(progress: Progress | None, what: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, total: progress(done, total, what)


def tables_of(results: Results, bands: dict[str, pd.DataFrame]) -> dict[str, Any]:
    """All tables by their names in the template, None for what there are no data for, and the sentences."""
    baseline = results.study.baseline
    main = list(cells(results, MAIN))
    scenarios = list(cells(results, ("gospa",), by="scenario"))
    phases = list(cells(results, BY_PHASE, by="phase"))
    drives = list(cells(results, DRIVE))
    known = pd.DataFrame() if results.runs.empty else consistency(results)
    several = any(c.difference for c in main)
    return {
        "verdict": report_words.verdict(results, main),
        "caveats": report_words.caveats(results, main),
        "open_questions": unresolved(main),
        "differences_known": sum(c.difference is not None for c in main),
        "ranking": ranking(results, main),
        "reach": grouping.reach(results),
        "overview": report_tables.overview(main, baseline) if main else None,
        "drives": report_tables.overview(drives, baseline, report_tables.SIGNS) if drives else None,
        "differences": report_tables.differences(main, baseline) if several else None,
        "by_scenario": report_tables.by_scenario(scenarios, baseline) if scenarios else None,
        "by_phase": report_tables.by_phase(phases, baseline) if phases else None,
        "by_range": _band(bands, "range", baseline),
        "by_visible": _band(bands, "visible", baseline),
        "consistency": None if known.empty else report_tables.consistency(known, baseline),
    }


def _band(bands: dict[str, pd.DataFrame], band: str, baseline: str) -> Grid | None:
    return None if bands[band].empty else report_tables.by_band(bands[band], band, baseline)


def _about(results: Results, tally: Tally | None) -> dict[str, Any]:
    """What was compared, as (term, text) pairs, and where the time went as (part, seconds, share)."""
    comparison = results.study
    settings = comparison.settings
    made = len(comparison.work()) - len(results.missing)
    shares = results.shares
    total = sum(shares.values())
    facts = [
        ("trackers", f"{len(comparison.trackers)}: {', '.join(comparison.trackers)}"),
        ("reference", comparison.baseline),
        ("scenarios", f"{len(comparison.scenarios)}: {', '.join(comparison.scenarios)}"),
        ("seeds", f"{len(comparison.seeds)}: {seeds_text(comparison.seeds)}"),
        ("length of a run", settings.length),
        ("not in the means", f"the first {settings.settle:g} s of each run" if settings.settle else "nothing"),
        ("radar", settings.radar),
        ("loop", _loop(settings.loop, settings.planner)),
        (
            "runs",
            f"{made} of {len(comparison.work())}" + (f", {len(results.missing)} missing" if results.missing else ""),
        ),
        ("made", _date(results)),
        *_identity(results),
    ]
    if tally and tally.wall:
        facts.append(("wall time", f"{tally.wall:.0f} s for {tally.done} runs; {tally.found} were there already"))
    return {
        "title": f"Comparison of {len(comparison.trackers)} trackers"
        if len(comparison.trackers) > 1
        else f"Results of {comparison.trackers[0]}",
        "facts": facts,
        "shares": [(part, seconds, seconds / total) for part, seconds in shares.items()] if total else [],
        "total": total,
        "reference": comparison.baseline,
    }


def _loop(loop: str, planner: str) -> str:
    if loop == "open":
        return "open: every tracker gets the same recorded detections; the planner of the recording knows the truth"
    return f"closed: the planner {planner} uses each tracker; the same traffic and radar noise at the start"


def _identity(results: Results) -> list[tuple[str, str]]:
    """Versions, and the digest of the code, of the folder with the runs; nothing where it does not say."""
    try:
        known = results.store.about()
    except ValueError:
        known = {}
    if not known:
        return []
    prefix = "version of "
    versions = ", ".join(f"{k.removeprefix(prefix)} {v}" for k, v in known.items() if k.startswith(prefix))
    return [("versions", versions), ("digest of the code", str(known["code"]))]


def _date(results: Results) -> str:
    times = [path.stat().st_mtime for run in results.metas if (path := results.store.path(run)).exists()]
    return f"{datetime.fromtimestamp(max(times), UTC):%Y-%m-%d %H:%M} UTC" if times else "not yet"


def seeds_text(seeds: tuple[int, ...]) -> str:
    """Seeds as people write them.

    >>> seeds_text((0, 1, 2, 3)), seeds_text((1, 5))
    ('0 to 3', '1, 5')
    """
    first, last = min(seeds), max(seeds)
    gapless = len(seeds) > 2 and sorted(seeds) == list(range(first, last + 1))
    return f"{first} to {last}" if gapless else ", ".join(map(str, seeds))


def _logs(
    results: Results, folder: Path, wanted: bool, engine: Engine, progress: Callable[[int, int], None] | None
) -> list[LogLink]:
    found = log_files.picks(results)
    notes: dict[str, str] = {}
    if wanted:
        outcomes = log_files.write(results, found, engine, progress)
        notes = {outcome.name: outcome.note for outcome in outcomes if outcome.status == FAILED}
    links = []
    for pick in found:
        path = log_files.log_path(pick, folder)
        links.append(LogLink(pick, report_links.found(path, folder, notes.get(pick.name, NO_LOG))))
    return links


def _common_note(links: Sequence[LogLink]) -> str:
    """Why there is no log at all, empty where some are there or the reasons differ."""
    notes = {link.log.note for link in links}
    return notes.pop() if len(notes) == 1 else ""

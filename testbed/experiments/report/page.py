"""A report: one page of HTML with its figures beside it and links to logs, from a template."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from testbed.experiments.report import figures, texts
from testbed.experiments.report.logs import href
from testbed.experiments.run import Outcome
from testbed.experiments.study import Progress
from testbed.files import make_directory, write_atomic

NAME = "report.html"
Step = Callable[[int, int], None]  # done, total


class Failure(NamedTuple):
    """All runs that failed for one reason."""

    reason: str  # the last line of what was reported
    outcomes: list[Outcome]


class Page(NamedTuple):
    """What a study shows of itself: a template with its values, figures, and logs to link."""

    template: str
    values: Mapping[str, Any]  # of the template: title, verdict, caveats, facts, ...
    plots: Iterable[figures.Plot] = ()
    failed: Sequence[Outcome] = ()
    missing: Sequence[Any] = ()  # runs, with names
    links: Callable[[Step | None], Sequence[Any]] = lambda progress: ()  # writes the logs


def write_page(page: Page, folder: Path, progress: Progress | None = None) -> Path:
    """Write FOLDER/report.html with its figures and its logs; returns the path of the page.

    progress: progress(done, total, what) with what is being made: figures, then logs.
    Raises OSError, in one sentence, where the disk is full or must not be written.
    """
    make_directory(folder)
    drawn = figures.draw(page.plots, folder / figures.FOLDER, progress=stage(progress, "figures"))
    path = folder / NAME
    write_atomic(path, render(page, drawn, page.links(stage(progress, "logs")), folder))
    return path


def render(
    page: Page, drawn: Sequence[figures.FigureFile] = (), links: Sequence[Any] = (), folder: Path = Path()
) -> str:
    """The page itself, for a folder in which figures and logs lie."""
    nav: list[tuple[str, str]] = []  # the template adds its sections
    return texts.page(page.template).render(
        **page.values,
        nav=nav,
        figures=[(d, href(d.path, folder)) for d in drawn],
        links=links,
        failures=failures(page.failed),
        missing=page.missing,
    )


def stage(progress: Progress | None, what: str) -> Step | None:
    """The progress of one part."""
    return None if progress is None else lambda done, total: progress(done, total, what)


def failures(outcomes: Iterable[Outcome]) -> list[Failure]:
    """Failed runs by reason, the most frequent first."""
    found: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        found.setdefault(_last_line(outcome.note), []).append(outcome)
    groups = [Failure(reason, group) for reason, group in found.items()]
    return sorted(groups, key=lambda g: -len(g.outcomes))


def _last_line(text: str) -> str:
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "no reason was given")

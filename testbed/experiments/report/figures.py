"""The figures of a report: what is drawn of a comparison, and how figures become files."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from testbed.evaluation.intervals import FEWEST
from testbed.evaluation.metric import COSTS, METRICS
from testbed.experiments.report import figures_runs, figures_time
from testbed.experiments.report.figure_style import RC, line_styles
from testbed.experiments.report.texts import say
from testbed.experiments.series import BANDS, STEP, chosen, over_time, ranked
from testbed.experiments.statistics import MAIN, pairwise
from testbed.experiments.store import Results
from testbed.files import make_directory, write_figure

FOLDER = "figures"
MARGIN = 0.3  # [in] beside a title


class FigureFile(NamedTuple):
    """One figure in its file."""

    name: str
    title: str
    caption: str
    path: Path


class Plot(NamedTuple):
    """One figure to be drawn."""

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def plot(name: str, draw: Callable[[], Figure], text: str | None = None, **values: Any) -> Plot:
    """A figure with the title and the caption of a text of `templates/captions.md`, by default that of its name."""
    key = f"figure {text or name}"
    return Plot(name, say(f"{key} title", **values), say(key, **values), draw)


def draw(
    plots: Iterable[Plot], folder: Path, prefix: str = "", progress: Callable[[int, int], None] | None = None
) -> list[FigureFile]:
    """Write figures into a folder, their names after a prefix; progress(done, total) after each."""
    make_directory(folder)
    if progress:
        progress(0, 1)  # how many there will be is known when the data are read
    asked, done = list(plots), list[FigureFile]()
    with matplotlib.rc_context(dict(RC)):
        for one in asked:
            figure = one.draw()
            figure.suptitle(one.title)
            fit(figure)
            path = write_figure(folder / f"{prefix}{one.name}.png", figure)
            done.append(FigureFile(one.name, one.title, one.caption, path))
            if progress:
                progress(len(done), len(asked))
    return done


def fit(figure: Figure) -> None:
    """Make a figure as wide as its title and its legends."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    parts = [*figure.texts, *figure.legends]
    width = max((part.get_window_extent(renderer).width for part in parts), default=0.0) / figure.dpi + MARGIN
    figure.set_figwidth(max(width, figure.get_figwidth()))


def plots(results: Results, bands: dict[str, pd.DataFrame]) -> Iterator[Plot]:
    """Those of a comparison for which there are data.

    bands: the tables of `series.by_band` for "range" and "visible", which the report shows as well.
    """
    if not results.runs.empty:
        yield from _of_runs(results)
        yield from _over_time(results)
        yield from _by_band(results, bands)


def _of_runs(results: Results) -> Iterator[Plot]:
    order, study = ranked(results), results.study
    styles = line_styles(order)
    counts: dict[str, Any] = {"runs": len(results.runs), "scenarios": len(study.scenarios), "seeds": len(study.seeds)}
    counts["trackers"] = len(order)
    yield plot("distributions", partial(figures_runs.strips, results, MAIN, order, styles), **counts)
    for key in ("gospa", "rmse_position"):
        table, label = pairwise(results, key), METRICS[key].label
        if len(table) > 1 and table.notna().any(axis=None):
            matrix = partial(figures_runs.matrix, table, label, study.baseline)
            yield plot(f"pairwise_{key}", matrix, "pairwise", label=label)
    yield plot("cost", partial(figures_runs.strips, results, COSTS, order, styles), **counts)


def _over_time(results: Results) -> Iterator[Plot]:
    shown = chosen(results)
    series, times = over_time(results, shown)
    data = figures_time.TimeData(results, series, times, line_styles(ranked(results)))
    count, seeds = len(results.study.trackers), len(results.study.seeds)
    left = f" {say('chosen', trackers=count)}" if count > len(shown) else ""
    shared = {"step": f"{STEP:g}", "chosen": left}
    for quantity, metric in (("gospa", METRICS["gospa"]), ("position", METRICS["rmse_position"])):
        errors, band = partial(figures_time.errors, data, quantity, metric.title), seeds >= FEWEST
        yield plot(f"time_{quantity}", errors, "errors", label=metric.label, band=band, seeds=seeds, **shared)
    for quantity, label in (("nees_position", "NEES of the position"), ("nis", "NIS of the centroid")):
        if any(s.quantity == quantity and (s.mean > 0).any() for s in series):
            consistency = partial(figures_time.consistency, data, quantity, f"{label} [1]")
            yield plot(f"time_{quantity}", consistency, "consistency", label=label, **shared)


def _by_band(results: Results, bands: dict[str, pd.DataFrame]) -> Iterator[Plot]:
    styles = line_styles(ranked(results))
    axes = {"range": ("range", "range from the ego"), "visible": ("visibility", "visible share of the outline")}
    for band, (name, label) in axes.items():
        table = bands[band]
        if not table.empty:
            present = [n for n in chosen(results) if n in set(table["tracker"])]
            errors = partial(figures_runs.bands, table, BANDS[band][1], label, present, styles, results.study)
            yield plot(f"error_by_{name}", errors, "bands", label=label, several=len(present) > 1)

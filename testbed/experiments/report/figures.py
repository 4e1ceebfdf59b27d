"""All figures of a comparison, each as PNG and as SVG."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib
import pandas as pd
from matplotlib.figure import Figure

from testbed.evaluation.metric import COSTS, METRICS
from testbed.experiments.bands import BANDS
from testbed.experiments.report import figures_band, figures_runs, figures_time
from testbed.experiments.report.style import RC, line_styles
from testbed.experiments.series import STEP, chosen, over_time, ranked
from testbed.experiments.statistics import MAIN, pairwise
from testbed.experiments.store import Results
from testbed.files import make_directory, write_figure

FOLDER = "figures"
STATIC = {"svg": {"Date": None}, "png": {"Software": None}}  # nothing that differs from one execution to the next


class FigureFiles(NamedTuple):
    """One figure in its two files."""

    name: str
    title: str
    caption: str
    png: Path
    svg: Path


class Plot(NamedTuple):
    """One figure to be drawn."""

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def draw(
    results: Results,
    bands: dict[str, pd.DataFrame],
    out: Path,
    progress: Callable[[int, int], None] | None = None,
) -> list[FigureFiles]:
    """Write all figures into OUT/figures; progress(done, total) after each.

    bands: the tables of `analysis.by_band` for "range" and "visible", which the report shows as well.
    """
    make_directory(out / FOLDER)
    done: list[FigureFiles] = []
    with matplotlib.rc_context(dict(RC)):
        if progress:
            progress(0, 1)  # how many there will be is known when the data are read
        plots = list(_plots(results, bands))
        for plot in plots:
            done.append(_save(plot, out / FOLDER))
            if progress:
                progress(len(done), len(plots))
    return done


def _save(plot: Plot, folder: Path) -> FigureFiles:
    figure = plot.draw()
    figure.suptitle(plot.title)
    paths = {kind: folder / f"{plot.name}.{kind}" for kind in ("png", "svg")}
    for kind, path in paths.items():
        write_figure(path, figure, metadata=STATIC[kind])
        figure.set_layout_engine("none")  # it stays as it is laid out; to lay it out is what takes the time
    return FigureFiles(plot.name, plot.title, plot.caption, paths["png"], paths["svg"])


def _plots(results: Results, bands: dict[str, pd.DataFrame]) -> Iterator[Plot]:
    """Only those for which there are data."""
    if not results.runs.empty:
        yield from _of_runs(results)
        yield from _over_time(results)
        yield from _by_band(results, bands)


def _of_runs(results: Results) -> Iterator[Plot]:
    order = ranked(results)
    styles = line_styles(order)
    comparison = results.study
    yield Plot(
        "distributions",
        f"Main measures over the runs: {len(comparison.scenarios)} scenarios, {len(comparison.seeds)} seeds",
        "Every run is a dot. Trackers stand in the order of their mean GOSPA below the reference. "
        "The spread holds that between scenarios; differences are resolved in the tables, on the same seeds.",
        lambda: figures_runs.strips(results, MAIN, order, styles),
    )
    for key in ("gospa", "rmse_position"):
        table = pairwise(results, key)
        if table.notna().any(axis=None):
            label = METRICS[key].label
            yield Plot(
                f"pairwise_{key}",
                f"Which tracker is better in {label}, run by run",
                f"Probability that the tracker of the row has the smaller {label} than that of the column in a run "
                "with the same scenario and seed; 0.50 means that neither is better.",
                lambda table=table, label=label: figures_runs.matrix(table, label, comparison.baseline),  # type: ignore[misc]
            )
    yield Plot(
        "cost",
        "Cost of the trackers over the runs (wall time)",
        "Wall time of a scan with all its tracks, and of the update of one track, on the machines that made the runs.",
        lambda: figures_runs.strips(results, COSTS, order, styles),
    )


def _over_time(results: Results) -> Iterator[Plot]:
    shown = chosen(results)
    series, times = over_time(results, shown)
    data = figures_time.TimeData(results, series, times, line_styles(ranked(results)))
    left = len(results.study.trackers) - len(shown)
    chosen_of = f" Of {left + len(shown)} trackers: the reference and those best in GOSPA." if left else ""
    for quantity, label in (("gospa", "GOSPA [m]"), ("position", "position RMSE [m]")):
        yield Plot(
            f"time_{quantity}",
            f"{label.rpartition(' ')[0]} over time: mean over seeds, 95 % band",
            f"Frames within {STEP:g} s are averaged. The band is the 95 % interval of the mean over seeds "
            f"(Student's t). Phases are shaded at their medians over the runs.{chosen_of}",
            lambda quantity=quantity, label=label: figures_time.errors(data, quantity, label),  # type: ignore[misc]
        )
    for quantity, label in (("nees_position", "NEES of the position [1]"), ("nis", "NIS of the centroid [1]")):
        if not any(s.quantity == quantity and (s.mean > 0).any() for s in series):
            continue
        yield Plot(
            f"time_{quantity}",
            f"{label.removesuffix(' [1]')} over time against its 95 % limits",
            f"Mean over runs and objects, frames within {STEP:g} s averaged; green: where the mean of one frame over "
            "as many independent errors lies with 95 %, line at the ideal 2. Above: the covariances are too small; "
            f"below: too large.{chosen_of}",
            lambda quantity=quantity, label=label: figures_time.consistency(data, quantity, label),  # type: ignore[misc]
        )


def _by_band(results: Results, bands: dict[str, pd.DataFrame]) -> Iterator[Plot]:
    shown = chosen(results)
    styles = line_styles(ranked(results))
    baseline = results.study.baseline
    axes = {"range": ("range", "range from the ego"), "visible": ("visibility", "visible share of the outline")}
    for band, (name, label) in axes.items():
        table = bands[band]
        if not table.empty:
            present = [n for n in shown if n in set(table["tracker"])]
            yield Plot(
                f"error_by_{name}",
                f"Errors against {label}",
                "Objects that count, with 95 % intervals over runs (bars); errors are those of objects with a track. "
                "Trackers stand side by side within a band.",
                lambda table=table, band=band, label=label, present=present: figures_band.bands(  # type: ignore[misc]
                    table, BANDS[band][1], label, present, styles, baseline
                ),
            )

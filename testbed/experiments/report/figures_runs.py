"""Figures of runs: distributions, cost, which tracker is better how often, errors by range and visible share."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.evaluation.metric import METRICS
from testbed.experiments.report.figure_style import DIVERGING, OTHERS, SIZE, LineStyle, label, panels, plain_log
from testbed.experiments.series import BAND_MEASURES
from testbed.experiments.store import Results

LOGARITHMIC = ("nees_position", "nees_velocity", "ms_per_scan", "us_per_update")
SPREAD = 0.32  # half the height of the strip of a tracker
DODGE = 0.56  # share of a band over which the trackers stand side by side
SEED = 20261121  # of the places of the dots


def strips(results: Results, measures: Sequence[str], order: Sequence[str], styles: dict[str, LineStyle]) -> Figure:
    """Every run a dot; bar: the middle half, thin line: 5 to 95 %, white tick: median, black tick: mean."""
    size = 4.2 if len(measures) < 3 else 2.9, 0.27 * len(order) + 0.9
    figure, axes = panels(len(measures), size, (2.0, 0.7), sharey=True)
    for axis, key in zip(axes, measures, strict=True):
        _panel(axis, results.runs, key, order, styles)
    labels = [label(n, results.study) for n in order]
    for axis in axes[::4]:  # the first of each row
        axis.set_yticks(range(len(order)), labels)
        axis.set_ylim(len(order) - 0.4, -0.6)
        for tick, name in zip(axis.get_yticklabels(), order, strict=True):
            tick.set_fontweight("bold" if label(name, results.study) != name else "normal")
    figure.legend(handles=_key(), loc="outside lower center", ncols=4)
    return figure


def _panel(axis: Axes, runs: pd.DataFrame, key: str, order: Sequence[str], styles: dict[str, LineStyle]) -> None:
    measure = METRICS[key]
    rng = np.random.default_rng(SEED)
    for y, name in enumerate(order):
        found = runs.loc[runs["tracker"] == name, key].to_numpy(float) if key in runs else np.zeros(0)
        found = found[np.isfinite(found) & ((found > 0) | (key not in LOGARITHMIC))]
        if not len(found):
            axis.text(0.02, y, "nothing measured", transform=axis.get_yaxis_transform(), va="center", color="0.45")
            continue
        low, first, median, third, high = np.quantile(found, (0.05, 0.25, 0.5, 0.75, 0.95))
        places = y + SPREAD * rng.uniform(-1, 1, len(found))
        colour = styles[name].color
        axis.plot(found, places, ".", color=colour, alpha=0.45, markersize=3.5, markeredgewidth=0, rasterized=True)
        axis.hlines(y, low, high, color=colour, linewidth=1.2)
        axis.hlines(y, first, third, color=colour, linewidth=6.5, alpha=0.85)
        axis.plot(median, y, "|", color="white", markersize=6.5, markeredgewidth=1.6)
        axis.plot(found.mean(), y, "|", color="black", markersize=13, markeredgewidth=1.1)
    if key in LOGARITHMIC:
        axis.set_xscale("log")
        plain_log(axis.xaxis)
    else:
        axis.set_xlim(left=0)
    if measure.ideal is not None:
        axis.axvline(measure.ideal, color="0.35", linestyle=":", linewidth=1.0)
    aim = "smaller is better" if measure.ideal is None else f"{measure.ideal:g} is ideal, dotted"
    axis.set_title(measure.title)
    axis.set_xlabel(aim, color="0.35")
    axis.grid(axis="y", visible=False)


def _key() -> list[Line2D]:
    return [
        Line2D([], [], marker=".", linestyle="", color="0.45", label="a run"),
        Line2D([], [], color="0.45", linewidth=6.5, label="middle half, white tick: median"),
        Line2D([], [], color="0.45", linewidth=1.2, label="5 to 95 %"),
        Line2D([], [], marker="|", linestyle="", color="black", markersize=11, label="mean"),
    ]


def matrix(table: pd.DataFrame, label: str, baseline: str) -> Figure:
    """Probability that the tracker of the row is better in a run than that of the column, best rows on top."""
    order = table.mean(axis=1).sort_values(ascending=False, kind="stable").index
    values = table.loc[order, order].to_numpy(float)
    side = 0.52 * len(order)
    figure = Figure(figsize=(max(side + 3.2, 5.5), max(side + 2.2, 3.6)), layout="constrained")
    axis = figure.subplots()
    image = axis.imshow(values, cmap=DIVERGING + "_r", vmin=0, vmax=1, aspect="equal")
    for (i, j), value in np.ndenumerate(values):
        if i != j:
            shown = f"{value:.2f}" if np.isfinite(value) else "–"
            dark = np.isfinite(value) and abs(value - 0.5) > 0.33
            axis.text(j, i, shown, ha="center", va="center", color="white" if dark else "black", fontsize=SIZE - 1)
    axis.set_xticks(range(len(order)), order, rotation=45, ha="left")
    axis.set_yticks(range(len(order)), order)
    axis.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
    for ticks in (axis.get_xticklabels(), axis.get_yticklabels()):
        for tick in ticks:
            tick.set_fontweight("bold" if tick.get_text() == baseline else "normal")
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    axis.set_ylabel("this tracker ...")
    axis.set_xlabel(f"... is better in {label} than this one (bold: the reference)")
    figure.colorbar(image, ax=axis, label="probability of being better in a run", shrink=0.8)
    return figure


def bands(
    table: pd.DataFrame,
    labels: Sequence[str],
    xlabel: str,
    shown: Sequence[str],
    styles: dict[str, LineStyle],
    study: Any,
) -> Figure:
    """Errors by band with 95 % intervals; trackers that are not in `shown` are grey lines behind."""
    figure, axes = panels(len(BAND_MEASURES), (6.0, 3.8), columns=2)
    used = [label for label in labels if label in set(table["band"])]
    for axis, (key, title, scale, _) in zip(axes, BAND_MEASURES, strict=True):
        for name in dict.fromkeys(table["tracker"]):
            if name not in shown:
                _draw_band(axis, table[table["tracker"] == name], key, scale, used, 0.0, None)
        for k, name in enumerate(shown):
            shift = DODGE * ((k + 0.5) / len(shown) - 0.5)
            _draw_band(axis, table[table["tracker"] == name], key, scale, used, shift, styles[name])
        axis.set_xticks(range(len(used)), used)
        axis.set(xlim=(-0.5, len(used) - 0.5), xlabel=xlabel, ylabel=title)
        axis.set_title(title.rpartition(" [")[0])
        axis.set_ylim(0, 103 if key == "held" else None)
        axis.grid(axis="x", visible=False)
    handles = [Line2D([], [], label=label(n, study), marker=styles[n].marker, **styles[n].line) for n in shown]
    if set(table["tracker"]) - set(shown):
        handles.append(Line2D([], [], color=OTHERS, linewidth=0.9, label="other trackers"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 4))
    return figure


def _draw_band(
    axis: Axes, part: pd.DataFrame, key: str, scale: float, used: Sequence[str], shift: float, style: LineStyle | None
) -> None:
    part = part.set_index("band").reindex(used)
    value, low, high = (scale * part[c].to_numpy(float) for c in (key, f"{key}_low", f"{key}_high"))
    x = np.arange(len(used)) + shift
    if style is None:
        axis.plot(x, value, color=OTHERS, linewidth=0.9, zorder=1)
        return
    axis.plot(x, value, marker=style.marker, zorder=3, **(style.line | {"linewidth": 1.0}))
    axis.vlines(x, low, high, color=style.color, linewidth=1.3, zorder=2)

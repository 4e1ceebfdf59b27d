"""Figures of errors by range and by the visible share of an object."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.experiments.bands import BAND_MEASURES
from testbed.experiments.report.figure_style import OTHERS, LineStyle, label

DODGE = 0.56  # share of a band over which the trackers stand side by side


def bands(
    table: pd.DataFrame,
    labels: Sequence[str],
    xlabel: str,
    shown: Sequence[str],
    styles: dict[str, LineStyle],
    study: Any,
) -> Figure:
    """Errors by band with 95 % intervals; trackers that are not in `shown` are grey lines behind."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    used = [label for label in labels if label in set(table["band"])]
    for axis, (key, title, scale, _) in zip(figure.subplots(2, 2).ravel(), BAND_MEASURES, strict=True):
        for name in dict.fromkeys(table["tracker"]):
            if name not in shown:
                _draw(axis, table[table["tracker"] == name], key, scale, used, 0.0, None)
        for k, name in enumerate(shown):
            shift = DODGE * ((k + 0.5) / len(shown) - 0.5)
            _draw(axis, table[table["tracker"] == name], key, scale, used, shift, styles[name])
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


def _draw(
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

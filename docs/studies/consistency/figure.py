"""Figure: mean NEES of each quantity by group, with intervals, against the range that it should keep."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from studies.consistency.tables import QUANTITIES, Judged
from testbed.files import write_figure

GOOD, BAD = "#0072B2", "#D55E00"  # after Okabe and Ito


def draw(groups: Mapping[str, Mapping[str, Mapping[str, Judged]]], path: Path) -> Path:
    """Write the figure as PNG and return where; groups: of what -> label -> quantity -> its consistency."""
    labels = [(group, label) for group, rows in groups.items() for label in rows]
    figure = Figure(figsize=(13, 0.24 * len(labels) + 1.2), layout="constrained")
    axes = figure.subplots(1, len(QUANTITIES), sharey=True)
    place = np.arange(len(labels))[::-1]
    for axis, quantity in zip(axes, QUANTITIES, strict=True):
        axis.axvspan(quantity.low, quantity.high, color="0.9")
        axis.axvline(quantity.dof, color="0.5", linewidth=0.8)
        for y, (group, label) in zip(place, labels, strict=True):
            found = groups[group][label][quantity.name]
            colour = GOOD if found.good(quantity) else BAD
            axis.plot([found.mean.low, found.mean.high], [y, y], color=colour, linewidth=1.2)
            axis.plot(found.mean.value, y, "o", color=colour, markersize=4)
        axis.set(xscale="log", xlabel=f"NEES of {quantity.name}")
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.grid(alpha=0.3, axis="x")
    axes[0].set_yticks(place, [label for _, label in labels], fontsize=8)
    return write_figure(path, figure, dpi=90)

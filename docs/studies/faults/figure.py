"""Figure: change of GOSPA by fault and tracker, with intervals."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from testbed.evaluation.intervals import Interval
from testbed.files import write_figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")  # after Okabe and Ito


def draw(changes: Mapping[str, Mapping[str, Interval]], path: Path) -> Path:
    """Write the figure as PNG and return where; changes: fault -> tracker -> change of GOSPA [m]."""
    faults, trackers = list(changes), list(next(iter(changes.values())))
    figure = Figure(figsize=(8, 0.5 * len(faults) + 1.4), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(faults))[::-1]
    for k, tracker in enumerate(trackers):
        y = place + 0.3 - 0.6 * k / max(len(trackers) - 1, 1)
        found = [changes[fault][tracker] for fault in faults]
        colour = COLOURS[k % len(COLOURS)]
        axes.hlines(y, [i.low for i in found], [i.high for i in found], color=colour, linewidth=1.5)
        axes.plot([i.value for i in found], y, "o", color=colour, markersize=4, label=tracker)
    axes.axvline(0, color="0.5", linewidth=0.8)
    axes.set_yticks(place, faults, fontsize=9)
    axes.set_xlabel("change of GOSPA against no fault [m]")
    axes.grid(alpha=0.3, axis="x")
    axes.legend(fontsize=8)
    return write_figure(path, figure, dpi=90)

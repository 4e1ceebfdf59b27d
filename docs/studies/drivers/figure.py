"""Figure: how recorded drivers and those of populations drive, cumulative distributions."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from studies.drivers.motions import QUANTITIES, Motion, values
from testbed.files import write_figure

LABELS = ("time gap [s]", "speed [m/s]", "acceleration [m/s²]", "jerk [m/s³]")
LIMITS = ((0, 10), (0, 20), (-4, 4), (-6, 6))


def draw(groups: dict[str, list[Motion]], path: Path) -> Path:
    """Cumulative distributions, a line for each group."""
    figure = Figure(figsize=(13, 3.4), layout="constrained")
    axes = figure.subplots(1, 4)
    for axis, quantity, label, limits in zip(axes, QUANTITIES, LABELS, LIMITS, strict=True):
        for (name, found), colour in zip(groups.items(), ("#000000", "#999999", "#D55E00", "#0072B2"), strict=True):
            level = np.linspace(0, 100, 201)
            axis.plot(np.percentile(values(found, quantity), level), level, color=colour, label=name)
        axis.set(xlabel=label, xlim=limits, ylim=(0, 100))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share below [%]")
    axes[0].legend(fontsize=8)
    return write_figure(path, figure, dpi=90)

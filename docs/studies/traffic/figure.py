"""Figure: cumulative distributions of lengths, speeds, gaps and time gaps, a line for each source."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.traffic.distributions import CURVE, Distribution
from testbed.files import write_figure

COLOURS = {"I-80": "#D55E00", "US-101": "#E69F00", "catalogue": "#0072B2", "highway-v0": "#999999"}  # Okabe and Ito
JAM = "stop-and-go"
PANELS = (  # quantity, label, by, group
    ("length", "length of cars and vans [m]", "class", "car or van"),
    ("width", "width of cars and vans [m]", "class", "car or van"),
    ("speed", "speed [m/s]", "all", "all"),
    ("gap", "gap ahead [m]", "all", "all"),
    ("time_gap", "time gap [s]", "all", "all"),
)
LONGEST = {"time_gap": 6.0}  # where an axis ends


def draw(found: Sequence[Distribution], path: Path) -> Path:
    """Write the figure as PNG and return where."""
    figure = Figure(figsize=(13, 6.4), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    for axis, (quantity, label, by, group) in zip(axes, PANELS, strict=False):
        for one in found:
            if one.quantity == quantity and one.curve:
                if (one.by, one.group) == (by, group):
                    axis.plot(one.curve, CURVE, color=COLOURS[one.source], label=one.source)
                elif (one.by, one.group) == ("scenario", JAM):
                    axis.plot(one.curve, CURVE, color=COLOURS[one.source], linestyle="--", label=JAM)
        _finish(axis, label)
        axis.set_xlim(left=None if quantity in ("length", "width") else 0, right=LONGEST.get(quantity))
    axes[5].legend(*axes[2].get_legend_handles_labels(), loc="center", frameon=False)
    axes[5].axis("off")
    return write_figure(path, figure, dpi=90)


def _finish(axis: Axes, label: str) -> None:
    axis.set(xlabel=label, ylabel="share below [%]", ylim=(0, 100))
    axis.grid(alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)

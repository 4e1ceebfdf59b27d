"""Figure: cost of a frame against the number of vehicles."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from testbed.files import write_figure
from testbed.speed.shares import Costs

LINES = {"simulation": "#000000", "radar": "#0072B2", "tracker": "#D55E00"}  # after Okabe and Ito


def draw(costs: Sequence[Costs], path: Path) -> Path:
    """Write the figure as PNG and return where."""
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, colour in LINES.items():
        axes.plot([c.vehicles for c in costs], [getattr(c, name) for c in costs], "o-", color=colour, label=name)
    axes.set(xscale="log", yscale="log", xlabel="vehicles", ylabel="ms a frame")
    axes.set_xticks([c.vehicles for c in costs], [str(c.vehicles) for c in costs])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend(title="highway-v0")
    return write_figure(path, figure, dpi=100)

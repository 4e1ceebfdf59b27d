"""Figure: cost of a frame against the numbers of vehicles, tracks and detections."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from studies.speed.growth import Growth
from studies.speed.shares import Costs
from testbed.files import write_figure

LINES = {"simulation": "#000000", "radar": "#0072B2", "tracker": "#D55E00"}  # after Okabe and Ito


def draw(costs: Sequence[Costs], tracks: Sequence[Growth], detections: Sequence[Growth], path: Path) -> Path:
    """Write the figure as PNG and return where."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    by_vehicles, by_tracks, by_detections = figure.subplots(1, 3, sharey=True)
    for name, colour in LINES.items():
        values = [getattr(c, name) for c in costs]
        by_vehicles.plot([c.vehicles for c in costs], values, "o-", color=colour, label=name)
    by_vehicles.set(xlabel="vehicles of highway-v0", ylabel="ms a frame")
    by_vehicles.legend()
    for axes, found, place, label in (
        (by_tracks, tracks, "objects", "tracks, 6 detections each"),
        (by_detections, detections, "each", "detections of each of 20 tracks"),
    ):
        milliseconds = [1e3 * g.seconds for g in found]
        axes.plot([getattr(g, place) for g in found], milliseconds, "o-", color=LINES["tracker"])
        axes.set(xlabel=label)
    for axes in (by_vehicles, by_tracks, by_detections):
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(ScalarFormatter())
            axis.set_minor_formatter(NullFormatter())
        ticks = sorted({float(x) for line in axes.lines for x in line.get_xdata()})
        axes.set_xticks(ticks)
        axes.grid(alpha=0.3)
    return write_figure(path, figure, dpi=100)

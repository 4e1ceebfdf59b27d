"""Figure: where what stands is detected and what ego motion leaves of its range rates, real and simulated."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.standing.statistics import RANGES, Judged, columns
from testbed.files import write_figure

COLOURS = ("#000000", "#D55E00", "#0072B2")  # after Okabe and Ito
SCANS = 12  # drawn over each other


def draw(groups: Mapping[str, Sequence[Judged]], path: Path) -> Path:
    """Write the figure as PNG and return where; groups: scans by label, at most three."""
    figure = Figure(figsize=(13, 8.6), layout="constrained")
    top, bottom = figure.subplots(2, 3, height_ratios=(1.25, 1))
    for axes, (label, judged) in zip(top, groups.items(), strict=False):
        _places(axes, judged[:: max(len(judged) // SCANS, 1)][:SCANS], label)
    found = {label: columns(judged) for label, judged in groups.items()}
    middle = np.add(RANGES[:-1], RANGES[1:]) / 2
    for colour, (label, c) in zip(COLOURS, found.items(), strict=False):
        n = len(groups[label])
        bottom[0].plot(middle, np.histogram(c["range"], RANGES)[0] / n, "o-", color=colour, label=label)
        edges = np.arange(-60, 61, 10)
        counts = np.histogram(np.degrees(c["azimuth"]), edges)[0] / n
        bottom[1].stairs(counts, edges, color=colour, label=label, linewidth=1.6)
        rest = np.sort(np.abs(c["rest"]))
        bottom[2].plot(rest, 1 - np.arange(len(rest)) / len(rest), color=colour, label=label)
    bottom[0].set(xlabel="range [m]", ylabel="standing detections a scan in 10 m")
    bottom[1].set(xlabel="azimuth [deg], right positive", ylabel="standing detections a scan in 10 deg")
    bottom[2].set(xlabel="|range rate - that of ego motion| [m/s]", ylabel="share beyond", yscale="log", ylim=(3e-3, 1))
    for axes in bottom:
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return write_figure(path, figure, dpi=90)


def _places(axes: Axes, judged: Sequence[Judged], label: str) -> None:
    """Some scans over each other in the frame of the radar: standing blue, all else orange."""
    for one in judged:
        for chosen, colour in ((one.still, COLOURS[2]), (~one.still, COLOURS[1])):
            xy = one.scan.xy[chosen]
            axes.plot(-xy[:, 1], xy[:, 0], ".", color=colour, markersize=2, alpha=0.5)
    axes.set(aspect="equal", xlim=(-45, 45), ylim=(0, 85), xlabel="left [m]", ylabel="ahead [m]")
    axes.xaxis.set_inverted(True)
    axes.set_title(f"{label}, {len(judged)} scans", fontsize=10, loc="left")
    axes.grid(alpha=0.3)

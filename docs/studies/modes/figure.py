"""Figure: probabilities of motion models over time against what the vehicle does; a column a scenario, a row a seed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from testbed.files import write_figure

COLOURS = {"cv": "0.45", "ca": "#D55E00", "ct": "#0072B2"}  # after Okabe and Ito
TRUE = ("cv", "ca", "ct")  # what a number in ModePanel.true means


class ModePanel(NamedTuple):
    """One vehicle in n frames."""

    time: NDArray  # (n,) [s]
    true: NDArray  # (n,) of TRUE
    probability: NDArray  # (n, K), NaN without a track


def draw(runs: Mapping[str, Sequence[ModePanel]], names: Sequence[str], path: Path) -> Path:
    """Write the figure as PNG and return where; names (K,) are those of the models."""
    rows = max(map(len, runs.values()))
    figure = Figure(figsize=(3.6 * len(runs) + 0.6, 1.25 * rows + 0.9), layout="constrained")
    axes = figure.subplots(rows, len(runs), squeeze=False, sharex="col", sharey=True)
    for column, (scenario, panels) in zip(axes.T, runs.items(), strict=True):
        column[0].set_title(scenario)
        column[-1].set_xlabel("time [s]")
        for axis, panel in zip(column, panels, strict=False):
            _fill(axis, panel, names)
    for seed, axis in enumerate(axes[:, 0]):
        axis.set_ylabel(f"seed {seed}")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(names), fontsize=9)
    return write_figure(path, figure, dpi=90)


def _fill(axis: Axes, panel: ModePanel, names: Sequence[str]) -> None:
    for k, mode in enumerate(TRUE[1:], 1):
        there = panel.true == k
        axis.fill_between(panel.time, 0, 1, where=there, step="post", color=COLOURS[mode], alpha=0.18, linewidth=0)
    for name, p in zip(names, panel.probability.T, strict=True):
        axis.plot(panel.time, p, color=COLOURS[name], label=f"probability of {name}", linewidth=1.2)
    axis.set(ylim=(-0.03, 1.03), xlim=(panel.time[0], panel.time[-1]), yticks=np.array([0.0, 0.5, 1.0]))
    axis.grid(alpha=0.3)

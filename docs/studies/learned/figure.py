"""Figure: performance profiles of the trainings of each kind, on everything they drive on."""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.effects import names
from studies.learned.trainings import profile, scores
from testbed.evaluation.intervals import bootstrap_interval
from testbed.experiments.report.figure_style import line_styles
from testbed.files import write_figure

PLACES = 61  # returns at which the share is drawn


def draw(table: pd.DataFrame, path: Path) -> Path:
    """Write the figure as PNG and return where; the drives are those of `studies.learned.drives.drives`."""
    kinds, sources = names(table, "tracker"), names(table, "driven")
    of = {(kind, on): scores(table, kind, on) for kind in kinds for on in sources}
    every = np.concatenate(list(of.values()))
    above = np.linspace(np.floor(every.min()) - 1, np.ceil(every.max()) + 1, PLACES)
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    for axes, on in zip(figure.subplots(1, len(sources), sharey=True, squeeze=False)[0], sources, strict=True):
        for row, (kind, style) in enumerate(line_styles(kinds).items()):
            found = of[kind, on]
            share = [bootstrap_interval([found], partial(profile, above=x)) for x in above]
            axes.step(above, [s.value for s in share], where="mid", **style.line, label=f"trained on {kind}")
            low, high = [s.low for s in share], [s.high for s in share]
            axes.fill_between(above, low, high, step="mid", color=style.color, alpha=0.15, linewidth=0)
            axes.plot(found, np.full(len(found), -0.05 - 0.05 * row), style.marker, color=style.color, markersize=4)
        axes.set(xlabel=f"return on {on}, mean of a training's episodes")
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("share of trainings above")
    figure.axes[0].legend(fontsize=8, loc="lower left", bbox_to_anchor=(0, 0.12))
    return write_figure(path, figure, dpi=90)

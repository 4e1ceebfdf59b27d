"""Figures of the partial view: contours learned from some sides, and what weights by visibility change in tracking."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from testbed.files import write_figure
from trackers.geometry import ellipse_points
from trackers.pmht.model import SplineModel, outlines

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#E69F00", "0.45", "#CC79A7", "#56B4E9")  # after Okabe and Ito
LEAST_SHOWN = 0.05  # of the mean ellipse's detections, below which an ellipse is drawn as unseen


class ContourPanel(NamedTuple):
    """A contour, and what it was learned from."""

    model: SplineModel
    z: NDArray  # (N, 2) detections in the unit frame
    counts: NDArray  # (L,) detections of each ellipse
    title: str


def draw_learned(panels: Sequence[Sequence[ContourPanel]], body: NDArray, path: Path) -> Path:
    """Write a grid of panels over the true outline body (C, 2), in the unit frame, as PNG; returns where."""
    figure = Figure(figsize=(3.6 * len(panels[0]), 2.2 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), len(panels[0]), squeeze=False, sharex=True, sharey=True)
    for row, line in zip(axes, panels, strict=True):
        for axis, panel in zip(row, line, strict=True):
            _contour(axis, panel, body)
    for axis in axes[-1]:
        axis.set_xlabel("along [m]")
    for axis in axes[:, 0]:
        axis.set_ylabel("across [m]")
    return write_figure(path, figure, dpi=90)


def _contour(axis: Axes, panel: ContourPanel, body: NDArray) -> None:
    model, size = panel.model, np.array(panel.model.size)
    axis.plot(*(panel.z[:800] * size).T, ".", color="0.75", markersize=1, zorder=0)
    seen = panel.counts > LEAST_SHOWN * panel.counts.mean()
    rings = ellipse_points(model.mu * size, 4 * model.Sigma * size[:, None] * size)
    for ring, real in zip(rings, seen, strict=True):
        axis.plot(*ring.T, color=COLOURS[0] if real else COLOURS[1], linewidth=0.6)
    axis.plot(*_closed(body * size).T, "k-", linewidth=1.0)
    axis.plot(*_closed(outlines(model.p, model.Sigma, 1.0) * size).T, color="#009E73", linewidth=1.8)
    axis.set(aspect="equal", xlim=(-3.4, 3.4), ylim=(-1.9, 1.9))
    axis.set_title(panel.title, fontsize=9)


def _closed(ring: NDArray) -> NDArray:
    return np.concatenate([ring, ring[:1]])


def draw_tracked(
    found: Mapping[str, Mapping[str, Mapping[str, tuple[float, float]]]], measures: Mapping[str, str], path: Path
) -> Path:
    """Write means with intervals as PNG; found[variant][measure][view] is a value and half its interval."""
    figure = Figure(figsize=(3.2 * len(measures), 3.4), layout="constrained")
    axes = figure.subplots(1, len(measures), squeeze=False)[0]
    for axis, (measure, label) in zip(axes, measures.items(), strict=True):
        for v, (variant, rows) in enumerate(found.items()):
            points = np.array(list(rows[measure].values()))
            at = np.arange(len(points)) + 0.15 * (v - (len(found) - 1) / 2)
            axis.errorbar(
                at, points[:, 0], points[:, 1], fmt="o", color=COLOURS[v], label=variant, markersize=4, capsize=2
            )
            names = list(rows[measure])
        axis.set_xticks(range(len(names)), names, rotation=35, ha="right", fontsize=8)
        axis.set_title(label, fontsize=10)
        axis.grid(alpha=0.3, axis="y")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(found), fontsize=9)
    return write_figure(path, figure, dpi=90)

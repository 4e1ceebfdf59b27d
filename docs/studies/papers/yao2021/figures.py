"""Figures of yao2021: contours before and after the adaptation (Fig. 5), errors of motion (7) and of extent (8)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.papers.yao2021.simulation import ADAPT_AT, CONTOURS, EARLY, SIZE, STEPS, AdaptationRuns, StageErrors
from testbed.files import write_figure
from trackers.geometry import ellipse_points
from trackers.pmht.model import SplineModel, curve, find

AllRuns = Mapping[tuple[str, str], AdaptationRuns]
STYLES = {"before": "r-", "smoothed": "b--", "not adapted": "r-", "adapted": "g:"}
LABELS = {"before": "filter, without adaptation", "smoothed": "smoother", "adapted": "filter, adapted"}
MOTION = {"position": "position [m]", "speed": "speed [m/s]", "heading": "heading [rad]"}
EXTENT = {"length": "length [m]", "width": "width [m]"}
DRAWN = ("A", "B")


def draw(found: AllRuns, out: Path) -> tuple[Path, ...]:
    """Draw all figures into the folder `out`."""
    return contours(found, out), series(found, MOTION, out, "motion"), series(found, EXTENT, out, "extent")


def contours(found: AllRuns, out: Path) -> Path:
    """Over each contour, the offline model and the adapted ones of the first run with their detections."""
    figure = Figure(figsize=(3.4 * (1 + len(DRAWN)), 2.1 * len(CONTOURS)), layout="constrained")
    axes = figure.subplots(len(CONTOURS), 1 + len(DRAWN), sharex=True, sharey=True)
    for row, (name, outline) in zip(axes, CONTOURS.items(), strict=True):
        offline(row[0], find("yao2021"))
        row[0].set(title=f"{name}: learned offline", ylabel="across [m]")
        for ax, method in zip(row[1:], DRAWN, strict=True):
            adapted(ax, found[name, method])
            ax.set_title(f"{name}: adapted, {method}")
        for ax in row:
            ax.plot(*np.concatenate([outline, outline[:1]]).T, "k-", linewidth=1)
            ax.set_aspect("equal")
    for ax in axes[-1]:
        ax.set_xlabel("along [m]")
    return write_figure(out / "yao2021_contours.png", figure, dpi=120)


def offline(ax: Axes, model: SplineModel) -> None:
    """The model learned offline: its ellipses, two standard deviations, on their curve."""
    ellipses(ax, model.mu, model.Sigma)
    ring(ax, model.p, "r-")


def adapted(ax: Axes, runs: AdaptationRuns) -> None:
    """The first run: its decoupled detections, and the curve that was learned from them."""
    a = runs.adapted
    z = a.z[0][a.mask[0]] * SIZE
    ax.plot(*z.T, "b.", markersize=1)
    ring(ax, a.contour.p[0], "r-")


def ring(ax: Axes, p: NDArray, style: str) -> None:
    """The closed curve of control points p (n_c, 2)."""
    c = curve(p, 200) * SIZE
    ax.plot(*np.concatenate([c, c[:1]]).T, style, linewidth=1.5)


def ellipses(ax: Axes, mu: NDArray, Sigma: NDArray) -> None:
    """Two standard deviations of each."""
    for outline in ellipse_points(mu * SIZE, 4 * Sigma * SIZE[:, None] * SIZE):
        ax.plot(*outline.T, color="0.6", linewidth=0.6)


def series(found: AllRuns, quantities: Mapping[str, str], out: Path, name: str) -> Path:
    """RMSE over time: a row for each contour and method, a column for each quantity."""
    panels = [(contour, method) for contour in CONTOURS for method in DRAWN]
    figure = Figure(figsize=(4 * len(quantities), 2.2 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), len(quantities), sharex=True, squeeze=False)
    for row, key in zip(axes, panels, strict=True):
        for ax, (quantity, label) in zip(row, quantities.items(), strict=True):
            for stage, e in found[key].stages.items():
                k = np.arange(ADAPT_AT) if stage in EARLY else np.arange(ADAPT_AT, STEPS)
                ax.plot(k + 1, rmse(e, quantity, found[key].kept), STYLES[stage], label=LABELS.get(stage))
            ax.axvline(ADAPT_AT, color="0.8", linewidth=0.8)
            ax.set(ylabel=label, title=", ".join(key) if quantity == next(iter(quantities)) else "")
    axes[0, 0].legend(fontsize="x-small")
    for ax in axes[-1]:
        ax.set_xlabel("scan")
    return write_figure(out / f"yao2021_{name}.png", figure, dpi=120)


def rmse(e: StageErrors, quantity: str, kept: NDArray) -> NDArray:
    """RMSE (K,) over the runs that were kept."""
    value = getattr(e, quantity)[:, kept]
    squared = (value**2).sum(-1) if quantity == "position" else value**2
    return np.sqrt(squared.mean(1))

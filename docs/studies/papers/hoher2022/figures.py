"""Figures of hoher2022: errors over time, and estimates over the detections that they came from."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.papers.hoher2022.runs import SETTLED, ContourErrors, ContourTrack
from studies.papers.hoher2022.uturn import DT, Truth
from testbed.files import write_figure
from trackers import Scan
from trackers.random_matrix.rays import box_outline, outline, root_of

METHODS = (
    ("RM corrected, 1 sigma", "tab:gray"),
    ("P I=2", "tab:orange"),
    ("B I=2", "tab:green"),
    ("C33 I=2", "tab:blue"),
    ("G I=1", "tab:purple"),
    ("direct I=2", "tab:red"),
    ("box, Bayes (ours)", "tab:brown"),
)
TIMES = ("rectangle, sigma 0.1", "rectangle, sigma 0.5", "ellipse, sigma 0.1", "ellipse, sigma 0.5")
EVERY = 25  # steps between two snapshots
RADAR = "our radar imaging, rectangle"


def draw(
    errors: Mapping[tuple[str, str], ContourErrors],
    tracks: Mapping[tuple[str, str], ContourTrack],
    scans: Mapping[str, tuple[Truth, list[Scan]]],
    out: Path,
) -> tuple[Path, ...]:
    """Write the figures as PNG into the folder `out` and return their paths."""
    paths = [over_time(errors, name, label, out / f"hoher2022_{stem}.png") for name, label, stem in (
        ("gwd", "mean GW distance [m]", "gwd"), ("centre", "centre RMSE [m]", "centre"))]  # fmt: skip
    for case, stem in (("rectangle, sigma 0.1", "rectangle"), ("ellipse, sigma 0.1", "ellipse"),
                       ("tractor, sigma 0.1", "tractor"), ("L, sigma 0.1", "l"), (RADAR, "radar")):  # fmt: skip
        if case in scans:
            paths.append(snapshots(tracks, *scans[case], case, out / f"hoher2022_{stem}.png"))
    return tuple(paths)


def over_time(errors: Mapping[tuple[str, str], ContourErrors], name: str, label: str, path: Path) -> Path:
    """One error of the main methods over time, a panel for each case."""
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for axis, case in zip(panels.flat, TIMES, strict=True):
        for method, colour in METHODS:
            if (case, method) in errors:
                e = getattr(errors[case, method], name)
                curve = np.sqrt((e**2).mean(0)) if name == "centre" else e.mean(0)
                axis.plot(np.arange(len(curve)) * DT, curve, color=colour, label=method)
        axis.axvline(SETTLED * DT, color="black", linewidth=0.8, linestyle=":")
        axis.set(title=case.replace("sigma", "noise") + " m", ylim=(0, 4))
        axis.grid(alpha=0.3)
    for axis in panels[1]:
        axis.set_xlabel("time [s]")
    for axis in panels[:, 0]:
        axis.set_ylabel(label)
    if panels[0, 0].get_legend_handles_labels()[0]:
        panels[0, 0].legend(fontsize=8)
    return write_figure(path, figure, dpi=110)


def snapshots(
    tracks: Mapping[tuple[str, str], ContourTrack], truth: Truth, scans: list[Scan], case: str, path: Path
) -> Path:
    """Detections, truth and ellipses of the first run along the course, a panel for each method."""
    shown = [(m, c) for m, c in METHODS if (case, m) in tracks]
    if case == RADAR:
        shown = [("RM corrected, 2 sigma", "tab:gray"), *shown]
    figure = Figure(figsize=(5.2 * min(len(shown), 3), 3.9 * -(-len(shown) // 3)), layout="constrained")
    panels = np.atleast_1d(figure.subplots(-(-len(shown) // 3), min(len(shown), 3), sharex=True, sharey=True)).ravel()
    for axis, (method, colour) in zip(panels, shown, strict=False):
        panel(axis, tracks[case, method], truth, scans, colour, box_outline if method.startswith("box") else outline)
        axis.set_title(method)
    for axis in panels[len(shown) :]:
        axis.remove()
    figure.suptitle(f"{case}: every {EVERY * DT:.1f} s of one run; the sensor is the triangle")
    return write_figure(path, figure, dpi=110)


def panel(
    axis: Axes, track: ContourTrack, truth: Truth, scans: list[Scan], colour: str, ring_of: Callable[..., NDArray]
) -> None:
    """One method: truth filled, detections as dots, the estimate as a line."""
    for k in range(SETTLED, len(scans), EVERY):
        axis.fill(*truth.outlines[k].T, color="0.85", edgecolor="0.6", linewidth=0.8)
        axis.plot(*detections(scans[k]).T, "k.", markersize=2.5)
        ring = ring_of(track.centre[0, k], root_of(track.size[0, k], track.tilt[0, k]), 65)
        axis.plot(*ring.T, color=colour, linewidth=1.3)
    axis.plot(*truth.poses[:, :2].T, color="0.7", linewidth=0.6, linestyle="--")
    axis.plot(0, 0, "k^", markersize=7)
    axis.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")


def detections(scan: Scan) -> NDArray:
    """Detections (n, 2) [m] of the first run."""
    return scan.xy[0][scan.mask[0]]

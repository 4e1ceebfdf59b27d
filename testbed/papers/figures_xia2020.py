"""Figures of xia2020: distance over time, estimates over the detections they came from, densities over their data."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from testbed.papers.xia2020_generators import GENERATORS, draw_training
from testbed.papers.xia2020_methods import (
    LEARNED,
    LEARNED_N,
    MAP,
    MM,
    ONLINE,
    ONLINE_N,
    RM,
    RM_MATCHED,
    full_table,
    partial_table,
)
from testbed.papers.xia2020_radar import ON_OTHER, ON_RIG
from testbed.papers.xia2020_results import Results
from testbed.papers.xia2020_trials import SIZE, wasserstein
from trackers.geometry import UNIT_BOX, box_corners, ellipse_points
from trackers.htg.bins import HTGTable
from trackers.htg.density import log_density

COLOURS = {
    RM: "0.6", RM_MATCHED: "0.25", ONLINE: "tab:olive", ONLINE_N: "tab:green", LEARNED: "tab:orange",
    LEARNED_N: "tab:brown", MM: "tab:purple", MAP: "tab:blue", ON_RIG: "tab:blue", ON_OTHER: "tab:cyan",
}  # fmt: skip
SHOWN = 4  # snapshots of a course
TOP = 6.0  # [m^2] of the distance plots


def draw_full_view(results: Results, out: Path) -> tuple[Path, ...]:
    """Write the figures of the full view as PNG into the folder `out`."""
    cases = tuple(f"full view, {g}" for g in GENERATORS)
    return (
        over_time(results, cases, (RM, RM_MATCHED, ONLINE, LEARNED, LEARNED_N, MM, MAP), out / "xia2020_full_gwd.png"),
        snapshots(results, cases, (RM, ONLINE, MAP), out / "xia2020_full_snapshots.png"),
        full_densities(out / "xia2020_full_densities.png"),
    )


def draw_partial_view(results: Results, out: Path) -> tuple[Path, ...]:
    """Write the figures of the partial view as PNG into the folder `out`."""
    cases = tuple(c for c in results.trials if c.endswith(" Hz"))
    slow = tuple(c for c in cases if c.endswith(" 2 Hz"))
    methods = (RM, RM_MATCHED, ONLINE_N, LEARNED, LEARNED_N, MM, MAP)
    return (
        over_time(results, cases, methods, out / "xia2020_partial_gwd.png"),
        snapshots(results, slow, (RM, LEARNED, MAP), out / "xia2020_partial_snapshots.png"),
        partial_densities(partial_table(), out / "xia2020_partial_densities.png"),
    )


def draw_radar(results: Results, out: Path) -> tuple[Path, ...]:
    """Write the figures of our radar as PNG into the folder `out`."""
    cases = tuple(results.trials)
    return (
        over_time(
            results, cases, (RM, RM_MATCHED, ONLINE_N, LEARNED_N, MM, ON_RIG, ON_OTHER), out / "xia2020_radar_gwd.png"
        ),
        snapshots(results, cases, (RM, LEARNED_N, ON_RIG), out / "xia2020_radar_snapshots.png", mirrored=True),
    )


def over_time(results: Results, cases: Sequence[str], methods: Sequence[str], path: Path) -> Path:
    """Mean squared Gaussian Wasserstein distance over the runs, a panel for each case."""
    columns = 2 if len(cases) == 4 else min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure = Figure(figsize=(4.6 * columns, 3.3 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis, case in zip(panels.flat, cases, strict=False):
        trial = results.trials[case]
        t = trial.dt * np.arange(1, len(trial.pose) + 1)
        for method in methods:
            if (case, method) in results.traces:
                d = wasserstein(results.traces[case, method], trial).mean(-1)
                axis.plot(t, d, color=COLOURS[method], label=method, linewidth=1.4)
        axis.axvline(t[trial.settled], color="black", linewidth=0.8, linestyle=":")
        axis.set(title=case, ylim=(0.02, TOP * 3), yscale="log")
        axis.grid(alpha=0.3)
    for axis in panels[-1]:
        axis.set_xlabel("time [s]")
    for axis in panels[:, 0]:
        axis.set_ylabel("mean GWD² [m²]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8)
    return save(figure, path)


def snapshots(
    results: Results, cases: Sequence[str], methods: Sequence[str], path: Path, mirrored: bool = False
) -> Path:
    """First run of each case at four times: detections, the true box, and estimated ellipses; sensor to the arrow.

    mirrored: y to the right, drawn downwards.
    """
    figure = Figure(figsize=(3.3 * SHOWN, 2.8 * len(cases)), layout="constrained")
    panels = figure.subplots(len(cases), SHOWN, squeeze=False)
    for row, case in zip(panels, cases, strict=True):
        trial = results.trials[case]
        for axis, k in zip(row, np.linspace(trial.settled, len(trial.pose) - 1, SHOWN).astype(int), strict=True):
            snapshot(axis, results, case, methods, int(k))
            axis.set_title(f"{case}\n{trial.dt * (k + 1):.1f} s", fontsize=8)
            if mirrored:
                axis.invert_yaxis()
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8)
    return save(figure, path)


def snapshot(axis: Axes, results: Results, case: str, methods: Sequence[str], k: int) -> None:
    """One step of the first run."""
    trial = results.trials[case]
    scan, centre = trial.scan, trial.pose[k, 0, :2]
    box = box_corners(trial.pose[k, 0], trial.size[0])
    axis.fill(*box.T, facecolor="0.92", edgecolor="black", linewidth=1.0, label="truth")
    axis.plot(*scan.xy[k, 0][scan.mask[k, 0]].T, "k.", markersize=5, label="detections")
    for method in methods:
        trace = results.traces[case, method]
        ellipse = ellipse_points(trace.estimate.pose[k, 0, :2], trace.extent[k, 0], 60)
        axis.plot(*ellipse.T, color=COLOURS[method], linewidth=1.5, label=method)
    sensor = scan.pose[k, 0, 0, :2] - centre
    if np.abs(trial.scan.pose[..., :2]).max() > 0:
        tip = centre + sensor / np.hypot(*sensor) * 4.4
        axis.annotate("", xy=tip, xytext=centre + (tip - centre) * 0.8, arrowprops={"arrowstyle": "->", "color": "red"})
    axis.set(xlim=centre[0] + np.array([-4.8, 4.8]), ylim=centre[1] + np.array([-3.9, 3.9]), aspect="equal")
    axis.tick_params(labelsize=6)


def density(axis: Axes, table: HTGTable, index: int, u: np.ndarray, title: str) -> None:
    """Density of a bin in unit coordinates over detections u (N, 2)."""
    grid = np.linspace(-1.8, 1.8, 121)
    points = np.stack(np.meshgrid(grid, grid), -1)
    p = np.exp(log_density(points, table.of(np.array(index))))
    axis.contourf(grid, grid, p, levels=12, cmap="Blues")
    axis.plot(*u.T, ".", color="black", markersize=1.2, alpha=0.35)
    axis.plot(*np.vstack([2 * UNIT_BOX, 2 * UNIT_BOX[:1]]).T, color="red", linewidth=0.8)
    axis.set(title=title, xlim=(-1.8, 1.8), ylim=(-1.8, 1.8), aspect="equal")
    axis.title.set_fontsize(8)
    axis.tick_params(labelsize=6)


def full_densities(path: Path) -> Path:
    """Learned densities of the full-view generators over fresh data, front to the right."""
    figure = Figure(figsize=(9.5, 3.4), layout="constrained")
    for axis, (name, draw) in zip(figure.subplots(1, 3), GENERATORS.items(), strict=True):
        density(axis, full_table(name), 0, draw(np.random.default_rng(2), (1500,), SIZE), name)
    return save(figure, path)


def partial_densities(table: HTGTable, path: Path) -> Path:
    """Learned densities of the aspect bins over fresh data, front to the right."""
    data = draw_training(np.random.default_rng(2), 8000)
    bins = table.bin_of(data.aspect)
    figure = Figure(figsize=(12, 6.2), layout="constrained")
    for k, axis in enumerate(figure.subplots(2, len(table) // 2).flat):
        middle = np.degrees(-np.pi + (k + 0.5 * (not table.centred)) * 2 * np.pi / len(table))
        density(axis, table, k, data.u[bins == k], f"aspect {middle:.0f}°")
    return save(figure, path)


def save(figure: Figure, path: Path) -> Path:
    """Write and return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    return path

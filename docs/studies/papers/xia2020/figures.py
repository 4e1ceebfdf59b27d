"""Figures of xia2020: distance over time, estimates over the detections they came from, densities over their data."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.papers.xia2020.claims import COURSES
from studies.papers.xia2020.generators import GENERATORS, draw_training
from studies.papers.xia2020.methods import (
    BEST,
    LEARNED,
    LEARNED_N,
    MAP,
    MM,
    ON_OTHER,
    ON_REAL,
    ON_RIG,
    ONLINE,
    ONLINE_N,
    RIG,
    RM,
    RM_MATCHED,
    full_table,
    partial_table,
)
from studies.papers.xia2020.radar import SCENARIOS
from studies.papers.xia2020.results import TrialRuns
from studies.papers.xia2020.trials import SIZE, Trial, TrialEstimates, wasserstein
from testbed.files import write_figure
from trackers.geometry import UNIT_BOX, box_corners, ellipse_points
from trackers.htg.bins import HTGTable
from trackers.htg.density import log_density

COLOURS = {
    RM: "0.65", RM_MATCHED: "0.25", ONLINE: "tab:olive", ONLINE_N: "tab:green", LEARNED: "tab:orange",
    LEARNED_N: "tab:brown", MM: "tab:purple", MAP: "tab:blue", BEST: "tab:red", ON_RIG: "tab:blue",
    ON_OTHER: "tab:cyan", ON_REAL: "tab:red",
}  # fmt: skip
SHOWN = 4  # snapshots of a course


class CaseGroup(NamedTuple):
    """Cases that share a figure."""

    name: str
    cases: tuple[str, ...]
    methods: tuple[str, ...]  # over time
    shown: tuple[str, ...]  # in the snapshots; none: no snapshots
    mirrored: bool = False  # y to the right


GROUPS = (
    CaseGroup(
        "full_view",
        tuple(f"full view, {g}" for g in GENERATORS),
        (RM, RM_MATCHED, ONLINE, LEARNED, LEARNED_N, MM, MAP),
        (RM, ONLINE, MAP),
    ),
    CaseGroup("2hz", COURSES, (RM, RM_MATCHED, ONLINE_N, LEARNED, LEARNED_N, MM, MAP, BEST), (RM, LEARNED_N, BEST)),
    CaseGroup(
        "13hz",
        tuple(case.replace("2 Hz", "13 Hz") for case in COURSES),
        (RM, RM_MATCHED, ONLINE_N, LEARNED, LEARNED_N, MM, MAP, BEST),
        (),
    ),
    CaseGroup(
        "radar",
        tuple(f"{scenario}, {RIG}" for scenario in SCENARIOS),
        (RM, RM_MATCHED, ONLINE_N, LEARNED_N, MM, ON_RIG, ON_OTHER, ON_REAL),
        (RM, LEARNED_N, ON_RIG),
        mirrored=True,
    ),
)


def draw(results: TrialRuns, out: Path, paper: str) -> tuple[Path, ...]:
    """Write the figures of the cases that were run as PNG into the folder `out`."""
    out.mkdir(parents=True, exist_ok=True)
    paths = []
    for group in GROUPS:
        if set(group.cases) <= set(results.trials):
            paths.append(over_time(results, group, out / f"{paper}_{group.name}_errors.png"))
            if group.shown:
                paths.append(snapshots(results, group, out / f"{paper}_{group.name}_snapshots.png"))
    return (
        *paths,
        full_densities(out / f"{paper}_full_view_densities.png"),
        partial_densities(partial_table(), out / f"{paper}_partial_view_densities.png"),
    )


def position_rmse(found: TrialEstimates, trial: Trial) -> np.ndarray:
    """Root mean square (T,) [m] over the runs."""
    d = found.estimate.pose[..., :2] - trial.pose[..., :2]
    return np.sqrt((d**2).sum(-1).mean(-1))


def mean_wasserstein(found: TrialEstimates, trial: Trial) -> np.ndarray:
    """Mean squared Gaussian Wasserstein distance (T,) [m^2] over the runs."""
    return wasserstein(found, trial).mean(-1)


MEASURES = {  # label -> measure and the ticks of its logarithmic axis
    "mean GWD² [m²]": (mean_wasserstein, (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20)),
    "position RMSE [m]": (position_rmse, (0.05, 0.1, 0.2, 0.5, 1, 2, 5)),
}


def over_time(results: TrialRuns, group: CaseGroup, path: Path) -> Path:
    """Errors over time, a column for each case."""
    columns = len(group.cases)
    figure = Figure(figsize=(3.6 * columns, 6.2), layout="constrained")
    panels = figure.subplots(len(MEASURES), columns, sharex=True, sharey="row", squeeze=False)
    for row, (label, (measure, ticks)) in zip(panels, MEASURES.items(), strict=True):
        for axis, case in zip(row, group.cases, strict=True):
            trial = results.trials[case]
            t = trial.dt * np.arange(1, len(trial.pose) + 1)
            for method in group.methods:
                e = measure(results.estimates[case, method], trial)
                axis.plot(t, e, color=COLOURS[method], label=method, linewidth=1.2)
            axis.axvline(t[trial.settled], color="black", linewidth=0.8, linestyle=":")
            axis.set(yscale="log", ylim=(ticks[0], ticks[-1]))
            axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.minorticks_off()
            axis.grid(alpha=0.3)
        row[0].set_ylabel(label)
    for axis, case in zip(panels[0], group.cases, strict=True):
        axis.set_title(case, fontsize=10)
    for axis in panels[-1]:
        axis.set_xlabel("time [s]; errors count from the dotted line on", fontsize=8)
    legend(figure, panels[0, 0])
    return write_figure(path, figure, dpi=110)


def legend(figure: Figure, axis: Axes) -> None:
    """One legend below all panels."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)), fontsize=8)


def snapshots(results: TrialRuns, group: CaseGroup, path: Path) -> Path:
    """First run of each case at four times: detections, the true box, and estimated ellipses; sensor to the arrow."""
    figure = Figure(figsize=(3.3 * SHOWN, 2.8 * len(group.cases)), layout="constrained")
    panels = figure.subplots(len(group.cases), SHOWN, squeeze=False)
    for row, case in zip(panels, group.cases, strict=True):
        trial = results.trials[case]
        for axis, k in zip(row, np.linspace(trial.settled, len(trial.pose) - 1, SHOWN).astype(int), strict=True):
            snapshot(axis, results, case, group.shown, int(k))
            axis.set_title(f"{case}, {trial.dt * (k + 1):.1f} s", fontsize=8)
            if group.mirrored:
                axis.invert_yaxis()
    legend(figure, panels[0, 0])
    return write_figure(path, figure, dpi=110)


def snapshot(axis: Axes, results: TrialRuns, case: str, methods: Sequence[str], k: int) -> None:
    """One step of the first run."""
    trial = results.trials[case]
    scan, centre = trial.scan, trial.pose[k, 0, :2]
    box = box_corners(trial.pose[k, 0], trial.size[0])
    axis.fill(*box.T, facecolor="0.92", edgecolor="black", linewidth=1.0, label="truth")
    axis.plot(*scan.xy[k, 0][scan.mask[k, 0]].T, "k.", markersize=5, label="detections")
    for method in methods:
        found = results.estimates[case, method]
        ellipse = ellipse_points(found.estimate.pose[k, 0, :2], found.extent[k, 0], 60)
        axis.plot(*ellipse.T, color=COLOURS[method], linewidth=1.5, label=method)
    detected = np.flatnonzero(scan.mask[k, 0])
    if len(detected) and scan.pose[..., :2].any():  # in full view there is no sensor
        sensor = scan.pose[k, 0, min(detected[0], scan.pose.shape[-2] - 1), :2] - centre
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
    return write_figure(path, figure, dpi=110)


def partial_densities(table: HTGTable, path: Path) -> Path:
    """Learned densities of the aspect bins over fresh data, front to the right."""
    data = draw_training(np.random.default_rng(2), 8000)
    bins = table.bin_of(data.aspect)
    figure = Figure(figsize=(12, 6.2), layout="constrained")
    for k, axis in enumerate(figure.subplots(2, len(table) // 2).flat):
        middle = np.degrees(-np.pi + (k + 0.5 * (not table.centred)) * 2 * np.pi / len(table))
        density(axis, table, k, data.u[bins == k], f"aspect {middle:.0f}°")
    return write_figure(path, figure, dpi=110)

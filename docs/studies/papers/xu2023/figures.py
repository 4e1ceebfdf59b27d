"""Figures of xu2023: mode probabilities (Fig. 5), errors over time (Fig. 6), and what the paper does not print."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.papers.xu2023.cases import VARIED
from studies.papers.xu2023.claims import group
from studies.papers.xu2023.measures import TABLE_2, UNITS, rmse
from studies.papers.xu2023.simulation import STAGES, STEP, STEPS, RunErrors
from testbed.files import write_figure

Runs = Mapping[tuple[str, str], RunErrors]
MODES = tuple(STAGES)
TIME = np.arange(STEPS) * STEP
FOLLOWS = "near, extent follows"
MODE_PANELS = (
    ("near", "DRA-IMM, S"),
    ("near", "DRA-IMM, V"),
    ("far", "DRA-IMM, V"),
    ("near", "literal"),
    (FOLLOWS, "recommended"),
)
ERROR_PANELS = {
    "near, S": (*(("near", f"{m}, S") for m in TABLE_2), ("near", "literal")),
    "near, V": (*(("near", f"{m}, V") for m in TABLE_2), ("near", "literal")),
    "far, V": (*(("far", f"{m}, V") for m in TABLE_2), ("far", "literal")),
    "extent follows the velocity": (
        (FOLLOWS, "EDRA-IMM, V"),
        *((f"{where}, extent follows", "recommended") for where in ("near", "far", "behind")),
    ),
}
COLOURS = {"DRA(CV), S": "tab:red", "DRA-IMM, S": "tab:blue", "recommended": "tab:green"}


def draw(runs: Runs, out: Path) -> tuple[Path, ...]:
    """Draw all figures into the folder `out`."""
    return modes(runs, out), errors(runs, out), unprinted(runs, out)


def modes(runs: Runs, out: Path) -> Path:
    """Mean probability of each motion model over time, a panel for each method."""
    figure = Figure(figsize=(8, 1.8 * len(MODE_PANELS)), layout="constrained")
    panels = figure.subplots(len(MODE_PANELS), 1, sharex=True)
    for axis, (case, method) in zip(panels, MODE_PANELS, strict=True):
        found = runs[case, method]
        for k, name in enumerate(MODES):
            line = axis.plot(TIME, found.mode[..., k].mean(1), label=name)[0]
            for start, end in STAGES[name]:
                axis.hlines(1.05, start, end, colors=line.get_color(), linewidth=4)
        title = f"{case}: {method}, mean of {found.mode.shape[1]} runs"
        axis.set(ylabel="probability", ylim=(0, 1.1), title=title)
    panels[0].legend(ncols=len(MODES), loc="center left")
    panels[-1].set_xlabel("time [s]; bars: the true mode")
    return write_figure(out / "xu2023_modes.png", figure, dpi=110)


def errors(runs: Runs, out: Path) -> Path:
    """RMSE of position and velocity over time, a column for each course and reading."""
    figure = Figure(figsize=(15, 6), layout="constrained")
    panels = figure.subplots(2, len(ERROR_PANELS), sharex=True, sharey="row")
    for column, (title, rows) in zip(panels.T, ERROR_PANELS.items(), strict=True):
        for case, method in rows:
            label = f"{case.split(',')[0]}: {method}" if case.endswith("follows") else method
            for axis, squared in zip(column, runs[case, method][:2], strict=True):
                axis.semilogy(TIME, np.sqrt(squared.mean(1)), label=label, linewidth=1)
        column[0].set_title(title)
        column[0].legend(fontsize="x-small")
        column[1].set_xlabel("time [s]")
    for axis, what in zip(panels[:, 0], ("position RMSE [m]", "velocity RMSE [m/s]"), strict=True):
        axis.set_ylabel(what)
    for axis in panels.flat:
        axis.grid(alpha=0.3)
    return write_figure(out / "xu2023_errors.png", figure, dpi=110)


def unprinted(runs: Runs, out: Path) -> Path:
    """Errors of three methods under everything that the paper does not print, with Table II as dashed lines."""
    names = list(dict.fromkeys(variant for case, variant in runs if case.startswith(VARIED)))
    groups = list(dict.fromkeys(map(group, names)))
    names = sorted(names, key=lambda name: groups.index(group(name)))
    figure = Figure(figsize=(15, 7), layout="constrained")
    panels = figure.subplots(2, len(STAGES), sharex=True, sharey="row")
    for column, stage in zip(panels.T, STAGES, strict=True):
        for row, (axis, unit) in enumerate(zip(column, UNITS, strict=True)):
            for method, colour in COLOURS.items():
                dots(axis, runs, method, names, stage, row, colour)
                if method[:-3] in TABLE_2:
                    k = 2 * list(STAGES).index(stage) + row
                    axis.axhline(TABLE_2[method[:-3]][k], color=colour, linestyle="--", linewidth=0.8)
            axis.set(yscale="log", ylabel=f"RMSE [{unit}]" if stage == "CV" else None)
            axis.grid(alpha=0.3, axis="y")
        column[0].set_title(stage)
        column[1].set_xticks(range(len(names)), names, rotation=90, fontsize="small")
    panels[0, 0].legend(fontsize="small")
    figure.suptitle("What the paper does not print, with 95 % intervals; dashed: Table II; first: what all else has")
    return write_figure(out / "xu2023_unprinted.png", figure, dpi=110)


def dots(axis: Axes, runs: Runs, method: str, names: list[str], stage: str, row: int, colour: str) -> None:
    """Figures of one method with intervals, where it has the variant; row 0 is position, 1 velocity."""
    at = [k for k, name in enumerate(names) if (f"{VARIED}{method}", name) in runs]
    found = [rmse(runs[f"{VARIED}{method}", names[k]][row], stage) for k in at]
    value, half = np.array(found).T
    shift = 0.2 * (list(COLOURS).index(method) - 1)
    axis.errorbar(
        np.array(at) + shift, value, np.minimum(half, 0.9 * value), fmt="o", markersize=4, color=colour, label=method
    )

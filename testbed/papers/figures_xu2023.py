"""Figures of xu2023: mode probabilities against the true mode (Fig. 5), and errors over time (Fig. 6)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from testbed.papers.xu2023_trials import STAGES, STEP, STEPS, Trace

Traces = Mapping[tuple[str, str], Trace]
MODES = tuple(STAGES)
COURSES = ("near", "far", "near, extent follows")


def draw(traces: Traces, out: Path) -> tuple[Path, ...]:
    """Draw all figures into the folder `out`."""
    return modes(traces, out), errors(traces, out)


def modes(traces: Traces, out: Path) -> Path:
    """Mean probability of each motion model over time, a panel for each method with three."""
    chosen = [(key, t) for key, t in traces.items() if t.mode.shape[-1] == len(MODES) and key[0] == "near"]
    figure = Figure(figsize=(8, 1.8 * len(chosen)), layout="constrained")
    axes = figure.subplots(len(chosen), 1, sharex=True, squeeze=False)[:, 0]
    time = np.arange(STEPS) * STEP
    for ax, ((_, method), trace) in zip(axes, chosen, strict=True):
        for k, name in enumerate(MODES):
            line = ax.plot(time, trace.mode[..., k].mean(1), label=name)[0]
            for start, end in STAGES[name]:
                ax.hlines(1.05, start, end, colors=line.get_color(), linewidth=4)
        ax.set(ylabel="probability", ylim=(0, 1.1), title=method)
    axes[0].legend(ncols=len(MODES), loc="center right")
    axes[-1].set_xlabel("time [s]; bars: the true mode")
    path = out / "xu2023_modes.png"
    figure.savefig(path, dpi=120)
    return path


def errors(traces: Traces, out: Path) -> Path:
    """RMSE of position and velocity over time, a column for each course of the radar."""
    figure = Figure(figsize=(12, 6), layout="constrained")
    axes = figure.subplots(2, len(COURSES), sharex=True, squeeze=False)
    time = np.arange(STEPS) * STEP
    for (course, method), trace in traces.items():
        column = axes[:, COURSES.index(course)]
        for ax, squared in zip(column, (trace.position, trace.velocity), strict=True):
            ax.semilogy(time, np.sqrt(squared.mean(1)), label=method, linewidth=1)
    for ax, course in zip(axes[0], COURSES, strict=True):
        ax.set_title(course)
        ax.legend(fontsize="x-small")
    axes[0, 0].set_ylabel("position RMSE [m]")
    axes[1, 0].set_ylabel("velocity RMSE [m/s]")
    for ax in axes[1]:
        ax.set_xlabel("time [s]")
    path = out / "xu2023_errors.png"
    figure.savefig(path, dpi=120)
    return path

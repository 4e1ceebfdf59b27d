"""Figures over time, one panel a scenario: errors with their bands, NEES and NIS against the limits of chance."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from testbed.evaluation.intervals import FEWEST, chi2_limits
from testbed.experiments.report.figure_style import DURING, LIMITS, ONSET, LineStyle, label, panels, plain_log
from testbed.experiments.series import DOF, PhaseTimes, Series
from testbed.experiments.store import Results

SHADES = {"onset": ONSET, "during": DURING}
LABELS = {"onset": "onset", "during": "maneuver"}
BAND = 0.13  # opacity
SIZES = {1: (8.0, 4.0), 2: (5.5, 3.2), 3: (4.2, 2.9), 4: (3.5, 2.2)}  # [in] of a panel, by the number of columns
LEAST, MOST = 1e-2, 1e4  # of NEES and NIS that are drawn


class TimeData(NamedTuple):
    """What all figures over time are drawn from."""

    results: Results
    series: Sequence[Series]
    times: Sequence[PhaseTimes]
    styles: dict[str, LineStyle]


def errors(data: TimeData, quantity: str, label: str) -> Figure:
    """Means over seeds with their 95 % bands; phases are shaded."""
    figure, axes = _panels(data, quantity, label)
    for scenario, axis in axes.items():
        shown = [s for s in data.series if (s.scenario, s.quantity) == (scenario, quantity)]
        for s in shown:
            axis.fill_between(s.time, s.low, s.high, color=data.styles[s.tracker].color, alpha=BAND, linewidth=0)
        for s in shown:
            axis.plot(s.time, s.mean, **data.styles[s.tracker].line)
        axis.set_ylim(0, _top(shown))
    _legend(figure, data, quantity, [])
    return figure


def consistency(data: TimeData, quantity: str, label: str) -> Figure:
    """Means over runs and objects, on a log axis, with the limits of a consistent filter."""
    figure, axes = _panels(data, quantity, label)
    for scenario, axis in axes.items():
        shown = [s for s in data.series if (s.scenario, s.quantity) == (scenario, quantity)]
        _limits(axis, shown)
        for s in shown:
            axis.plot(s.time, np.where(s.mean > 0, s.mean, np.nan), **data.styles[s.tracker].line)
        axis.set_yscale("log")
        plain_log(axis.yaxis)
        low, high = axis.get_ylim()
        axis.set_ylim(max(low, LEAST), min(high, MOST))
    handles = [Patch(color=LIMITS, alpha=0.35, label="95 % limits of a consistent filter")]
    _legend(figure, data, quantity, handles)
    return figure


def _panels(data: TimeData, quantity: str, label: str) -> tuple[Figure, dict[str, Axes]]:
    found = {s.scenario for s in data.series if s.quantity == quantity}
    scenarios = [c for c in data.results.study.scenarios if c in found]
    columns = min(len(scenarios), 4 if len(scenarios) > 6 else 3)
    figure, axes = panels(len(scenarios), SIZES[columns], (0.0, 1.0), columns)
    for scenario, axis in zip(scenarios, axes, strict=True):
        end = max(s.time[-1] for s in data.series if s.scenario == scenario)
        axis.set(title=scenario, xlim=(0, end))
        for phase in data.times:
            if phase.scenario == scenario:
                axis.axvspan(phase.start, phase.end, color=SHADES[phase.phase], linewidth=0, zorder=0)
    for axis in axes[-columns:]:
        axis.set_xlabel("time [s]")
    figure.supylabel(label)
    return figure, dict(zip(scenarios, axes, strict=True))


def _limits(axis: Axes, shown: Sequence[Series]) -> None:
    """The chi-square limits, for the median count over the trackers."""
    longest = max((s.time for s in shown), key=len)
    counts = np.full((len(shown), len(longest)), np.nan)
    for row, s in zip(counts, shown, strict=True):
        row[: len(s.size)] = s.size
    known = np.isfinite(counts).any(0)
    count = np.zeros(len(longest))
    count[known] = np.nanmedian(counts[:, known], axis=0)
    low, high = chi2_limits(DOF, count)
    axis.fill_between(longest, low, high, color=LIMITS, alpha=0.35, linewidth=0)
    axis.axhline(DOF, color=LIMITS, linewidth=0.8)


def _top(shown: Sequence[Series]) -> float:
    """Upper end of the axis: what the means need, and bands up to twice as much, so that a wide one hides nothing."""
    means = max((np.nanmax(s.mean, initial=0.0) for s in shown), default=0.0)
    bands = max((np.nanmax(s.high, initial=0.0) for s in shown), default=0.0)
    return 1.05 * min(max(means, bands), 2 * means) or 1.0


def _legend(figure: Figure, data: TimeData, quantity: str, more: list[Patch]) -> None:
    names = dict.fromkeys(s.tracker for s in data.series if s.quantity == quantity and np.isfinite(s.mean).any())
    handles: list[Line2D | Patch] = [
        Line2D([], [], label=label(n, data.results.study), **data.styles[n].line) for n in names
    ]
    handles += more
    if names and quantity in ("gospa", "position") and len(data.results.study.seeds) >= FEWEST:
        handles.append(Patch(color=data.styles[next(iter(names))].color, alpha=BAND, label="95 % band"))
    shaded = {phase.phase for phase in data.times}
    handles += [Patch(color=SHADES[phase], label=text) for phase, text in LABELS.items() if phase in shaded]
    wide = figure.get_figwidth() > 10
    figure.legend(handles=handles, loc="outside lower center", ncols=5 if wide else 3)

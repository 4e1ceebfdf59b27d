"""Figures of a study of regret: by tracker and planner, attribution, regret against tracking errors, doses."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from testbed.environment.sources.substitution import GROUP_NAMES, GROUPS
from testbed.evaluation.metric import METRICS
from testbed.experiments.pairs import Attribution, Cell, correlations
from testbed.experiments.report.figure_style import COLOURS, line_styles, panels
from testbed.experiments.report.figures import Plot, plot

MARGIN = (1.0, 0.6)  # [in] around the panels
GROUP_COLOURS = dict(zip(GROUPS, COLOURS, strict=False))
DOSE_UNITS = {
    "velocity_lag": "s", "velocity_noise": "m/s", "lateral_velocity": "m/s", "lateral_position": "m", "heading": "rad",
    "near_edge": "m", "length": "m", "birth_delay": "s", "loss_rate": "1/s", "latency": "s", "covariance": "-",
}  # fmt: skip


def plots(
    total: Sequence[Cell], shares: Sequence[Attribution], errors: pd.DataFrame, doses: Sequence[Cell]
) -> Iterator[Plot]:
    """Those for which there are data; cells are of the drive score."""
    if total:
        yield plot("regret", lambda: by_scenario(total))
    if shares:
        yield plot("attribution", lambda: attribution_bars(shares))
    if correlations(errors):
        yield plot("errors", lambda: against_errors(errors), "tracking errors")
    if doses:
        yield plot("doses", lambda: dose_response(doses))


def _names_down(axis: Axes, names: Sequence[str], title: str, xlabel: str) -> None:
    """Names down the side, regret across, and a line where there is none."""
    axis.axvline(0.0, color="0.35", linewidth=0.8)
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.set(title=title, xlabel=xlabel)


def _regret_up(axis: Axes, title: str, xlabel: str) -> None:
    """Regret up the side, and a line where there is none."""
    axis.axhline(0.0, color="0.35", linewidth=0.8)
    axis.set(title=title, xlabel=xlabel, ylabel="regret (score)")


def _legend(figure: Figure, columns: int) -> None:
    """What is drawn in any panel, each label once."""
    drawn = [axis.get_legend_handles_labels() for axis in figure.axes]
    handles = {label: handle for found in drawn for handle, label in zip(*found, strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)


def by_scenario(cells: Sequence[Cell]) -> Figure:
    """A panel a scenario: trackers down, the regret across, a colour and marker a planner."""
    scenarios, trackers, planners = (
        list(dict.fromkeys(getattr(cell, name) for cell in cells)) for name in ("scenario", "condition", "planner")
    )
    styles = line_styles(planners)
    height = 0.9 + 0.12 * len(trackers) * (1 + len(planners))
    figure, axes = panels(len(scenarios), (2.8, height), MARGIN, sharex=True)
    for scenario, axis in zip(scenarios, axes, strict=True):
        for cell in (c for c in cells if c.scenario == scenario):
            offset = (planners.index(cell.planner) + 1) / (len(planners) + 1) - 0.5
            mean, style = cell.change.mean, styles[cell.planner]
            y = trackers.index(cell.condition) + 0.8 * offset
            axis.plot([-mean.high, -mean.low], [y, y], color=style.color)
            axis.plot(-mean.value, y, style.marker, color=style.color, label=cell.planner)
        _names_down(axis, trackers, scenario, "regret (score)")
    _legend(figure, len(planners))
    return figure


def attribution_bars(found: Sequence[Attribution]) -> Figure:
    """A bar a tracker in each scenario and planner, made of the shares of the groups; positive is a cost."""
    drives = list(dict.fromkeys((a.scenario, a.planner) for a in found))
    height = 0.9 + 0.35 * len({a.tracker for a in found})
    figure, axes = panels(len(drives), (2.8, height), MARGIN, sharex=True)
    for driven, axis in zip(drives, axes, strict=True):
        rows = [a for a in found if (a.scenario, a.planner) == driven]
        for y, a in enumerate(rows):
            ends = {True: 0.0, False: 0.0}  # of the bars to the right, and to the left
            for group in GROUPS:
                cost, colour = -a.share[group].value, GROUP_COLOURS[group]
                axis.barh(y, cost, left=ends[cost > 0], color=colour, label=GROUP_NAMES[group], height=0.6)
                ends[cost > 0] += cost
            axis.plot(-a.total.value, y, "o", color="black", markerfacecolor="white")
        _names_down(axis, [a.tracker for a in rows], ", ".join(driven), "regret against in-view (score)")
    _legend(figure, len(GROUPS))
    return figure


def against_errors(table: pd.DataFrame) -> Figure:
    """A panel a tracking error: regret over it, a colour a tracker."""
    known = {c.error: c for c in correlations(table)}
    trackers = list(dict.fromkeys(table["condition"]))
    styles = line_styles(trackers)
    figure, axes = panels(len(known), (2.7, 2.2), MARGIN)
    for key, axis in zip(known, axes, strict=True):
        metric = METRICS[key]
        for name in trackers:
            part = table[table["condition"] == name]
            axis.plot(part[key], part["regret"], styles[name].marker, color=styles[name].color, label=name, alpha=0.8)
        _regret_up(axis, f"{metric.label}: rho {known[key].rho:+.2f}", metric.title)
    _legend(figure, min(6, len(trackers)))
    return figure


def dose_response(cells: Sequence[Cell]) -> Figure:
    """A panel an error: regret over its size, a line a scenario and planner."""
    doses = [(c, *c.condition.partition("+")[2].partition("=")[::2]) for c in cells]
    names = list(dict.fromkeys(name for _, name, size in doses if "+" not in size))
    lines = list(dict.fromkeys(f"{c.scenario}, {c.planner}" for c in cells))
    styles = line_styles(lines)
    figure, axes = panels(max(1, len(names)), (2.7, 2.2), MARGIN)
    for name, axis in zip(names, axes, strict=False):
        for line in lines:
            found = [
                (float(size), -c.change.mean.value, -c.change.mean.high, -c.change.mean.low)
                for c, other, size in doses
                if other == name and "+" not in size and f"{c.scenario}, {c.planner}" == line
            ]
            x, *y = np.array(sorted([(0.0, 0.0, 0.0, 0.0), *found])).T  # without the error nothing changes
            axis.plot(x, y[0], label=line, marker=styles[line].marker, **styles[line].line)
            axis.fill_between(x, y[1], y[2], color=styles[line].color, alpha=0.15, linewidth=0)
        _regret_up(axis, name, f"{name} [{DOSE_UNITS[name]}]")
    _legend(figure, min(4, len(lines)))
    return figure

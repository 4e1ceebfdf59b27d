"""Texts of the review log: the pages beside the scene and the flat properties of a run."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from testbed.evaluation.metric import METRICS, Metric
from testbed.log.record import RunMeta

OF_TRACKER = (  # what a run shows of each tracker
    "objects_visible", "objects_confirmed", "gospa", "localisation", "missed", "false", "missed_percent",
    "false_per_scan", "switches", "lost", "birth_delay", "unborn_percent", "uncovered_gap", "plain_view_gap",
    "tracks_clutter", "tracks_ghost", "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width",
    "gwd", "box_iou", "contour_iou", "nees_position", "nees_velocity",
)  # fmt: skip
OF_DRIVE = ("collisions", "ttc_min", "distance_min", "progress", "speed_mean", "deceleration_max", "harsh_braking")

Value = str | int | float | bool


def shown(keys: Sequence[str]) -> list[Metric]:
    """The metrics of some keys."""
    return [METRICS[key] for key in keys]


def flat_properties(meta: RunMeta) -> dict[str, Value]:
    """What identifies a run, as columns of a table of runs."""
    fixed: dict[str, Value] = {
        "scenario": meta.scenario,
        "seed": int(meta.seed),
        "radar": meta.radar,
        "trackers": " ".join(meta.trackers),
        "planner": meta.planner,
    }
    varied = {f"config_{_key(name)}": _written(value) for name, value in meta.config.items()}
    versions = {f"version_{_key(name)}": text for name, text in meta.versions.items()}
    return fixed | varied | versions


def _written(value: object) -> str:
    """A setting as text."""
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def flat_summary(summary: Mapping[str, Value | Mapping[str, Value]]) -> dict[str, Value]:
    """Facts under their own names, metrics as `<tracker>_<metric>`."""
    flat: dict[str, Value] = {}
    for name, value in summary.items():
        if isinstance(value, Mapping):
            flat |= {f"{_key(name)}_{_key(inner)}": _plain(f"{name}.{inner}", v) for inner, v in value.items()}
        else:
            flat[_key(name)] = _plain(name, value)
    return flat


def _key(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)


def _plain(name: str, value: object) -> Value:
    """A number or text that a property can hold."""
    if isinstance(value, np.generic):
        value = value.item()
    if not isinstance(value, str | int | float | bool):
        raise TypeError(
            f"summary[{name!r}] must be a number or a text, got {type(value).__name__}; leave it out or use NaN"
        )
    return value


def config_text(meta: RunMeta) -> str:
    """Page with everything that identifies the run."""
    rows = {"scenario": meta.scenario, "seed": str(meta.seed), "radar": meta.radar}
    rows |= {"trackers": ", ".join(meta.trackers), "planner": meta.planner}
    rows |= {name: _written(value) for name, value in meta.config.items()}
    return "\n\n".join(
        [
            markdown_table(("setting", "value"), rows.items()),
            markdown_table(("package", "version"), meta.versions.items()),
        ]
    )


def unfinished_text(meta: RunMeta) -> str:
    """Page of a run that has no summary."""
    return f"{_title(meta)}\n\nNo summary: the run was interrupted, or its log was closed without one."


def summary_text(meta: RunMeta, summary: Mapping[str, Value | Mapping[str, Value]]) -> str:
    """Page with a table of measures with one column a tracker, and the facts of the drive, by their plain names."""
    named = {f"drive_{metric.key}": metric for metric in shown(OF_DRIVE)}
    facts = {named[name].title: named[name].text(value, "-") for name, value in summary.items() if name in named}
    facts |= {
        name: _short(value)
        for name, value in summary.items()
        if not isinstance(value, Mapping) and not name.startswith("drive_")
    }
    tables = {name: value for name, value in summary.items() if isinstance(value, Mapping)}
    pages = [_title(meta)]
    if tables:
        body = [
            (metric.title, *(metric.text(table.get(metric.key), "-") for table in tables.values()))
            for metric in shown(OF_TRACKER)
            if any(metric.key in table for table in tables.values())
        ]
        pages.append(markdown_table(("measure", *tables), body))
    if facts:
        pages.append(markdown_table(("run", ""), facts.items()))
    return "\n\n".join(pages)


def _title(meta: RunMeta) -> str:
    return f"## {meta.scenario}, seed {meta.seed}"


def _short(value: Value) -> str:
    if isinstance(value, float | np.floating):
        return "-" if np.isnan(value) else f"{value:.3g}"
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


def number(value: object, digits: int) -> str:
    """A figure with so many digits, a dash where nothing was measured."""
    measured = isinstance(value, int | float | np.number) and np.isfinite(value)
    return f"{value:.{digits}f}" if measured else "-"


def markdown_table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """A table in markdown; "|" in a cell becomes "/"."""
    lines: list[Sequence[str]] = [head, ("---",) * len(head), *body]
    return "\n".join("| " + " | ".join(cell.replace("|", "/") for cell in line) + " |" for line in lines)

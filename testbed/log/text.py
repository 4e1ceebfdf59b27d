"""Texts of the review log: the pages beside the scene, in markdown, and the flat properties of a run."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files

import numpy as np

from testbed.evaluation.metric import METRICS, Metric
from testbed.log import palette, paths
from testbed.log.record import RunMeta

OF_TRACKER = (  # what a run shows of each tracker
    "objects_visible", "objects_confirmed", "gospa", "localisation", "missed", "false", "missed_percent",
    "false_per_scan", "switches", "lost", "birth_delay", "unborn_percent", "uncovered_gap", "plain_view_gap",
    "tracks_clutter", "tracks_ghost", "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width",
    "gwd", "box_iou", "contour_iou", "nees_position", "nees_velocity", "hota", "mota", "idf1",
)  # fmt: skip
OF_DRIVE = ("collisions", "ttc_min", "distance_min", "progress", "speed_mean", "deceleration_max", "harsh_braking")

Table = Mapping[str, float | int | str | None]  # a row of it

COUNTS = {  # of a row of `objects` in the results: what are no metrics, and their headings
    "severity": "severity [m^2 s]", "scans_counted": "scans in view", "scans_missed": "scans without a track",
}  # fmt: skip
COLUMNS = (
    "severity", "scans_counted", "birth_delay", "scans_missed", "lost", "switches", "gwd", "rmse_position",
    "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width",
)  # fmt: skip
NOTHING_WRONG = "Nothing went wrong that counts: every vehicle in view had a track, and no track was wrong."
RINGS = (25.0, 50.0, 100.0, 150.0)  # [m] around the ego

Value = str | int | float | bool


def shown(keys: Sequence[str]) -> list[Metric]:
    """The metrics of some keys that can be computed here."""
    return [METRICS[key] for key in keys if METRICS[key].known]


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


def subject(moment: Table) -> str:
    """Whom a moment is about: the object with its class, or the track."""
    if moment["object"] is None:
        return f"track {moment['track']}"
    return f"{paths.vehicle(int(moment['object']))} {moment['kind']}"


def happened(moment: Table) -> str:
    """What happened, in words."""
    return f"{moment['what']}: {moment['text']}"


def moments_text(moments: Sequence[Table]) -> str:
    """Page of the worst moments, the worst first."""
    if not moments:
        return NOTHING_WRONG
    entries = [
        f"{n}. **{m['time']:.1f} s, {subject(m)}**: {happened(m)}. *{m['why']}* "
        f"({m['tracker']}, {m['severity']:.1f} m^2 s)"
        for n, m in enumerate(moments, 1)
    ]
    note = "Severity: squared error at GOSPA's prices over the time that it lasted, nearer to the ego weighing more."
    return "\n".join([*entries, "", note])


def objects_text(objects: Sequence[Table]) -> str:
    """Page of the objects that counted, those of greatest severity first."""
    rows = sorted((row for row in objects if row["scans_counted"]), key=lambda row: -float(row["severity"] or 0.0))
    head = ("object", "tracker", *(COUNTS.get(key) or METRICS[key].title for key in COLUMNS))
    body = [
        (
            f"{paths.vehicle(int(row['object'] or 0))} {row['kind']}",
            str(row["tracker"]),
            *(_cell(key, row.get(key)) for key in COLUMNS),
        )
        for row in rows
    ]
    return markdown_table(head, body)


def _cell(key: str, value: float | int | str | None) -> str:
    if key in METRICS:
        return METRICS[key].text(value, "-")
    return number(value, 0 if isinstance(value, int) else 1)


def legend_text(trackers: Sequence[str]) -> str:
    """Page that says what every line and dot is."""
    kinds = zip(palette.KIND_COLORS, palette.KIND_NOTES.values(), strict=True)
    note = "reported tracks of {} with their ids; the very thin ones are not yet reported"
    tracks = [(palette.tracker_name(index), note.format(name)) for index, name in enumerate(trackers)]
    page = files("testbed.log").joinpath("legend.md").read_text(encoding="utf-8").rstrip()
    rings = ", ".join(f"{r:g}" for r in RINGS)
    return page.format(kinds=markdown_table(("colour", "what"), kinds), tracks=_lines(tracks), rings=rings)


def number(value: object, digits: int) -> str:
    """A figure with so many digits, a dash where nothing was measured."""
    measured = isinstance(value, int | float | np.number) and np.isfinite(value)
    return f"{value:.{digits}f}" if measured else "-"


def markdown_table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """A table in markdown; "|" in a cell becomes "/"."""
    return _lines([head, ("---",) * len(head), *body])


def _lines(rows: Iterable[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(cell.replace("|", "/") for cell in row) + " |" for row in rows)

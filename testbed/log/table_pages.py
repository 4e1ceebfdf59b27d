"""Pages of a log as tables in markdown: the worst moments, and the objects sorted by severity."""

from collections.abc import Mapping, Sequence

from testbed.evaluation.metric import METRICS
from testbed.log import paths
from testbed.log.text import markdown_table, number

Table = Mapping[str, float | int | str | None]  # a row of it

COUNTS = {  # of a row of `objects` in the results: what are no metrics, and their headings
    "severity": "severity [m^2 s]", "scans_counted": "scans in view", "scans_missed": "scans without a track",
}  # fmt: skip
COLUMNS = (
    "severity", "scans_counted", "birth_delay", "scans_missed", "lost", "switches", "gwd", "rmse_position",
    "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width",
)  # fmt: skip


NOTHING_WRONG = "Nothing went wrong that counts: every vehicle in view had a track, and no track was wrong."


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

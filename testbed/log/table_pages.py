"""Pages of a log as tables in markdown: the worst moments, and the objects sorted by severity."""

from collections.abc import Mapping, Sequence

from testbed.log import paths
from testbed.log.text import markdown_table, number

Table = Mapping[str, float | int | str | None]  # a row of it

COLUMNS = (  # key of a row of `objects` in the results, heading with unit, digits
    ("severity", "severity [m^2 s]", 1),
    ("scans_counted", "scans in view", 0),
    ("birth_delay", "birth delay [s]", 2),
    ("scans_missed", "scans without a track", 0),
    ("lost", "lost", 0),
    ("switches", "switches", 0),
    ("gwd", "GWD [m]", 2),
    ("rmse_position", "position [m]", 2),
    ("rmse_velocity", "velocity [m/s]", 2),
    ("rmse_heading_deg", "heading [deg]", 1),
    ("rmse_length", "length [m]", 2),
    ("rmse_width", "width [m]", 2),
)


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
    head = ("object", "tracker", *(heading for _, heading, _ in COLUMNS))
    body = [
        (
            f"{paths.vehicle(int(row['object'] or 0))} {row['kind']}",
            str(row["tracker"]),
            *(number(row.get(key), digits) for key, _, digits in COLUMNS),
        )
        for row in rows
    ]
    return markdown_table(head, body)

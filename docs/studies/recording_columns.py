"""Tables of columns in docs/own-recordings.md: what a recording holds, and what a replay writes."""

from testbed.log.text import markdown_table
from testbed.replay.columns import TABLES, Column, Table, profile_columns
from testbed.replay.tracks_file import FIELDS, SCHEMA


def input_tables() -> str:
    """A heading and a table of columns for each table of a recording."""
    return "\n\n".join(_table(table) for table in TABLES.values())


def _table(table: Table) -> str:
    needed = "needed" if table.needed else "if there is any"
    profiles = profile_columns()
    rows = [_row(column) for column in table.columns if column.name not in profiles]
    if len(rows) < len(table.columns):
        rows.append(
            (f"`{profiles[0]}`, ...", "", "", "where detections lie on a body: `DepthProfile` of trackers/scan.py")
        )
    head = f"### {table.name} ({needed})\n\nA row is {table.note}.\n\n"
    return head + markdown_table(("column", "unit", "needed", "what"), rows)


def _row(column: Column) -> tuple[str, str, str, str]:
    return f"`{column.name}`", column.unit, "yes" if column.needed else "", column.note


def track_columns() -> str:
    """The columns of the tracks that a replay writes."""
    first = [("`tracker`", "", "its name"), ("`time`", "s", "of the scan, as in the tables")]
    rows = [*first, *((f"`{f.name}`", f.unit, f.note) for f in FIELDS)]
    assert [row[0].strip("`") for row in rows] == SCHEMA.names
    return markdown_table(("column", "unit", "what"), rows)

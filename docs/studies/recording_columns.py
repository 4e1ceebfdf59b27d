"""Tables of columns: what a recording holds (docs/own-recordings.md), and what tracks are (docs/own-tracks.md)."""

from testbed.log.text import markdown_table
from testbed.replay.columns import EDGES, TABLES, TRACKS, Column, Table, profile_columns


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
    """The columns of tracks, as a replay writes them and as they are read."""
    together = [f"{name}_std" for name in EDGES]
    rows = [_row(c) for c in TRACKS.columns if not c.name.startswith("cov_") and c.name not in together]
    rows.append(
        (
            ", ".join(f"`{name}`" for name in together),
            "m",
            "",
            "of the edges, where it does not follow from centre and size",
        )
    )
    rows.append(("`cov_x_x`, `cov_x_y`, ... `cov_vy_vy`", "m, s", "", "covariances of x, y, vx, vy, ten columns"))
    return markdown_table(("column", "unit", "needed", "what"), rows)

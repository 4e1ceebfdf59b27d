"""Tables of a comparison in markdown and on the terminal; the template of the report page sets them in HTML."""

from rich.markup import escape
from rich.table import Table

from testbed.command_line.tables import light_table
from testbed.experiments.report.tables import Field, Grid
from testbed.log.text import markdown_table


def markdown(grid: Grid) -> str:
    """Numbers with their intervals; names of trackers down the side as code."""
    rows = [(f"`{n}`" if grid.corner == "tracker" else n, *map(_wide, fields)) for n, fields in grid.lines]
    return markdown_table((grid.corner, *grid.heads), rows)


def terminal(grid: Grid, title: str, narrow: bool = False, no_wrap: bool = False) -> Table:
    """Numbers with their intervals; narrow: half the width of the interval below the number."""
    table = light_table(title)
    table.add_column(grid.corner, no_wrap=True)
    for head in grid.heads:
        table.add_column(escape(head), justify="left" if head in grid.words else "right", no_wrap=no_wrap)
    for name, fields in grid.lines:
        table.add_row(escape(name), *(escape((_narrow if narrow else _wide)(field)) for field in fields))
    return table


def _wide(field: Field) -> str:
    return f"{field.text} {field.bounds}" if field.bounds else field.text


def _narrow(field: Field) -> str:
    return f"{field.text}\n±{field.half}" if field.half else field.text

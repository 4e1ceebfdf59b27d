"""Tables of a comparison: what is marked, and what each renderer makes of them."""

import io

import numpy as np
from rich.console import Console

from testbed.evaluation.intervals import NO_INTERVAL, Interval
from testbed.experiments.report import tables
from testbed.experiments.report.grid import Field, markdown, terminal
from testbed.experiments.statistics import Cell, Change


def difference(mean, low, high):
    return Change(Interval(mean, low, high), NO_INTERVAL, Interval(0.75, 0.5, 1.0), 8, 20.0)


CELLS = (
    Cell("all", "old", "gospa", Interval(2.0, 1.5, 2.5), None),
    Cell("all", "new", "gospa", Interval(1.0, 0.75, 1.25), difference(-1.0, -1.5, -0.5)),
    Cell("all", "odd", "gospa", Interval(2.5, np.nan, np.nan), difference(0.5, -0.5, 1.5)),
    Cell("all", "old", "nees_position", Interval(2.5, 2.0, 3.0), None),
    Cell("all", "new", "nees_position", Interval(1.25, 1.0, 1.5), difference(0.25, 0.125, 0.375)),
)


def line(grid, name):
    return next(fields for n, fields in grid.lines if n == name)


def printed(table):
    console = Console(width=100, file=io.StringIO(), record=True)
    console.print(table)
    return [" ".join(text.split()) for text in console.export_text().splitlines() if text.strip()]


def test_the_best_and_what_is_resolved_are_marked():
    grid = tables.overview(CELLS, "old")
    assert grid.heads == ["GOSPA [m]", "NEES position"]
    assert [field.mark for field in line(grid, "old")] == ["", "best"]  # 2.5 is nearer to the ideal 2 than 1.25
    assert [field.mark for field in line(grid, "new")] == ["best better", "worse"]
    assert [field.mark for field in line(grid, "odd")] == ["", ""]
    assert line(grid, "new")[0].remark == "-1.000 better"
    assert line(grid, "odd") == [Field("2.50", remark="+0.500 unresolved"), Field("–")]


def test_shading_grows_from_the_best_of_a_scenario():
    found = [Cell("cut-in", name, "gospa", Interval(x, x, x), None) for name, x in (("a", 2.0), ("b", 3.0), ("c", 9.0))]
    (only,) = tables.by_scenario(found, "a").lines
    assert [field.heat for field in only.fields] == [0.0, 0.5, 1.0]
    assert [field.mark for field in only.fields] == ["best", "", ""]


def test_markdown_has_numbers_with_intervals_and_trackers_as_code():
    assert markdown(tables.overview(CELLS, "old")).splitlines() == [
        "| tracker | GOSPA [m] | NEES position |",
        "| --- | --- | --- |",
        "| `old` | 2.00 [1.50, 2.50] | 2.5 [2.0, 3.0] |",
        "| `new` | 1.00 [0.75, 1.25] | 1.2 [1.0, 1.5] |",
        "| `odd` | 2.50 | – |",
    ]


def test_columns_are_chosen_by_their_heads():
    grid = tables.differences(CELLS, "old").only("measure", "verdict")
    assert markdown(grid).splitlines()[2:] == [
        "| `new` | GOSPA [m] | better |",
        "| `odd` | GOSPA [m] | unresolved |",
        "| `new` | NEES position | worse |",
    ]


def test_a_terminal_shows_few_trackers_side_by_side_and_many_below_each_other():
    grid = tables.overview(CELLS, "old")
    assert printed(terminal(grid.transposed("measure"), "means", no_wrap=True))[3:] == [
        "GOSPA [m] 2.00 [1.50, 2.50] 1.00 [0.75, 1.25] 2.50",
        "NEES position 2.5 [2.0, 3.0] 1.2 [1.0, 1.5] –",
    ]
    assert printed(terminal(grid, "means", narrow=True))[3:] == [
        "old 2.00 2.5", "±0.50 ±0.5", "new 1.00 1.2", "±0.25 ±0.2", "odd 2.50 –"
    ]  # fmt: skip


def test_a_phase_without_a_measure_is_a_column_only_where_every_phase_is():
    found = [Cell(phase, "a", "gospa", Interval(1.0, 1.0, 1.0), None) for phase in ("during", "before")]
    assert tables.by_phase(found, "a").heads == ["before", "during"]
    grid = tables.by_phase(found, "a", every=True)
    assert grid.heads == ["before", "onset", "during", "after"]
    assert [field.text for field in line(grid, "a")] == ["1.00", "–", "1.00", "–"]

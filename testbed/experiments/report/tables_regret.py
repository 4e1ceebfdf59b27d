"""The tables of a study of regret as data, for the terminal, the report page and the documentation."""

from collections.abc import Sequence

from testbed.command_line.tables import number
from testbed.environment.sources.substitution import GROUP_NAMES, GROUPS
from testbed.evaluation.intervals import Interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.pairs import SCORE, Attribution, Cell, Correlation, WorstPair
from testbed.experiments.report.grid import Field, Grid, Line, mark_of, needed, signed
from testbed.experiments.report.texts import say


def overview(cells: Sequence[Cell], title: str) -> Grid:
    """Conditions down, planners across: the regret, which is positive where the reference drives better."""
    planners = list(dict.fromkeys(c.planner for c in cells))
    found = {(c.condition, c.planner): _regret(c) for c in cells if c.measure == SCORE}
    lines = [
        Line(name, [found.get((name, p), Field("")) for p in planners])
        for name in dict.fromkeys(c.condition for c in cells)
    ]
    return Grid(say("regret signed", title=title), "tracker", planners, lines)


def changes(cells: Sequence[Cell], title: str) -> Grid:
    """One line a condition, scenario and planner, the measures across: drive minus reference."""
    keys = list(dict.fromkeys(c.measure for c in cells))
    at = {(c.condition, c.scenario, c.planner, c.measure): c for c in cells}
    several = len({c.planner for c in cells}) > 1
    lines = []
    for condition, scenario, planner in dict.fromkeys((c.condition, c.scenario, c.planner) for c in cells):
        fields = [Field(scenario), *([Field(planner)] if several else [])]
        for key in keys:
            cell = at.get((condition, scenario, planner, key))
            fields.append(Field("") if cell is None else _change(cell))
        lines.append(Line(condition, fields))
    words = ["scenario", "planner"] if several else ["scenario"]
    return Grid(
        say("regret signed", title=title), "tracker", [*words, *(METRICS[k].title for k in keys)], lines, words=words
    )


def attribution(found: Sequence[Attribution]) -> Grid:
    """One line a tracker, scenario, planner and measure: the total and what each group of errors has of it."""
    lines = []
    for a in found:
        digits = METRICS[a.measure].digits
        fields = [Field(a.scenario), Field(a.planner), Field(METRICS[a.measure].title), Field(str(a.seeds))]
        fields += [signed(x, digits) for x in (a.total, *(a.share[g] for g in GROUPS))]
        repaired = " / ".join(f"{a.repaired[g].value:+.{digits}f}" for g in GROUPS)
        lines.append(Line(a.tracker, [*fields, Field(repaired)]))
    words = ("scenario", "planner", "measure")
    heads = [*words, "seeds", "total", *GROUP_NAMES.values(), "repaired E / G / V"]
    return Grid(say("attribution"), "tracker", heads, lines, words=words)


def correlation(found: Sequence[Correlation]) -> Grid:
    """Tracking errors down: how well each ranks the regret."""
    lines = [Line(METRICS[c.error].label, [Field(f"{c.rho:+.2f}"), Field(str(c.means))]) for c in found]
    return Grid(say("correlation"), "error", ["rank correlation", "means"], lines)


def worst(found: Sequence[WorstPair]) -> Grid:
    """The worst pair of every planner and tracker, and where it parts from the truth."""
    heads = ["planner", "scenario", "seed", "regret", "parts from the drive on the truth"]
    lines = []
    for w in found:
        fields = map(Field, (w.drive.planner, w.drive.scenario, str(w.drive.seed), number(w.regret, 3), w.parting))
        lines.append(Line(w.drive.condition, list(fields)))
    words = ("planner", "scenario", "parts from the drive on the truth")
    return Grid(say("worst pairs"), "tracker", heads, lines, words=words)


def _regret(cell: Cell) -> Field:
    v = cell.change.mean
    return _signed(cell, Interval(-v.value, -v.high, -v.low))


def _change(cell: Cell) -> Field:
    return Field("0") if cell.verdict == "the same" else _signed(cell, cell.change.mean)


def _signed(cell: Cell, found: Interval) -> Field:
    digits = METRICS[cell.measure].digits
    return signed(found, digits, needed(cell.change, cell.verdict), mark_of(cell.verdict))

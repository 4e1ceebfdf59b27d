"""Findings on the terminal, and the change of baselines as a list for a commit message."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from testbed.command_line.tables import light_table, number
from testbed.evaluation.intervals import mean_of_means
from testbed.evaluation.metric import METRICS
from testbed.regress.baselines import Baselines, Key
from testbed.regress.suite import TOLERANCES
from testbed.regress.verdict import Change

ROWS = 40  # of a table; there may be thousands of changes
NAMES = 4  # in a sentence


def moved(changes: Sequence[Change], title: str) -> Table:
    """Changes, the largest first, with what was allowed."""
    table = light_table(title)
    table.add_column("tracker, scenario")
    table.add_column("measure")
    for name in ("before", "now", "change", "allowed"):
        table.add_column(name, justify="right", no_wrap=True)
    for c in changes[:ROWS]:
        digits = METRICS[c.measure].digits + 1
        numbers = (number(c.before, digits), number(c.after, digits), _signed(c.change, digits))
        table.add_row(f"{c.tracker}, {c.scenario}", escape(METRICS[c.measure].title), *numbers, number(c.limit, digits))
    if len(changes) > ROWS:
        table.add_row(f"and {len(changes) - ROWS} more", *[""] * 5)
    return table


def cells(keys: Sequence[Key]) -> str:
    """Trackers and scenarios in a few words.

    >>> cells([("a", "x"), ("a", "y")])
    'a (x, y)'
    """
    by_tracker: dict[str, list[str]] = {}
    for tracker, scenario in keys:
        by_tracker.setdefault(tracker, []).append(scenario)
    return _few([f"{t} ({_few(c)})" for t, c in by_tracker.items()])


def update_list(old: Baselines, new: Baselines, dropped: Sequence[Key]) -> str:
    """What an update of baselines changed, as a short markdown list."""
    fresh = [key for key in new.values if key not in old.values]
    changed = [key for key in new.values if key in old.values and _differ(old.values[key], new.values[key])]
    lines = []
    if fresh:
        lines.append(f"- {len(fresh)} new: {cells(fresh)}")
    for tracker in dict.fromkeys(tracker for tracker, _ in changed):
        mine = [key for key in changed if key[0] == tracker]
        where = f"{len(mine)} of {sum(key[0] == tracker for key in new.values)} scenarios"
        lines.append(f"- {tracker}, changed in {where}; over these: {_means(old, new, mine)}")
    if dropped:
        lines.append(f"- {len(dropped)} dropped, in the catalogues no more: {cells(dropped)}")
    same = len(new.values) - len(fresh) - len(changed)
    return "\n".join([*lines, f"- {same} unchanged"] if same or not lines else lines)


def _means(old: Baselines, new: Baselines, keys: Sequence[Key]) -> str:
    """Mean of each measure that moved, before and after."""
    parts = []
    for measure in TOLERANCES:
        a, b = (_mean([baselines.values[key][measure] for key in keys]) for baselines in (old, new))
        digits = METRICS[measure].digits + 1
        before, after = f"{a:.{digits}f}", f"{b:.{digits}f}"
        if before != after:
            parts.append(f"{METRICS[measure].title} {before} -> {after}")
    return ", ".join(parts) or "less than the digits shown"


def _mean(groups: Iterable[NDArray]) -> float:
    known = [group[np.isfinite(group)] for group in groups]
    return float(mean_of_means(*[group for group in known if len(group)])) if any(map(len, known)) else np.nan


def _differ(a: Mapping[str, NDArray], b: Mapping[str, NDArray]) -> bool:
    return any(not np.array_equal(a[measure], b[measure], equal_nan=True) for measure in b)


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMES} more" if len(names) > NAMES else ""
    return ", ".join(names[:NAMES]) + more


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}f}" if np.isfinite(value) else "gone"

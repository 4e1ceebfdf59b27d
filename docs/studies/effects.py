"""What a factor varied in a study (a fault, a lifetime) changes for each tracker, and the committed runs that say so.

A table of runs has the columns scenario, the factor's, tracker, seed, and one a measure. Changes are against the
factor's usual value, paired by seed; scenarios are strata, and seeds the units that they have in common.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from testbed.command_line.terminal import console
from testbed.evaluation.intervals import Interval, crossed_interval
from testbed.experiments.report.texts import seeds_text
from testbed.files import make_directory
from testbed.log.text import markdown_table

DIGITS = 6  # significant, of the committed results


@dataclass(frozen=True)
class Factor:
    """What a study varies."""

    column: str  # of the table of runs
    usual: Any  # its value that the others are compared with
    label: Callable[[Any], str]  # of a value, in tables


class Effect(NamedTuple):
    """What one value of a factor does to one measure of one tracker."""

    mean: Interval  # with this value, over scenarios and seeds
    change: Interval  # against the usual value on the same seeds


def effect(table: pd.DataFrame, factor: Factor, value: Any, tracker: str, measure: str) -> Effect:
    """Mean and change of a measure."""
    found, usual = (_by_seed(table, factor.column, v, tracker, measure) for v in (value, factor.usual))
    return Effect(crossed_interval(found.to_numpy(float)), crossed_interval((found - usual).to_numpy(float)))


def _by_seed(table: pd.DataFrame, column: str, value: Any, tracker: str, measure: str) -> pd.DataFrame:
    """Values by scenario, in rows, and seed."""
    chosen = table[(table[column] == value) & (table["tracker"] == tracker)]
    return chosen.pivot(index="scenario", columns="seed", values=measure)


def names(table: pd.DataFrame, column: str) -> list[Any]:
    """Values of a column in the order in which they were run."""
    return list(dict.fromkeys(table[column]))


def effects_table(table: pd.DataFrame, factor: Factor, measure: str, digits: int) -> str:
    """The Markdown table of a measure: a row a value, and two columns a tracker, see `rows`."""
    trackers = names(table, "tracker")
    head = (factor.column, *(part for tracker in trackers for part in (f"`{tracker}`", "change")))
    return markdown_table(head, rows(table, factor, measure, digits))


def rows(table: pd.DataFrame, factor: Factor, measure: str, digits: int) -> list[tuple[str, ...]]:
    """A row a value; of each tracker the mean, and the change, bold where its interval leaves out zero."""
    found = []
    for value in names(table, factor.column):
        cells = [factor.label(value)]
        for tracker in names(table, "tracker"):
            mean, change = effect(table, factor, value, tracker, measure)
            cells += [spell(mean, digits), "" if value == factor.usual else _marked(change, digits)]
        found.append(tuple(cells))
    return found


def spell(interval: Interval, digits: int, sign: str = "") -> str:
    """A mean and its interval, where there is one."""
    bounds = (
        f" [{interval.low:{sign}.{digits}f}, {interval.high:{sign}.{digits}f}]" if np.isfinite(interval.low) else ""
    )
    return f"{interval.value:{sign}.{digits}f}{bounds}"


def _marked(change: Interval, digits: int) -> str:
    text = spell(change, digits, "+")
    return f"**{text}**" if change.low > 0 or change.high < 0 else text


def facts(table: pd.DataFrame) -> str:
    """How many runs, of which scenarios and seeds."""
    seeds = tuple(sorted(table["seed"].unique().tolist()))
    scenarios = ", ".join(f"`{name}`" for name in names(table, "scenario"))
    number = "1 seed" if len(seeds) == 1 else f"{len(seeds)} seeds"
    return f"{len(table)} runs in open loop: {scenarios}, {number} ({seeds_text(seeds)})"


def write_runs(table: pd.DataFrame, path: Path) -> None:
    """Write the committed runs into a directory, which is made, and print where."""
    make_directory(path.parent)
    table.to_csv(path, index=False, float_format=f"%.{DIGITS}g", lineterminator="\n")
    console.print(f"table    {path}", soft_wrap=True)


def read_runs(path: Path, remedy: str) -> pd.DataFrame:
    """The committed runs; ValueError with a remedy where there are none."""
    if not path.exists():
        raise ValueError(f"{path} is not there yet; {remedy}")
    return pd.read_csv(path, keep_default_na=False, na_values=[""])  # so that a fault called none stays a text

"""GOSPA and switches by fault and tracker: means with intervals, and changes against no fault, paired by seed."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sensors.fault_text import split_faults
from testbed.evaluation.intervals import Interval, bootstrap_interval

NONE = "none"  # in place of a fault
MEASURES = ("gospa", "switches")
COLUMNS = ("scenario", "fault", "tracker", "seed", *MEASURES)
DIGITS = 6  # significant, of the committed results


class Effect(NamedTuple):
    """What one fault does to one measure of one tracker."""

    mean: Interval  # with the fault, over scenarios and seeds
    change: Interval  # against no fault on the same seeds


def by_fault(runs: pd.DataFrame) -> pd.DataFrame:
    """One row a run with `COLUMNS`, from the runs of a comparison, whose scenarios read NAME+FAULT+FAULT."""
    parts = [split_faults(case) for case in runs["scenario"]]
    split = {"scenario": [name for name, _ in parts], "fault": ["+".join(faults) or NONE for _, faults in parts]}
    return runs.assign(**split)[list(COLUMNS)].reset_index(drop=True)


def effect(table: pd.DataFrame, fault: str, tracker: str, measure: str) -> Effect:
    """Mean and change of a measure; strata are the scenarios, their units the seeds."""
    found, usual = (_strata(table, text, tracker, measure) for text in (fault, NONE))
    return Effect(bootstrap_interval(found), bootstrap_interval([a - b for a, b in zip(found, usual, strict=True)]))


def _strata(table: pd.DataFrame, fault: str, tracker: str, measure: str) -> list[NDArray]:
    rows = table[(table["fault"] == fault) & (table["tracker"] == tracker)].sort_values("seed")
    return [group[measure].to_numpy(float) for _, group in rows.groupby("scenario", sort=True)]


def names(table: pd.DataFrame, column: str) -> list[str]:
    """Faults or trackers in the order in which they were compared."""
    return list(dict.fromkeys(table[column]))


def head(trackers: Sequence[str]) -> tuple[str, ...]:
    """The first line of the table of a measure."""
    return ("fault", *(part for tracker in trackers for part in (f"`{tracker}`", "change")))


def rows(table: pd.DataFrame, measure: str, digits: int) -> list[tuple[str, ...]]:
    """A row a fault; two columns a tracker: the mean, and the change, bold where its interval leaves out zero."""
    found = []
    for fault in names(table, "fault"):
        cells = [f"`{fault}`" if fault != NONE else fault]
        for tracker in names(table, "tracker"):
            mean, change = effect(table, fault, tracker, measure)
            cells += [spell(mean, digits), "" if fault == NONE else _marked(change, digits)]
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


def write(table: pd.DataFrame, path: Path) -> None:
    """Write the committed results."""
    table.to_csv(path, index=False, float_format=f"%.{DIGITS}g", lineterminator="\n")


def read(path: Path) -> pd.DataFrame:
    """The committed results; ValueError where there are none."""
    if not path.exists():
        raise ValueError(f"{path} is not there yet; give the folder of `testbed compare --out FOLDER`")
    return pd.read_csv(path, keep_default_na=False)

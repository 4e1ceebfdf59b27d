"""The committed results that new ones are compared with: one JSON file, written by `testbed regress --update` only.

`{"layout", "seeds", and each of `Settings`, "updates": [{"date", "versions"}, ...], "trackers": {NAME: {"overall":
{MEASURE: {"mean", "interval"}}, "scenarios": {NAME: {"update": its entry in updates, MEASURE: {"values": by seed, null
where nothing was measured, "mean", "interval"}}}}}}`. Only the values are read again; means and 95 % intervals are for
people: in a scenario from the spread between seeds pooled over scenarios, overall by the bootstrap over scenarios.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.intervals import bootstrap_interval, student_limit
from testbed.experiments.statistics import pooled_spread
from testbed.experiments.tolerated import TOLERANCES, Values
from testbed.files import write_atomic
from trackers.json_file import read_json

LAYOUT = 1
REMEDY = "make it anew with `testbed regress --update`"
DIGITS = 6  # significant ones, a thousandth of any tolerance

Key = tuple[str, str]  # tracker, scenario


class Update(NamedTuple):
    """One call that made baselines."""

    date: str  # ISO 8601, UTC
    versions: dict[str, str]


class Baselines(NamedTuple):
    """What was measured, and by which call."""

    values: dict[Key, dict[str, NDArray]]  # measure -> (seeds), NaN: not measured
    updates: dict[Key, Update]


NONE = Baselines({}, {})


def load(path: Path, conditions: Mapping[str, Any]) -> Baselines:
    """Read the baselines.

    Raises:
        OSError, ValueError: in one sentence, where there are none, or none of runs of these conditions.
    """
    try:
        found = read_json(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"baselines: {path} is not there; make it with `testbed regress --update`") from None
    except OSError as error:
        raise OSError(f"baselines: {error}") from None
    except ValueError as error:
        raise ValueError(f"baselines: {error}; {REMEDY}") from None
    layout = found.get("layout") if isinstance(found, dict) else None
    if layout != LAYOUT:
        raise ValueError(f"baselines: {path} has layout {layout!r}, not {LAYOUT}; {REMEDY}")
    try:
        return _parse(found, conditions)
    except _OtherSuite as error:
        raise ValueError(f"baselines: {path} {error}; {REMEDY}") from None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise ValueError(f"baselines: {path} is damaged ({type(error).__name__}: {error}); {REMEDY}") from None


def merge(old: Baselines, new: Values, update: Update, keep: Iterable[Key]) -> Baselines:
    """The new values in place of the old; of the other old ones those of `keep` stay."""
    kept = {key for key in keep if key in old.values and key not in new}
    rounded = {key: {m: np.array(_numbers(v), float) for m, v in measures.items()} for key, measures in new.items()}
    return Baselines(
        {**{key: old.values[key] for key in old.values if key in kept}, **rounded},
        {**{key: old.updates[key] for key in old.updates if key in kept}, **dict.fromkeys(rounded, update)},
    )


def save(baselines: Baselines, conditions: Mapping[str, Any], path: Path) -> None:
    """Write the baselines in the order of names, so that a diff of two files is short."""
    updates = sorted({(u.date, json.dumps(u.versions, sort_keys=True)) for u in baselines.updates.values()})
    trackers = sorted({tracker for tracker, _ in baselines.values})
    found = {
        "layout": LAYOUT,
        **conditions,
        "updates": [{"date": date, "versions": json.loads(text)} for date, text in updates],
        "trackers": {tracker: _tracker(baselines, tracker, updates) for tracker in trackers},
    }
    write_atomic(path, _text(found) + "\n")


class _OtherSuite(ValueError):
    """The file is valid, but of other runs."""


def _parse(found: dict[str, Any], conditions: Mapping[str, Any]) -> Baselines:
    for key, wanted in conditions.items():
        if found[key] != wanted:
            raise _OtherSuite(f"has {key} {found[key]}, the suite has {wanted}")
    baselines = Baselines({}, {})
    for tracker, entry in found["trackers"].items():
        for scenario, cell in entry["scenarios"].items():
            if set(cell) != {"update", *TOLERANCES}:
                raise _OtherSuite(f"has other measures for {tracker} in {scenario} than {', '.join(TOLERANCES)}")
            values = {measure: np.array(cell[measure]["values"], float) for measure in TOLERANCES}
            if any(v.shape != (len(conditions["seeds"]),) for v in values.values()):
                raise _OtherSuite(f"has not one value a seed for {tracker} in {scenario}")
            update = found["updates"][cell["update"]]
            baselines.values[tracker, scenario] = values
            baselines.updates[tracker, scenario] = Update(update["date"], dict(update["versions"]))
    return baselines


def _tracker(baselines: Baselines, tracker: str, updates: list[tuple[str, str]]) -> dict[str, Any]:
    keys = sorted(key for key in baselines.values if key[0] == tracker)
    samples = {m: [_known(baselines.values[key][m]) for key in keys] for m in TOLERANCES}
    spreads = {m: pooled_spread(sample) for m, sample in samples.items()}
    cells: dict[str, dict[str, Any]] = {}
    for k, key in enumerate(keys):
        made = baselines.updates[key]
        cell: dict[str, Any] = {"update": updates.index((made.date, json.dumps(made.versions, sort_keys=True)))}
        for measure, values in baselines.values[key].items():
            mean, limits = _estimate(samples[measure][k], *spreads[measure])
            cell[measure] = {"values": _numbers(values), "mean": mean, "interval": limits}
        cells[key[1]] = cell
    return {"overall": {m: _overall(sample) for m, sample in samples.items()}, "scenarios": cells}


def _overall(sample: list[NDArray]) -> dict[str, Any]:
    found = bootstrap_interval([np.array([group.mean() for group in sample if len(group)])])
    mean, *limits = _numbers(np.array(found))
    return {"mean": mean, "interval": None if None in limits else limits}


def _estimate(values: NDArray, spread: float, dof: int) -> tuple[float | None, list[float | None] | None]:
    if not len(values):
        return None, None
    mean = values.mean()
    half = float(student_limit(spread, dof, len(values)))
    return _numbers(mean[None])[0], _numbers(np.array([mean - half, mean + half])) if dof else None


def _known(values: NDArray) -> NDArray:
    return values[np.isfinite(values)]


def _numbers(values: NDArray) -> list[float | None]:
    """Rounded, None for NaN."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


def _text(found: Any, indent: str = "") -> str:
    """JSON with a line for each measure: objects that hold no objects are not split over lines."""
    if not isinstance(found, dict) or not any(isinstance(value, dict) for value in found.values()):
        return json.dumps(found, allow_nan=False)
    inner = indent + " "
    lines = [f"{inner}{json.dumps(key)}: {_text(value, inner)}" for key, value in found.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"

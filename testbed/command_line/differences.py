"""`testbed diff`: two logs step by step, or two results key by key."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from testbed.command_line.tables import filled_table, metrics
from testbed.log.difference import Difference, compare_logs
from trackers.json_file import read_json

APART = ("timing", "made", "run.versions", "interrupted")  # of results: say nothing about what happened
NOTHING = "nothing"  # for what results do not have
SHOWN = 30  # keys of results in the table


def show(first: Path, second: Path, console: Console) -> int:
    """Print what differs; returns the exit status, 0 for nothing and 1 for something.

    Raises OSError or ValueError, in one sentence, for files that cannot be read or are not of one kind.
    """
    kinds = {first.suffix.lower(), second.suffix.lower()}
    if kinds == {".rrd"}:
        found = compare_logs(first, second)
        results = [path.with_suffix(".json") for path in (first, second)]
        there = all(path.is_file() for path in results)
        beside = there and _beside(_read(results[0]), _read(results[1]), console)
        return _show_logs(found, console, brief=beside)
    if kinds == {".json"}:
        one, other = _read(first), _read(second)
        if _beside(one, other, console):
            return _show_results([row for row in compare_results(one, other) if NOTHING not in row[1:]], console)
        return _show_results(compare_results(one, other), console)
    raise ValueError(f"diff takes two logs (.rrd) or two results (.json), got {first} and {second}")


def _beside(one: Any, other: Any, console: Console) -> bool:
    """Print the measures of other trackers, or other planners, side by side; whether there are such."""
    runs = [found.get("run", {}) for found in (one, other)]
    trackers = [found.get("trackers", {}) for found in (one, other)]
    if not (all(trackers) and (list(trackers[0]) != list(trackers[1]) or runs[0]["planner"] != runs[1]["planner"])):
        return False
    shared = {*trackers[0]} & {*trackers[1]}
    both: dict[str, Any] = {"trackers": {}, "timing": {"trackers": {}}, "run": runs[0]}
    for found, run in zip((one, other), runs):
        for name, row in found["trackers"].items():
            called = f"{name}, {run['planner']}" if name in shared else name
            called = f"{called}, second" if called in both["trackers"] else called
            both["trackers"][called] = row
            both["timing"]["trackers"][called] = found["timing"]["trackers"][name]
    same = runs[0]["scenario"] == runs[1]["scenario"]
    title = runs[0]["scenario"] if same else f"{runs[0]['scenario']} and {runs[1]['scenario']}"
    console.print(metrics(both, title))
    return True


def compare_results(first: Any, second: Any) -> list[tuple[str, Any, Any]]:
    """Key, value in the first and in the second results, of all that differ, those far apart first.

    What only one of them has, such as all of a tracker, is one row: `NOTHING` and the number of its values.
    """
    a, b = dict(_leaves(first)), dict(_leaves(second))
    keys = [key for key in dict.fromkeys([*a, *b]) if not key.startswith(APART)]
    found: list[tuple[str, Any, Any]] = [(key, what, NOTHING) for key, what in _only(a, b, keys)]
    found += [(key, NOTHING, what) for key, what in _only(b, a, keys)]
    found += [(key, a[key], b[key]) for key in keys if key in a and key in b and a[key] != b[key]]
    return sorted(found, key=lambda row: -_apart(row[1], row[2]))


def _only(a: dict[str, Any], b: dict[str, Any], keys: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Shortest beginnings of keys that `b` has nothing of, and the value in `a`, or how many there are."""
    known = {start for key in b for start in _starts(key)}
    alone = [key for key in keys if key in a and key not in b]
    below: dict[str, list[str]] = {}
    for key in alone:
        below.setdefault(next((start for start in _starts(key) if start not in known), key), []).append(key)
    for start, found in below.items():
        yield (found[0], a[found[0]]) if len(found) == 1 else (start, f"{len(found)} values")


def _starts(key: str) -> list[str]:
    """Beginnings of a dotted key, the shortest first."""
    parts = key.split(".")
    return [".".join(parts[:n]) for n in range(1, len(parts) + 1)]


def _apart(x: Any, y: Any) -> float:
    """Relative difference, infinite between other things than numbers."""
    if isinstance(x, int | float) and isinstance(y, int | float):
        return abs(x - y) / max(abs(x), abs(y), 1e-12)
    return float("inf")


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted key and value of everything that is no list or object; rows are named by what they are about."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        for n, inner in enumerate(value):
            about = [str(n + 1)]
            if isinstance(inner, dict) and key in ("objects", "phases", "orphans"):
                about = [str(inner[k]) for k in ("tracker", "object", "phase", "track") if k in inner]
            yield from _leaves(inner, f"{key}.{'.'.join(about)}")
    else:
        yield key, value


def _read(path: Path) -> Any:
    try:
        found = read_json(path)
    except OSError as error:
        raise OSError(f"cannot read {path}: {error.strerror or error}") from None
    if not isinstance(found, dict) or "run" not in found:
        raise ValueError(f"{path} holds no results of a run; give the .json that `testbed run` writes")
    return found


def _show_logs(found: Difference, console: Console, brief: bool = False) -> int:
    if found.settings:
        settings = ("setting", "first", "second")
        console.print(filled_table("settings that differ", settings, found.settings, settings, overflow="fold"))
    if not found.partings:
        console.print(f"the runs are equal: {found.steps} steps, {found.time:.2f} s", highlight=False)
        return 0
    start = found.partings[0]
    console.print(
        f"the runs part at step {start.step}, {start.time:.2f} s: {start.what}", highlight=False, markup=False
    )
    if brief:  # the measures stand above
        console.print(f"there: {start.difference}", highlight=False, markup=False)
        return 1
    heads, words = ("what", "step", "time [s]", "first / second"), ("what", "first / second")
    rows = [(p.what, str(p.step), f"{p.time:.2f}", p.difference) for p in found.partings]
    title = "what parts when, and by how much at that step"
    console.print(filled_table(title, heads, rows, words, overflow="fold"))
    return 1


def _show_results(found: list[tuple[str, Any, Any]], console: Console) -> int:
    if not found:
        console.print("the results are equal, but for what they took")
        return 0
    more = f", the first {SHOWN}" if len(found) > SHOWN else ""
    title = f"{len(found)} values differ{more}; the logs say at which step the runs part"
    heads = ("key", "first", "second")
    rows = [[f"{v:.6g}" if isinstance(v, float) else str(v) for v in row] for row in found[:SHOWN]]
    console.print(filled_table(title, heads, rows, heads, overflow="fold"))
    return 1

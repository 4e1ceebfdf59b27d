"""The comparison that a folder of `testbed compare` holds, for pages that are made from all of its rows."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from scenarios import SCENARIOS
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.rows import SCHEMA
from testbed.experiments.store import ROWS, Store, read_meta
from testbed.frame import TRUTH
from trackers import TRACKERS
from trackers.lookup import parse

KEY = ("scenario", "tracker", "seed")  # of a run


def stored_comparison(folder: Path) -> Comparison:
    """All runs that lie in a folder, as the comparison that made them.

    Raises ValueError where the folder holds none, or not all runs of a product of scenarios, trackers and seeds.
    """
    settings = settings_of(folder)
    made = {_named(read_meta(path, SCHEMA)["run"]) for path in sorted((folder / ROWS).glob("*.parquet"))}
    if not made:
        raise ValueError(f"out: {folder} holds no finished run; run `testbed compare --out {folder}` first")
    found = [_in_order([names[k] for names in made], what) for k, what in enumerate(KEY)]
    comparison = Comparison(found[0], found[1], found[2], settings, out=str(folder))
    missing = [run for run in comparison.work() if _named(run.key) not in made]
    if missing:
        raise ValueError(f"out: {folder} lacks {len(missing)} runs, {missing[0].name} among them; finish it first")
    return comparison


def settings_of(folder: Path) -> Settings:
    """The settings that a folder was made with; ValueError where it holds no comparison."""
    known = Store(Comparison((TRUTH,), (TRUTH,), (0,), out=str(folder))).about()
    if known.get("study") != Comparison.name:
        raise ValueError(f"out: {folder} holds no comparison; make one with `testbed compare --out {folder}`")
    return Settings(**{f.name: known[f.name] for f in fields(Settings)})


def _named(key: dict[str, Any]) -> tuple[str, str, int]:
    """Scenario with its faults, tracker and seed of a run."""
    return "+".join([key["scenario"], *key["faults"]]), key["source"], key["seed"]


def _in_order(values: Sequence[Any], what: str) -> tuple[Any, ...]:
    """Distinct values; names in the order of the catalogues."""
    catalogue = {"scenario": list(SCENARIOS), "tracker": list(TRACKERS)}.get(what)
    distinct = sorted(set(values))
    if catalogue is None:
        return tuple(distinct)
    return tuple(sorted(distinct, key=lambda name: (catalogue.index(parse(name.split("+")[0])[0]), name)))

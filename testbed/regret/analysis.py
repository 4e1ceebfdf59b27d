"""Paired differences of drives, their attribution, and what the seeds can resolve."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import spearmanr

from testbed.compare.runs.rows import content
from testbed.compare.statistics.differences import PairedDifference, needed
from testbed.evaluation.intervals import NO_INTERVAL, Interval, bootstrap_interval, measured
from testbed.frame import TRUTH
from testbed.regret.conditions import IN_VIEW
from testbed.regret.measures import BOTH_SIDES, KEYS, MEASURES, PAIRED, TRACKING
from testbed.regret.pairs import Parting, difference, paired, parting
from testbed.regret.results import Drive, Results
from testbed.regret.shapley import shapley
from testbed.regret.study import Task
from testbed.regret.substitution import GROUPS, subsets

ALL = "all"  # scenarios together


class Pairs(NamedTuple):
    """Differences of drives to the drives of a reference condition, on the same seeds."""

    reference: str
    table: pd.DataFrame  # scenario, planner, condition, seed, and every measure of `measures`: drive minus reference


class Cell(NamedTuple):
    """One measure of one condition with one planner, compared with the reference."""

    scenario: str  # or `ALL`
    planner: str
    condition: str
    measure: str
    change: PairedDifference  # drive minus reference in the unit of the measure

    @property
    def verdict(self) -> str:
        """Better or worse than the reference, the same, or what the seeds cannot resolve."""
        found = self.change.verdict  # on the scale of the measure itself: "better" means less
        if found in ("better", "worse") and KEYS[self.measure].better > 0:
            return {"better": "worse", "worse": "better"}[found]
        return found


def pairs(results: Results, reference: str, conditions: Sequence[str]) -> Pairs:
    """All pairs of a reference condition that have both drives."""
    rows = []
    for task, drive in results.drives.items():
        other = results.drives.get(task._replace(condition=reference))
        if task.condition not in conditions or other is None:
            continue
        both = results.curves(task), results.curves(other.task)
        rows.append({**task._asdict(), **difference(drive, other), **paired(*both, drive, other)})
    columns = [*Task._fields, *(m.key for m in (*MEASURES, *PAIRED))]
    return Pairs(reference, pd.DataFrame(rows, columns=columns))


def cells(found: Pairs, scenarios: Sequence[str], measures: Sequence[str], together: bool = False) -> Iterator[Cell]:
    """Changes by scenario, or over all scenarios together, each a stratum of its own."""
    groups = [(ALL, scenarios)] if together else [(s, (s,)) for s in scenarios]
    table = found.table
    for (planner, condition), part in table.groupby(["planner", "condition"], sort=False):
        for name, within in groups:
            strata = [part[part["scenario"] == s] for s in within]
            for key in measures:
                values = [stratum[key].to_numpy(float) for stratum in strata]
                if any(len(v) for v in values):
                    yield Cell(name, planner, condition, key, change(values))


def change(values: Sequence[NDArray]) -> PairedDifference:
    """Mean change with its interval, and nothing else; values: drive minus reference, one array a scenario."""
    d = measured(values)
    mean = bootstrap_interval(d)
    return PairedDifference(mean, NO_INTERVAL, NO_INTERVAL, sum(map(len, d)), needed(d, mean))


class Attribution(NamedTuple):
    """What the groups of errors of a tracker change in one measure against what is in view."""

    scenario: str
    planner: str
    tracker: str
    measure: str
    seeds: int  # with all eight drives
    total: Interval
    share: dict[str, Interval]  # by group, (RGT.8)
    repaired: dict[str, Interval]  # change of the tracker's drive when one group is made perfect


def attributions(results: Results, measures: Sequence[str]) -> Iterator[Attribution]:
    """The attribution of every tracker that was driven with groups of errors."""
    study = results.study
    for scenario in study.scenarios:
        for planner in study.planners:
            for tracker in study.attributed:
                drives = _subset_drives(results, scenario, planner, tracker)
                for key in measures if drives else ():
                    yield _attribution(scenario, planner, tracker, key, drives)


def _subset_drives(results: Results, scenario: str, planner: str, tracker: str) -> list[dict[str, Drive]]:
    """For each seed the drives of all subsets; seeds that lack one are left out."""
    names = {subset: f"{tracker}:{subset}" for subset in subsets()} | {"": IN_VIEW, GROUPS: tracker}
    found = []
    for seed in results.study.seeds:
        tasks = {subset: Task(scenario, planner, name, seed) for subset, name in names.items()}
        if all(task in results.drives for task in tasks.values()):
            found.append({subset: results.drives[task] for subset, task in tasks.items()})
    return found


def _attribution(
    scenario: str, planner: str, tracker: str, measure: str, drives: Sequence[dict[str, Drive]]
) -> Attribution:
    values = {s: np.array([float(d[s].measures[measure]) for d in drives]) for s in subsets()}
    share = {g: bootstrap_interval([v]) for g, v in shapley(values).items()}
    without = {g: GROUPS.replace(g, "") for g in GROUPS}
    repaired = {g: bootstrap_interval([values[rest] - values[GROUPS]]) for g, rest in without.items()}
    total = bootstrap_interval([values[GROUPS] - values[""]])
    return Attribution(scenario, planner, tracker, measure, len(drives), total, share, repaired)


def self_test(results: Results) -> dict[Task, bool]:
    """Whether drives with all groups taken from the tracker are the tracker's own drives, bit for bit."""
    found = {}
    for task in results.drives:
        base, colon, groups = task.condition.rpartition(":")
        own = task._replace(condition=base)
        if colon and groups == GROUPS and own in results.drives:
            found[task] = content(results.curves(task).table()) == content(results.curves(own).table())
    return found


class Correlation(NamedTuple):
    """Whether a tracking error goes with regret, over the drives of all trackers."""

    error: str  # key of `measures.TRACKING`
    rho: float  # Spearman's rank correlation with the regret J over means of (scenario, planner, tracker)
    means: int


def error_and_regret(results: Results, found: Pairs) -> pd.DataFrame:
    """One row a scenario, planner and tracker: mean regret J [s] and mean tracking errors, over the seeds."""
    keys = ["scenario", "planner", "condition"]
    regret = (-found.table.set_index([*keys, "seed"])["J"]).rename("regret")
    errors = results.table.set_index([*keys, "seed"])
    errors = errors[[key for key in TRACKING if key in errors]].astype(float)
    return regret.to_frame().join(errors, how="inner").groupby(keys, sort=False).mean().reset_index()


def correlations(table: pd.DataFrame) -> list[Correlation]:
    """Spearman's rank correlation of every tracking error with the regret, the strongest first."""
    found = []
    for key in TRACKING:
        if key not in table:
            continue
        known = table[[key, "regret"]].dropna()
        if len(known) > 3 and known[key].nunique() > 1 and known["regret"].nunique() > 1:
            found.append(Correlation(key, float(spearmanr(known[key], known["regret"]).statistic), len(known)))
    return sorted(found, key=lambda c: -abs(c.rho))


class WorstPair(NamedTuple):
    """The drive of a tracker that lost most against the truth."""

    task: Task
    regret: float  # [s]
    parting: Parting | None


def worst_pairs(results: Results, found: Pairs) -> list[WorstPair]:
    """For each planner and tracker the pair with the largest regret J against the truth."""
    worst = []
    for _, part in found.table.groupby(["planner", "condition"], sort=False):
        if part["J"].notna().any():
            row = part.loc[part["J"].idxmin()]
            task = Task(row["scenario"], row["planner"], row["condition"], int(row["seed"]))
            other = task._replace(condition=found.reference)
            where = parting(results.curves(task), results.curves(other), results.drives[task], results.drives[other])
            worst.append(WorstPair(task, -float(row["J"]), where))
    return worst


def one_sided(found: Sequence[Cell]) -> list[str]:
    """Sentences about conditions that look safer than the reference and pay with progress, or the other way round."""
    by_key = {(c.scenario, c.planner, c.condition, c.measure): c for c in found}
    risk, loss = BOTH_SIDES
    sentences = []
    for (scenario, planner, condition, measure), cell in by_key.items():
        other = by_key.get((scenario, planner, condition, loss))
        if measure != risk or other is None or {cell.verdict, other.verdict} != {"better", "worse"}:
            continue
        a, b = (f"{KEYS[c.measure].label} {c.change.mean.value:+.3g} {KEYS[c.measure].unit}" for c in (cell, other))
        how = "looks safer and pays with progress" if cell.verdict == "better" else "gains progress at a risk"
        sentences.append(f"{condition}, {planner}, {scenario}: {how} ({a}, {b})")
    return sentences


def unresolved(found: Sequence[Cell]) -> list[str]:
    """One sentence for each change that the seeds cannot resolve, with how many it would take."""
    sentences = []
    for cell in found:
        d, label = cell.change, KEYS[cell.measure].label
        where = f"{cell.condition}, {cell.planner}, {cell.scenario}, {label}"
        if cell.verdict == "too few seeds":
            sentences.append(f"{where}: {d.pairs} seeds are too few for an interval")
        elif cell.verdict == "unresolved":
            seeds = f"about {d.needed:.0f} seeds would" if np.isfinite(d.needed) else "no number of seeds will"
            sentences.append(f"{where}: {d.mean.value:+.3g} is not resolved; {seeds} resolve it")
    return sentences


def references(results: Results) -> dict[str, Pairs]:
    """All pairs against the truth ("total"), against what is in view ("tracking"), and in-view against the truth."""
    study = results.study
    tracked = (*study.trackers, *study.injected)
    return {
        "total": pairs(results, TRUTH, tracked),
        "tracking": pairs(results, IN_VIEW, tracked),
        "sensing": pairs(results, TRUTH, (IN_VIEW,)),
    }

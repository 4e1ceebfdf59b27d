"""Paired differences of drives, their attribution, and what the seeds can resolve."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from testbed.compare.statistics.differences import PairedDifference, needed
from testbed.environment.sources.conditions import IN_VIEW
from testbed.environment.sources.substitution import EXISTENCE, GROUPS, subsets
from testbed.evaluation.intervals import NO_INTERVAL, Interval, bootstrap_interval, crossed_interval, measured
from testbed.evaluation.metric import METRICS
from testbed.experiments.rows import content
from testbed.regret.results import Results
from testbed.regret.shapley import shapley
from testbed.regret.study import Task

ALL = "all"  # scenarios together
BOTH_SIDES = ("tit", "progress")  # the metric of risk and that of loss that tell trackers apart with the fewest seeds
TRACKING = (  # errors of the tracker in its own drive
    "gospa", "rmse_position", "rmse_velocity", "rmse_length", "birth_delay", "missed_percent",
)  # fmt: skip


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
        if found in ("better", "worse") and METRICS[self.measure].better > 0:
            return {"better": "worse", "worse": "better"}[found]
        return found


def cells(pairs: pd.DataFrame, measures: Sequence[str], together: bool = False) -> Iterator[Cell]:
    """Changes by scenario, or over all scenarios together, each a stratum of its own; `pairs` have one reference."""
    scenarios = tuple(pairs["scenario"].unique())
    groups = [(ALL, scenarios)] if together else [(s, (s,)) for s in scenarios]
    for (planner, condition), part in pairs.groupby(["planner", "condition"], sort=False):
        for name, within in groups:
            for key in measures:
                table = part.pivot(index="scenario", columns="seed", values=key).reindex(within).to_numpy(float)
                if np.isfinite(table).any():
                    yield Cell(name, planner, condition, key, change(list(table)))


def change(values: Sequence[NDArray]) -> PairedDifference:
    """Mean change with its interval, and nothing else; values: drive minus reference, a scenario each, by seed."""
    d = measured(values)
    mean = crossed_interval(values)
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


def attributions(drives: pd.DataFrame, measures: Sequence[str]) -> Iterator[Attribution]:
    """The attribution of every tracker that was driven with groups of errors, over the seeds with all eight drives."""
    trackers = [c.removesuffix(f":{EXISTENCE}") for c in drives["condition"].unique() if c.endswith(f":{EXISTENCE}")]
    for (scenario, planner), part in drives.groupby(["scenario", "planner"], sort=False):
        for tracker in trackers:
            names = {subset: f"{tracker}:{subset}" for subset in subsets()} | {"": IN_VIEW, GROUPS: tracker}
            for key in measures:
                table = part.pivot_table(index="seed", columns="condition", values=key)
                if set(names.values()) <= set(table.columns):
                    known = table[list(names.values())].dropna()
                    values = {subset: known[name].to_numpy() for subset, name in names.items()}
                    yield _attribution(scenario, planner, tracker, key, values)


def _attribution(scenario: str, planner: str, tracker: str, key: str, values: dict[str, NDArray]) -> Attribution:
    share = {g: bootstrap_interval([v]) for g, v in shapley(values).items()}
    repaired = {g: bootstrap_interval([values[GROUPS.replace(g, "")] - values[GROUPS]]) for g in GROUPS}
    total = bootstrap_interval([values[GROUPS] - values[""]])
    return Attribution(scenario, planner, tracker, key, len(values[""]), total, share, repaired)


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
    """Whether the trackers that have more of an error also have more regret, in the same scenario with one planner."""

    error: str  # key in `TRACKING`
    rho: float  # rank correlation within scenarios and planners
    means: int  # that it rests on, each of one tracker in one scenario with one planner


def error_and_regret(drives: pd.DataFrame, pairs: pd.DataFrame) -> pd.DataFrame:
    """One row a scenario, planner and tracker: mean regret [s] and mean tracking errors, over the seeds."""
    keys = ["scenario", "planner", "condition"]
    regret = (-pairs.set_index([*keys, "seed"])["drive_score"]).rename("regret")
    errors = drives.set_index([*keys, "seed"])
    errors = errors[[key for key in TRACKING if key in errors]].astype(float)
    joined = regret.to_frame().join(errors, how="inner").dropna(how="all", subset=list(errors.columns))
    return joined.groupby(keys, sort=False).mean().reset_index()


def correlations(table: pd.DataFrame) -> list[Correlation]:
    """Rank correlation of every tracking error with the regret, the strongest first; table: of `error_and_regret`.

    Spearman's, with ranks among the trackers of one scenario and planner: what makes a scenario hard does not count.
    """
    found = []
    for key in TRACKING:
        if key not in table:
            continue
        known = table[["scenario", "planner", key, "regret"]].dropna()
        ranks = known.groupby(["scenario", "planner"])[[key, "regret"]].rank()
        centred = ranks - ranks.groupby([known["scenario"], known["planner"]]).transform("mean")
        a, b = centred[key].to_numpy(), centred["regret"].to_numpy()
        scale = float(np.sqrt((a @ a) * (b @ b)))
        if len(known) > 3 and scale > 0:
            found.append(Correlation(key, float(a @ b) / scale, len(known)))
    return sorted(found, key=lambda c: -abs(c.rho))


class WorstPair(NamedTuple):
    """The drive of a tracker that lost most against the reference."""

    task: Task
    regret: float  # [s]
    parted: float  # [s] when it parts from the drive on the reference, NaN for never
    parting: str  # the same in words


def worst_pairs(pairs: pd.DataFrame) -> list[WorstPair]:
    """For each planner and tracker the pair with the largest regret; `pairs` have one reference."""
    worst = []
    for _, part in pairs.groupby(["planner", "condition"], sort=False):
        if part["drive_score"].notna().any():
            row = part.loc[part["drive_score"].idxmin()]
            task = Task(row["scenario"], row["planner"], row["condition"], int(row["seed"]))
            worst.append(WorstPair(task, -float(row["drive_score"]), float(row["parted"]), row["parting"]))
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
        a, b = (
            f"{METRICS[c.measure].label} {c.change.mean.value:+.3g} {METRICS[c.measure].unit}" for c in (cell, other)
        )
        how = "looks safer and pays with progress" if cell.verdict == "better" else "gains progress at a risk"
        sentences.append(f"{condition}, {planner}, {scenario}: {how} ({a}, {b})")
    return sentences


def unresolved(found: Sequence[Cell]) -> list[str]:
    """One sentence for each change that the seeds cannot resolve, with how many it would take."""
    sentences = []
    for cell in found:
        d, label = cell.change, METRICS[cell.measure].label
        where = f"{cell.condition}, {cell.planner}, {cell.scenario}, {label}"
        if cell.verdict == "too few seeds":
            sentences.append(f"{where}: {d.pairs} seeds are too few for an interval")
        elif cell.verdict == "unresolved":
            seeds = f"about {d.needed:.0f} seeds would" if np.isfinite(d.needed) else "no number of seeds will"
            sentences.append(f"{where}: {d.mean.value:+.3g} is not resolved; {seeds} resolve it")
    return sentences


def compared_with(pairs: pd.DataFrame, reference: str, sensing: bool = False) -> pd.DataFrame:
    """The pairs of one reference: of trackers and injected errors, or, for `sensing`, of what is in view."""
    wanted = (pairs["condition"] == IN_VIEW) if sensing else (pairs["condition"] != IN_VIEW)
    return pairs[(pairs["reference"] == reference) & wanted]

"""Two drives of one seed side by side: how they differ, where they part, and what that says over the seeds."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from testbed.environment.sources.conditions import IN_VIEW, parse
from testbed.environment.sources.substitution import EXISTENCE, GROUPS, subsets
from testbed.evaluation.driving import SAME, Driven, changed_decisions
from testbed.evaluation.intervals import NO_INTERVAL, Interval, bootstrap_interval, crossed_interval, measured
from testbed.evaluation.metric import DRIVES, METRICS, keys, values
from testbed.experiments.drives import Curves
from testbed.experiments.run import Run
from testbed.experiments.statistics import Change, needed, shapley
from testbed.experiments.store import Results
from testbed.files import file_stem
from testbed.frame import TRUTH

ALL = "all"  # scenarios together
TRACKING = (  # errors of the tracker in its own drive
    "gospa", "rmse_position", "rmse_velocity", "rmse_length", "birth_delay", "missed_percent",
)  # fmt: skip
HARD = 2.0  # [m/s^2] braking that counts as an event
AFTER = 3.0  # [s] within which the other drive brakes for the same reason
SCORE = "score"  # the measure that leads
MEASURES = (  # of each drive, of which a pair has the difference
    "drive_value", "collisions", "drac_max", "tit", "ttc_min", "headway_min", "progress", "deceleration_max", "jerk",
)  # fmt: skip
Meta = Mapping[str, Any]  # what the file of a drive says beside its curves


class Drive(NamedTuple):
    """What names a drive in tables."""

    scenario: str
    planner: str
    condition: str  # what the planner gets, as in `environment.sources.conditions`
    seed: int

    @property
    def name(self) -> str:
        """Stem of the files about it."""
        return file_stem(self.scenario, self.planner, self.condition, f"seed{self.seed}")


KEY = Drive._fields


def key_of(run: Run) -> Drive:
    """What names a run in tables."""
    return Drive(run.scenario, run.planner, run.condition, run.seed)


class Cell(NamedTuple):
    """One measure of one condition with one planner, compared with the reference."""

    scenario: str  # or `ALL`
    planner: str
    condition: str
    measure: str
    change: Change  # drive minus reference in the unit of the measure

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


def change(values: Sequence[NDArray]) -> Change:
    """Mean change with its interval, and nothing else; values: drive minus reference, a scenario each, by seed."""
    d = measured(values)
    mean = crossed_interval(values)
    return Change(mean, NO_INTERVAL, NO_INTERVAL, sum(map(len, d)), needed(d, mean))


def scored(drives: pd.DataFrame, pairs: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables of drives and of pairs with the score; of a pair its difference. NaN without a drive on the truth."""
    key = ["scenario", "planner", "seed"]
    aims = drives[drives["condition"] == TRUTH].set_index(key)["progress"].rename("aim")
    aim = drives.join(aims, on=key)["aim"].to_numpy(float)
    drives = drives.assign(**{SCORE: METRICS[SCORE].compute(drives, aim)})
    scores = drives.set_index([*KEY])[SCORE]
    own, beside = (
        pd.MultiIndex.from_frame(pairs[[*KEY]].assign(condition=pairs[name])) for name in ("condition", "reference")
    )
    difference = scores.reindex(own).to_numpy() - scores.reindex(beside).to_numpy()
    return drives, pairs.assign(**{SCORE: difference})


def against(drives: pd.DataFrame, tracker: str) -> pd.DataFrame:
    """Drives on other trackers minus those on one of them, of the same scenario, planner and seed, in the score."""
    key = ["scenario", "planner", "seed"]
    base = drives[drives["condition"] == tracker].set_index(key)[SCORE].rename("base")
    others = drives[~drives["condition"].isin((TRUTH, IN_VIEW, tracker))].join(base, on=key)
    return others[[*KEY]].assign(**{SCORE: others[SCORE] - others["base"]})


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


def self_test(results: Results) -> dict[Drive, bool]:
    """Whether drives with all groups taken from the tracker are the tracker's own drives, bit for bit."""
    found = {}
    for run in results.metas:
        base, colon, groups = run.source.rpartition(":")
        own = replace(run, source=base) if colon else run
        if colon and groups == GROUPS and own in results.metas:
            found[key_of(run)] = results.metas[run]["content"] == results.metas[own]["content"]
    return found


class Correlation(NamedTuple):
    """Whether the trackers that have more of an error also have more regret, in the same scenario with one planner."""

    error: str  # key in `TRACKING`
    rho: float  # rank correlation within scenarios and planners
    means: int  # that it rests on, each of one tracker in one scenario with one planner


def error_and_regret(drives: pd.DataFrame, pairs: pd.DataFrame) -> pd.DataFrame:
    """One row a scenario, planner and tracker: mean regret and mean tracking errors, over the seeds."""
    keys = ["scenario", "planner", "condition"]
    regret = (-pairs.set_index([*keys, "seed"])[SCORE]).rename("regret")
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

    drive: Drive
    regret: float  # of the score
    parted: float  # [s] when it parts from the drive on the reference, NaN for never
    parting: str  # the same in words

    @property
    def name(self) -> str:
        """That of the drive."""
        return self.drive.name


def worst_pairs(pairs: pd.DataFrame) -> list[WorstPair]:
    """For each planner and tracker the pair with the largest regret; `pairs` have one reference."""
    worst = []
    for _, part in pairs.groupby(["planner", "condition"], sort=False):
        if part[SCORE].notna().any():
            row = part.loc[part[SCORE].idxmin()]
            drive = Drive(row["scenario"], row["planner"], row["condition"], int(row["seed"]))
            worst.append(WorstPair(drive, -float(row[SCORE]), float(row["parted"]), row["parting"]))
    return worst


def compared_with(pairs: pd.DataFrame, reference: str, sensing: bool = False) -> pd.DataFrame:
    """The pairs of one reference: of trackers and injected errors, or, for `sensing`, of what is in view."""
    wanted = (pairs["condition"] == IN_VIEW) if sensing else (pairs["condition"] != IN_VIEW)
    return pairs[(pairs["reference"] == reference) & wanted]


class Parting(NamedTuple):
    """Where two drives part: the first decision that differs."""

    time: float  # [s]
    action: str  # of the drive
    other: str  # of the one that it is compared with
    cause: str  # the largest difference between tracks and truth then

    def __str__(self) -> str:
        return f"at {self.time:.1f} s {self.action} instead of {self.other}; {self.cause}"


def parting(curves: Curves, others: Curves, drive: Meta, other: Meta) -> Parting | None:
    """Where a drive parts from another one, None where all decisions agree."""
    for k, (a, b) in enumerate(zip(drive["decisions"], other["decisions"], strict=False)):
        if changed_decisions([a], [b], SAME):
            time = drive["times"][k]
            chosen, instead = (c.action[int(np.searchsorted(c.drive.time, time + 1e-6))] for c in (curves, others))
            return Parting(time, chosen, instead, curves.cause[int(np.searchsorted(curves.drive.time, time - 1e-6))])
    return None


def events(curves: Curves, others: Curves) -> list[tuple[float, str]]:
    """Time [s] and text: braking for nothing, and braking too late, each beside the other drive."""
    time, own, ref = curves.drive.time, curves.drive.braking, others.drive.braking
    found = []
    for start in _onsets(own > HARD):
        again = ref[(others.drive.time >= time[start] - AFTER) & (others.drive.time <= time[start] + AFTER)]
        if not (again > HARD).any():
            found.append((float(time[start]), f"brakes for nothing, {own[start : start + 15].max():.1f} m/s^2"))
    mine = time[_onsets(own > HARD)]
    for start in _onsets(ref > HARD):
        at = others.drive.time[start]
        later = mine[(mine >= at - AFTER) & (mine <= at + AFTER)]
        if not len(later):
            found.append((float(at), "does not brake where the other drive does"))
        elif (delay := float(later[0] - at)) > 0.1:
            found.append((float(later[0]), f"brakes {delay:.1f} s late"))
    return sorted(found)


def _onsets(active: NDArray) -> NDArray:
    """Indices at which a series (F,) of bool becomes true, spans nearer than a second counted as one."""
    starts = np.flatnonzero(active & ~np.concatenate([[False], active[:-1]]))
    ends = np.flatnonzero(active & ~np.concatenate([active[1:], [False]]))
    fresh = np.concatenate([[True], starts[1:] - ends[:-1] > 15]) if len(starts) else np.zeros(0, bool)
    return starts[fresh]


def table(results: Results) -> pd.DataFrame:
    """All drives beside those on the truth, and beside those on what is in view: drive minus reference.

    One row a pair: reference, scenario, planner, condition, seed, the measures, what only pairs have, `parted` [s] and
    `parting` in words. Drives with groups of errors are left out: their attribution needs no pairs.
    """
    rows: list[dict[str, Any]] = []
    for run, drive in results.metas.items():
        if parse(run.source).groups is not None:
            continue
        for reference in (TRUTH, IN_VIEW):
            beside = replace(run, source=reference, faults=())
            other = results.metas.get(beside)
            if other is not None and run.condition not in (TRUTH, reference):
                row = _row(curves(results, run), curves(results, beside), drive, other)
                rows.append({"reference": reference, **key_of(run)._asdict(), **row})
    return pd.DataFrame(rows, columns=["reference", *KEY, *MEASURES, *keys(DRIVES), "parted", "parting"])


def curves(results: Results, run: Run) -> Curves:
    """The curves of a drive; ValueError where its file is damaged."""
    return Curves.of(results.store.table(run))


def _row(own: Curves, others: Curves, drive: Meta, other: Meta) -> dict[str, Any]:
    """Measures of a drive minus those of the other, what only a pair has, and where the two part."""
    where = parting(own, others, drive, other)
    words = "no decision differs" if where is None else str(where)
    measured, beside = (meta["spans"][0] for meta in (drive, other))
    difference = {key: float(measured[key]) - float(beside[key]) for key in MEASURES}
    paired = values(DRIVES, Driven(own.drive, drive["decisions"]), Driven(others.drive, other["decisions"]))
    return {**difference, **paired, "parted": np.nan if where is None else where.time, "parting": words}

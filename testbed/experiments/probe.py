"""`testbed probe`: the hardest setting that is survived, on the truth and on tracks, by bisection, seed by seed.

A setting that a seed survives is taken to be survived in every easier setting too. So each seed has one limit, and the
hardest setting that 95 % of the seeds survive is a quantile of their limits.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rich.table import Table

from scenarios import SCENARIOS, Scenario
from scenarios.probes import PROBES
from scenarios.record import Parameter
from testbed.command_line.tables import DASH, filled_table
from testbed.environment.registration import scenario_of
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import drive_score
from testbed.evaluation.intervals import Interval, bootstrap_interval
from testbed.experiments.episode import episode
from testbed.experiments.report.texts import counted
from testbed.experiments.run import Run
from testbed.experiments.store import Results, Store
from testbed.experiments.study import WHOLE_RUN, Findings, Kept, Study, Tally, check_runs
from testbed.frame import TRUTH, Frame, Observer
from testbed.limits import check_seeds
from trackers.lookup import is_own, look_up

SHARE = 0.95  # of the seeds must survive
FREE = 1.0  # [m/s^2] braking up to this is none, where nothing calls for it
TTC = (1.5, 3.0)  # [s] in which the median of the least time to collision must lie for a probe to be accepted
BLIND = "in-view+birth_delay=99"  # nothing is seen as long as a probe lasts
LOSS = 0.1  # of the score that a blind drive must lose at least
SCHEMA = pa.schema([("value", pa.float64()), ("survived", pa.bool_())])


def find_probe(name: str) -> Scenario:
    """A probe of the catalogue, or a scenario of a user that has a parameter.

    Raises:
        LookupError: there is none, and the nearest name is suggested; or it has no parameter.
    """
    if not is_own(name, {**PROBES, **SCENARIOS}):
        return look_up(name, PROBES, "probe")
    found = scenario_of(name)
    if not isinstance(found, Scenario):
        raise LookupError(
            f"{name} is an environment of highway-env, of which nothing says what makes it harder; "
            "probe a scenario with `parameters`, see docs/own-code.md"
        )
    if not found.parameters:
        raise LookupError(f"{name} has no parameter that can be made harder; give its Scenario `parameters`")
    return found


def parameter_of(probe: str, name: str | None) -> Parameter:
    """A parameter of a probe by name, the first one for None; LookupError for one that it does not have."""
    known = {parameter.name: parameter for parameter in find_probe(probe).parameters}
    return look_up(next(iter(known)) if name is None else name, known, f"parameter of {probe}")


def driven(run: Run, observers: Sequence[Observer] = ()) -> dict[str, float | int]:
    """Metrics of one drive of a probe."""
    evaluator = DriveEvaluator()

    def observe(frame: Frame) -> None:
        evaluator.step(frame.scene)

    episode(run, [observe, *observers])
    return evaluator.summary()


def survived(probe: Scenario, row: Mapping[str, float | int]) -> bool:
    """Whether nothing was hit; in a probe in which nothing calls for braking, also whether the ego did not brake."""
    return not row["collisions"] and (not probe.calm or row["deceleration_max"] < FREE)


def accepted(
    probe: Scenario, rows: Sequence[Mapping[str, float | int]], blind: Sequence[Mapping[str, float | int]]
) -> bool:
    """Whether drives make a good probe: on the truth it is neither easy nor hopeless, and who sees nothing fails.

    On the truth nobody collides, and the median of the least time to collision, ahead or in the plane, lies in `TTC`;
    where nothing calls for braking, nobody brakes, and there is nothing that a blind drive could fail at.

    Args:
        probe: the scenario.
        rows: metrics of drives on the truth.
        blind: those of drives of the same seeds and planner on `BLIND`, in the same order.
    """
    if probe.calm or any(row["collisions"] for row in rows):
        return all(survived(probe, row) for row in rows)
    danger = float(np.median([min(row["ttc_min"], row["ttc_plane_min"]) for row in rows]))
    return TTC[0] <= danger <= TTC[1] and all(map(fails, blind, rows))


def fails(blind: Mapping[str, float | int], truth: Mapping[str, float | int]) -> bool:
    """Whether a drive that saw nothing is punished: it collides, or its score is lower than on the truth by `LOSS`."""
    score, aim = (float(drive_score(row, truth["progress"])) for row in (blind, truth))
    return bool(blind["collisions"]) or score <= aim - LOSS


class Search(NamedTuple):
    """The limit of one seed, a unit of work."""

    run: Run
    parameter: str
    resolution: float  # in the unit of the parameter

    @property
    def name(self) -> str:
        """Stem of its file."""
        return f"{self.run.name}_{self.parameter}_{self.resolution:g}"

    @property
    def key(self) -> dict[str, Any]:
        """All of it as JSON types."""
        return {**self.run.key, "parameter": self.parameter, "resolution": self.resolution}


@dataclass(frozen=True)
class Probe(Study):
    """The limits of a planner in a probe, on the truth and on the tracks of a tracker."""

    probe: str
    planner: str
    tracker: str
    seeds: tuple[int, ...]
    parameter: str | None = None  # None: the first of the probe
    resolution: float = 0.5  # in the unit of the parameter
    radar: str = "surround"

    name: ClassVar[str] = "probe"
    what: ClassVar[str] = "limits"
    schema: ClassVar[pa.Schema] = SCHEMA
    modules: ClassVar[tuple[str, ...]] = ("testbed.experiments.probe",)
    whole: ClassVar[bool] = True

    def work(self) -> list[Search]:
        """Seed by seed, on the truth and on tracks."""
        runs = [Run(self.probe, s, source, self.planner, self.radar) for s in self.seeds for source in self.sources]
        return [Search(run, self.searched.name, self.resolution) for run in runs]

    @property
    def sources(self) -> tuple[str, str]:
        """The truth, and what is compared with it."""
        return TRUTH, self.tracker

    @property
    def searched(self) -> Parameter:
        """The parameter that is made harder."""
        return parameter_of(self.probe, self.parameter)

    def runs(self) -> list[Run]:
        """The runs that are made harder."""
        return [search.run for search in self.work()]

    def together(self, work: Search) -> int:
        """A seed."""
        return work.run.seed

    def columns(self, work: Search) -> dict[str, Any]:
        """Source and seed."""
        return {"source": work.run.source, "seed": work.run.seed}

    def check(self) -> None:
        """Raise LookupError, TypeError or ValueError, in one sentence, for what cannot be searched."""
        find_probe(self.probe)
        if self.tracker == TRUTH:
            raise ValueError("tracker: the truth is what a tracker is compared with; name a tracker")
        if not self.resolution > 0:
            raise ValueError(f"resolution must be positive, got {self.resolution}")
        check_seeds(*self.seeds, name="seeds")
        super().check()
        check_runs(self.runs())

    def make(self, work: Search, store: Store) -> Kept:
        """Find the limit of a seed; the table has all settings that were tried."""
        probe, tried = find_probe(work.run.scenario), dict[float, bool]()
        parameter = parameter_of(work.run.scenario, work.parameter)

        def survives(value: float) -> bool:
            run = replace(work.run, config=((parameter.name, value),))
            tried[value] = survived(probe, driven(run))
            return tried[value]

        found = limit(survives, parameter.easy, parameter.hard, work.resolution)
        table = pa.table([list(tried), list(tried.values())], schema=SCHEMA)
        return Kept(table, [{"phase": WHOLE_RUN, "limit": None if np.isnan(found) else found}])

    def judge(self, results: Results, tally: Tally) -> Findings:
        """The limits on the truth and on tracks, over the seeds of which both are known."""
        known = {(work.run.source, work.run.seed) for work in results.metas}
        seeds = [seed for seed in self.seeds if all((source, seed) in known for source in self.sources)]
        if not seeds:
            return Findings([f"0 of {len(self.seeds)} seeds are done; the same command does the rest"], failed=True)
        table = results.runs.pivot_table(index="source", columns="seed", values="limit", dropna=False)
        truth, tracks = (table.reindex(index=[source], columns=seeds).to_numpy(float)[0] for source in self.sources)
        found = limits(truth, tracks, self.searched)
        failed = not np.isfinite(found.tracks.value) or len(seeds) < len(self.seeds)
        return Findings([self.table(found, len(seeds))], failed, found)

    def table(self, found: "Limits", seeds: int) -> Table:
        """The limits on the truth and on tracks, and their difference."""
        parameter = self.searched
        searched = f"{parameter.name} [{parameter.unit}], {parameter.note}"
        title = f"{self.probe}, planner {self.planner}, {counted(seeds, 'seed')}: {searched}"
        hardest = f"hardest that {SHARE:.0%} of the seeds survive"
        rows = {
            f"{hardest}, on the truth": found.truth,
            f"{hardest}, on {self.tracker}": found.tracks,
            "easier by, because of tracking": found.cost,
            "the same, mean over the seeds": found.mean_cost,
        }
        heads = ("", parameter.name, "95 % interval")
        return filled_table(title, heads, [(what, *_cells(interval)) for what, interval in rows.items()])


def limit(survives: Callable[[float], bool], easy: float, hard: float, resolution: float) -> float:
    """The hardest value from `easy` to `hard` that is survived, to a resolution; NaN where not even `easy` is.

    >>> limit(lambda gap: gap > 17.3, easy=60.0, hard=6.0, resolution=0.5)
    17.390625
    """
    if survives(hard):
        return hard
    if not survives(easy):
        return np.nan
    while abs(easy - hard) > resolution:
        middle = (easy + hard) / 2
        easy, hard = (middle, hard) if survives(middle) else (easy, middle)
    return easy


class Limits(NamedTuple):
    """What a planner survives, on the truth and on tracks: hardest settings, in the unit of the parameter."""

    truth: Interval  # survived by `SHARE` of the seeds
    tracks: Interval
    cost: Interval  # by how much easier the probe must be on tracks
    mean_cost: Interval  # the same, in the mean over the seeds


def limits(truth: NDArray, tracks: NDArray, parameter: Parameter) -> Limits:
    """The limits over the seeds (S,) on the truth and on tracks, NaN for seeds that survive nothing.

    Intervals are by bootstrap over the seeds, which stay together. Where more than 5 % of the seeds survive nothing the
    limit is infinite.
    """
    side = 1.0 if parameter.hard < parameter.easy else -1.0  # so that less is harder
    easy = np.array([np.where(np.isnan(c), inf, side * c) for c in (truth, tracks)])
    seeds = np.arange(len(truth))

    def hardest(k: int) -> Callable[..., NDArray]:
        return lambda index, axis=-1: quantile(easy[k][index.astype(int)], axis)

    def cost(index: NDArray, axis: int = -1) -> NDArray:
        index = index.astype(int)  # the bootstrap makes numbers of them
        return quantile(easy[1][index], axis) - quantile(easy[0][index], axis)

    both = np.isfinite(easy).all(0)
    with np.errstate(invalid="ignore"):  # infinite limits
        return Limits(
            truth=_signed(bootstrap_interval([seeds], hardest(0)), side),
            tracks=_signed(bootstrap_interval([seeds], hardest(1)), side),
            cost=bootstrap_interval([seeds], cost),
            mean_cost=bootstrap_interval([(easy[1] - easy[0])[both]]),
        )


def quantile(values: NDArray, axis: int = -1) -> NDArray:
    """The least of values (..., S) that `SHARE` of the S values do not exceed.

    >>> quantile(np.arange(1.0, 21.0))
    np.float64(19.0)
    """
    n = values.shape[axis]
    return np.take(np.sort(values, axis), ceil(SHARE * n - 1e-9) - 1, axis)


def _signed(interval: Interval, side: float) -> Interval:
    return interval if side > 0 else Interval(-interval.value, -interval.high, -interval.low)


def _cells(interval: Interval) -> tuple[str, str]:
    value, low, high = (f"{x:.1f}" if np.isfinite(x) else DASH for x in interval)
    return value, f"{low} to {high}"

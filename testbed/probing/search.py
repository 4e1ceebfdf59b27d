"""The hardest setting of a probe that is survived, by bisection, seed by seed.

A setting that a seed survives is taken to be survived in every easier setting too. So each seed has one limit, and the
hardest setting that 95 % of the seeds survive is a quantile of their limits.
"""

import json
from collections.abc import Callable
from math import ceil, inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.record import Parameter
from testbed.evaluation.intervals import Interval, bootstrap_interval
from testbed.experiments.run import FOUND, Outcome, outcome_of
from testbed.files import write_json
from testbed.probing.drives import Setting, find_probe, survives
from trackers.lookup import look_up

SHARE = 0.95  # of the seeds must survive


def parameter_of(probe: str, name: str | None) -> Parameter:
    """A parameter of a probe by name, the first one for None; LookupError for one that it does not have."""
    known = {parameter.name: parameter for parameter in find_probe(probe).parameters}
    return look_up(next(iter(known)) if name is None else name, known, f"parameter of {probe}")


class Search(NamedTuple):
    """The limit of one seed."""

    setting: Setting
    parameter: str
    resolution: float  # in the unit of the parameter
    code: str  # digest of the code that makes the drives
    seed: int

    @property
    def name(self) -> str:
        """Stem of its file."""
        return "_".join([*self.setting, self.parameter, f"{self.resolution:g}", f"seed{self.seed}"]).replace("/", "-")


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


def limit_path(search: Search, out: Path) -> Path:
    """Where the limit of a seed lies."""
    return out / f"{search.name}.json"


def search(task: Search, out: Path) -> Outcome:
    """Find the limit of a seed, unless it has a valid file."""

    def work() -> str:
        if stored(task, out) is not None:
            return FOUND
        parameter = parameter_of(task.setting.probe, task.parameter)
        found = limit(
            lambda value: survives(task.setting, task.seed, {parameter.name: value}),
            parameter.easy, parameter.hard, task.resolution,
        )  # fmt: skip
        write_json(limit_path(task, out), {"search": _identity(task), "limit": None if np.isnan(found) else found})
        return ""

    return outcome_of(task.name, work)


def stored(task: Search, out: Path) -> float | None:
    """The limit that an earlier call of the same code left, None without one."""
    try:
        found = json.loads(limit_path(task, out).read_text())
    except (FileNotFoundError, ValueError):
        return None
    if found["search"] != _identity(task):
        return None
    return np.nan if found["limit"] is None else float(found["limit"])


def _identity(task: Search) -> dict[str, Any]:
    return {**task.setting._asdict(), **task._asdict(), "setting": None}


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

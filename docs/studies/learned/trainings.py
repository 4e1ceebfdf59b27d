"""What training seeds say: the unit is a training, whose score is the mean return of its episodes.

Agarwal et al. (2021), "Deep Reinforcement Learning at the Edge of the Statistical Precipice": interquartile mean,
performance profile and probability of improvement, with a bootstrap over trainings, stratified by kind.
"""

from math import ceil

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from studies.effects import names, spell
from testbed.evaluation.intervals import bootstrap_interval, interquartile_mean
from testbed.frame import TRUTH
from testbed.log.text import markdown_table

ABOVE = (10.0, 15.0, 20.0)  # of the performance profile, returns
WANTED = 2.0  # difference of returns that should be resolved
POWER = 0.8  # probability that it is, in a test of 5 %


def scores(table: pd.DataFrame, trained: str, driven: str, measure: str = "reward") -> NDArray:
    """Scores (n,) of the trainings of a kind, on what they drive on."""
    chosen = table[(table["tracker"] == trained) & (table["driven"] == driven)]
    return chosen.groupby("scenario")[measure].mean().to_numpy(float)


def improvement(a: NDArray, b: NDArray, axis: int = -1) -> NDArray:
    """Probability that a training of the kind of a (..., n) is better than one of that of b (..., m); ties are half.

    >>> improvement(np.array([1.0, 3.0]), np.array([2.0, 3.0]))
    np.float64(0.375)
    """
    a, b = (np.moveaxis(scores, axis, -1) for scores in (a, b))
    apart = np.sign(a[..., :, None] - b[..., None, :])
    return (apart.mean((-2, -1)) + 1) / 2


def profile(values: NDArray, above: float, axis: int = -1) -> NDArray:
    """Share (...) of trainings (..., n) with more than a score."""
    return np.asarray((values > above).mean(axis))


def needed(a: NDArray, b: NDArray, difference: float = WANTED) -> int:
    """Trainings a kind that resolve a difference of means with `POWER`, if their spreads are those of a and b.

    >>> needed(np.array([0.0, 2.0]), np.array([1.0, 3.0]), 2.0)
    8
    """
    variance = a.var(ddof=1) + b.var(ddof=1)
    return ceil((norm.ppf(0.975) + norm.ppf(POWER)) ** 2 * variance / difference**2)


def section(table: pd.DataFrame) -> str:
    """The table of kinds, driven on tracks, and what follows."""
    tracker = next(name for name in names(table, "tracker") if name != TRUTH)
    of = {kind: scores(table, kind, tracker) for kind in (TRUTH, tracker)}
    above = [f"share above {x:g}" for x in ABOVE]
    head = ("trained on", "trainings", "interquartile mean", "minus on the truth", *above)
    rows = [
        (f"`{kind}`", str(len(found)), spell(bootstrap_interval([found], interquartile_mean), 1),
         spell(bootstrap_interval([found - scores(table, kind, TRUTH)]), 1),
         *(f"{profile(found, x):.2f}" for x in ABOVE))
        for kind, found in of.items()
    ]  # fmt: skip
    count = needed(of[TRUTH], of[tracker])
    better = bootstrap_interval([of[tracker], of[TRUTH]], improvement)
    return (
        f"{markdown_table(head, rows)}\n\nA training on `{tracker}` is better than one on the truth with probability "
        f"{spell(better, 2)}. To resolve a difference of {WANTED:g} would take {count} trainings a kind "
        f"(power {POWER:g}, spreads as found: {', '.join(f'{x.std(ddof=1):.1f}' for x in of.values())})."
    )

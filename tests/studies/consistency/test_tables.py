"""Consistency by group: an honest tracker is good, one that is too sure is not, outliers count."""

import numpy as np
import pandas as pd
import pytest

from studies.consistency.tables import FEWEST, QUANTITIES, by_group, judge

POSITION, LENGTH = QUANTITIES[0], QUANTITIES[3]


def drawn(scale=1.0, runs=8, n=150, seed=0):
    """Pairs of `runs` runs, the errors `scale` times as large as the tracker says."""
    rng = np.random.default_rng(seed)
    seeds = np.repeat(np.arange(runs), n)
    nees = {q.column: scale**2 * rng.chisquare(q.dof, len(seeds)) for q in QUANTITIES}
    kind = np.where(np.arange(len(seeds)) % 3, "car", "truck")
    return pd.DataFrame({"scenario": "cut-in", "seed": seeds, "class": kind, **nees})


@pytest.mark.parametrize("quantity", QUANTITIES, ids=lambda q: q.name)
def test_an_honest_covariance_is_good_and_half_of_it_is_not(quantity):
    honest = judge(drawn(), quantity)
    assert quantity.dof in honest.mean
    assert honest.outliers == pytest.approx(0.01, abs=0.01)
    assert honest.pairs == 1200
    assert honest.good(quantity)
    assert not judge(drawn(2**0.5), quantity).good(quantity)


def test_few_far_outliers_are_not_good_although_the_mean_is():
    rows = drawn()
    rows.loc[::25, LENGTH.column] = 8.0  # 4 % beyond the limit of 6.6
    found = judge(rows, LENGTH)
    assert LENGTH.low < found.mean.value < LENGTH.high
    assert found.outliers > 0.04
    assert not found.good(LENGTH)


def test_groups_are_judged_by_themselves_and_small_ones_not_at_all():
    rows = drawn()
    rows.loc[rows["class"] == "truck", POSITION.column] *= 10
    rows.loc[: FEWEST - 10, "class"] = "bus"
    found = by_group(rows, "class")
    assert set(found) == {"car", "truck"}
    assert found["car"]["position"].good(POSITION)
    assert not found["truck"]["position"].good(POSITION)


def test_the_interval_comes_from_runs_not_from_pairs():
    """Errors of a run go together: the interval of few runs is wide however many pairs they have."""
    rows = drawn(runs=4)
    rows[POSITION.column] = np.repeat([1.0, 2.0, 2.0, 3.0], len(rows) // 4)
    found = judge(rows, POSITION)
    assert found.mean.value == pytest.approx(2.0)
    assert found.mean.high - found.mean.low > 1.0

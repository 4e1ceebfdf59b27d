"""Verdicts and intervals of the comparison with real vehicles."""

import numpy as np
import pytest

from studies.calibration.report import Compared, compare, compared, tables
from studies.calibration.statistics import DATA, NAMES

needs_data = pytest.mark.skipif(
    not (DATA / "objects.npz").exists(), reason="the real detections are not part of this project and not beside it"
)


def test_a_verdict_is_within_a_tenth_and_sure_when_its_whole_interval_agrees():
    simulated = np.array([1.0, 1.09, 1.2, 1.2, 0.91])
    low = np.array([0.95, 1.0, 1.15, 1.05, 0.85])
    one = Compared(3, np.ones(5), simulated, low, np.array([1.05, 1.15, 1.3, 1.3, 1.0]))
    assert one.marks == ["", "?", "*", "*?", "?"]


def test_the_interval_of_a_ratio_covers_it_as_often_as_it_says():
    """Blocks of one vehicle with Poisson counts of mean 20 and 25: the ratio of the means is 1.25."""
    hits, mean = 0, NAMES.index("mean")
    for seed in range(100):
        rng = np.random.default_rng(seed)
        real, simulated = (np.ones((40, 8)) * rng.poisson(m, 40)[:, None] for m in (20.0, 25.0))
        one = compare(real, simulated[None], np.arange(40), 60, rng)
        hits += one.low[mean] <= 1.25 <= one.high[mean]
    assert 80 <= hits <= 97  # of 90 expected; three standard errors of a binomial are 9


def test_a_single_block_has_no_interval():
    one = compare(np.ones((4, 8)), np.ones((1, 4, 8)), np.zeros(4, int), 10, np.random.default_rng(0))
    assert np.isnan(one.low).all()
    assert one.marks[0] == "?"


@needs_data
def test_the_report_has_a_column_for_every_group_and_counts_what_is_met():
    found = compared(repeat=1, draws=4)
    by_range, by_aspect, by_kind = tables(found)
    assert [len(table.columns) for table in (by_range, by_aspect, by_kind)] == [7, 6, 5]
    assert by_range.row_count == by_aspect.row_count == by_kind.row_count == 2 + len(NAMES)

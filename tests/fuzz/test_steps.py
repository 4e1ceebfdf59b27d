"""Whatever a scan holds, a step raises a ValueError that names the field or returns a finite, definite state.

`python -m tests.fuzz.test_steps 10` counts what ten times 200 steps of every registered filter and tracker come to.
"""

import sys

import pytest

from tests.fuzz.steps import DONE, REFUSED, Tally, drive_filter, drive_tracker
from trackers import TRACKERS, find

STEPS = 35  # of each filter and each tracker, some and most scans spoilt, in every test run
SLOW = {"filter": 1800, "tracker": 3100}  # steps of each: a filter's step is a prediction and an update, 10^5 in all
DRIVES = {"filter": drive_filter, "tracker": drive_tracker}


@pytest.mark.parametrize("name", TRACKERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_no_scan_and_no_time_step_leaves_a_state_that_cannot_be_used(name, drive):
    some, most = (DRIVES[drive](find(name), seed, STEPS) for seed in (0, 1))
    for tally in (some, most):
        assert not tally.wrong, str(tally)
        assert tally.clear[REFUSED] > 0
    assert some.clear[DONE] > 0.8 * some.tried


@pytest.mark.slow
@pytest.mark.parametrize("name", TRACKERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_nor_do_a_hundred_thousand(name, drive):
    for seed in range(1, 11):
        tally = DRIVES[drive](find(name), seed, SLOW[drive] // 10)
        assert not tally.wrong, str(tally)


def count(seeds: int) -> Tally:
    """All filters and trackers over 200 steps of each seed; prints a line for each, and returns the sum."""
    total = Tally.empty()
    for name in TRACKERS:
        for what, drive in DRIVES.items():
            tallies = [drive(find(name), seed, 200) for seed in range(seeds)]
            print(name, what, Tally.empty().plus(*tallies), flush=True)
            total = total.plus(*tallies)
    return total


if __name__ == "__main__":
    print("all", count(int(sys.argv[1])))

"""The arithmetic of the benchmarks, on made figures, and every benchmark once, as small as it can be."""

import numpy as np
import pytest

from testbed import bench
from testbed.bench import Pairs, interleaved


class Clock:
    """A clock that stands still but for the work that is done."""

    def __init__(self):
        self.now = 0.0
        self.done = []

    def work(self, name, seconds):
        left = iter(seconds)

        def piece():
            self.done.append(name)
            self.now += next(left)

        return piece

    def __call__(self):
        return self.now


def test_the_share_is_that_of_the_pairs_whatever_happened_before_them():
    clock = Clock()
    clock.work("reset", [1000.0])()
    pairs = interleaved(clock.work("plain", [4.0, 8.0, 2.0]), clock.work("extra", [5.0, 10.0, 2.5]), 3, clock)
    np.testing.assert_allclose(pairs.plain, [4.0, 8.0, 2.0])
    np.testing.assert_allclose(pairs.extra, [5.0, 10.0, 2.5])
    assert pairs.share == pytest.approx(0.2)
    assert pairs.added == pytest.approx(1.0)


def test_the_two_take_turns_at_being_first():
    clock = Clock()
    interleaved(clock.work("plain", [1.0] * 4), clock.work("extra", [1.0] * 4), 4, clock)
    assert clock.done == ["plain", "extra", "extra", "plain", "plain", "extra", "extra", "plain"]


def test_a_few_disturbed_pairs_change_nothing():
    quiet = Pairs(np.full(9, 4.0), np.full(9, 5.0))
    disturbed = Pairs(quiet.plain.copy(), quiet.extra.copy())
    disturbed.extra[[1, 5]] = 50.0
    disturbed.plain[[2, 3]] = 40.0
    assert (disturbed.share, disturbed.added) == (quiet.share, quiet.added)
    assert quiet.share == pytest.approx(0.2)


def test_a_slower_machine_gives_the_same_share():
    slow = Pairs(np.array([4.0, 12.0, 4.0]), np.array([5.0, 15.0, 5.0]))
    assert slow.share == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("part", "size", "rows"),
    [("perception", 1, 3), ("closed_loop", 1, 2), ("ghosts", 1, 4), ("logging", 1.0, 2), ("roads", 1, 4),
     ("rays", 1, 2), ("decisions", 1, 8), ("filters", 1, 6)],
)  # fmt: skip
def test_every_benchmark_has_its_rows(part, size, rows):
    table = getattr(bench, part)(size)
    assert table.row_count == rows
    times = [cell for column in table.columns if "[ms" in str(column.header) for cell in column.cells]
    assert times
    assert all(float(x) > 0 for cell in times for x in cell.split(","))

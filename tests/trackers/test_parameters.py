"""Numbers that make no sense are refused where a filter is built."""

from dataclasses import dataclass, fields, is_dataclass, replace

import numpy as np
import pytest

from trackers import TRACKERS, MultiObjectTracker, SensorModel, find
from trackers.parameters import check_numbers


@dataclass(frozen=True)
class Record:
    """One number of each kind."""

    count: int = 3
    std: float = 0.1
    pair: tuple[float, float] = (0.0, 1.0)
    log_odds: float = -3.0
    tau: float = np.inf
    name: str = "record"

    def __post_init__(self) -> None:
        check_numbers(self, positive=("count", "std"), signed=("log_odds",), unlimited=("tau",))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 2.5}, r"Record\.count must be a whole number > 0, got 2\.5"),
        ({"count": 0}, "count must be a whole number > 0, got 0"),
        ({"std": 0.0}, "std must be a finite number > 0, got 0"),
        ({"std": "0.1"}, "std must be a finite number > 0, got '0.1'"),
        ({"pair": (0.0, np.nan)}, r"pair must be a finite number >= 0, got \(0\.0, nan\)"),
        ({"log_odds": -np.inf}, "log_odds must be a finite number, got -inf"),
        ({"tau": -1.0}, "tau must be a number >= 0, got -1"),
        ({"tau": np.nan}, "tau must be a number >= 0, got nan"),
    ],
)
def test_the_field_and_its_limit_are_named(change, message):
    Record(count=np.int64(2), std=np.float32(0.5), pair=(0, 2))
    with pytest.raises(ValueError, match=message):
        Record(**change)


def numbers(record):
    """Every dataclass in a filter or tracker, with the names of its fields that are one number."""
    yield record, [field.name for field in fields(record) if field.type in (int, float)]
    for field in fields(record):
        value = getattr(record, field.name)
        if is_dataclass(value) and not isinstance(value, type):
            yield from numbers(value)


@pytest.mark.parametrize("name", TRACKERS)
def test_no_filter_and_no_tracker_takes_a_number_that_makes_no_sense(name):
    tracker = MultiObjectTracker(find(name), (SensorModel(),))
    for record, names in numbers(tracker):
        for field in names:
            for bad in (np.nan, "much"):
                with pytest.raises(ValueError, match=rf"{type(record).__name__}\.{field} must be"):
                    replace(record, **{field: bad})
        if "sigma" in names:
            with pytest.raises(ValueError, match=r"sigma must be a finite number .*, got -1"):
                replace(record, sigma=-1.0)

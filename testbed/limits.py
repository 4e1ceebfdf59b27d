"""Limits of seeds, durations and numbers: beyond them a call would take all memory, or would not end.

Each check raises ValueError in one sentence that names what was given and what may be given.
"""

import os
from collections.abc import Sequence
from math import inf
from numbers import Integral, Real
from os import PathLike
from typing import Any

LARGEST_SEED = 2**63 - 1  # of the whole numbers that tables of results hold
LONGEST = 3600.0  # [s] of a run
MOST_RUNS = 1_000_000  # of a comparison
MOST_DETECTIONS = 2_000_000  # of a sampler
PROCESSES = 4  # on a core


class UnfitPolicy(ValueError):
    """A learned policy does not fit the environment that it is to drive in; one sentence says how."""


def check_whole(name: str, value: Any, least: int, most: int) -> None:
    """A whole number from `least` to `most`."""
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise ValueError(f"{name} must be a whole number, got {value!r}; take {least} or more")
    value = int(value)
    if value < least:
        what = "not be negative" if least == 0 else f"be at least {least}"
        raise ValueError(f"{name} must {what}, got {value}; take {least} or more")
    if value > most:
        raise ValueError(f"{name} must be at most {most}, got {value}; take fewer digits")


def check_seeds(*seeds: Any, name: str = "seed") -> None:
    """Seeds of generators."""
    for seed in seeds:
        check_whole(name, seed, 0, LARGEST_SEED)


def check_duration(duration: Any, name: str = "duration", without: str = "that of the scenario") -> None:
    """A simulated time [s], or None for what is had without it."""
    if duration is None:
        return
    if not isinstance(duration, Real) or isinstance(duration, bool) or not 0 < float(duration) < inf:
        raise ValueError(f"{name} must be positive and finite, got {duration!r} s; leave it out for {without}")
    if float(duration) > LONGEST:
        raise ValueError(f"{name} must be at most {LONGEST:g} s, got {duration!r} s; make several runs of other seeds")


def check_settle(settle: Any) -> None:
    """A time [s] from the start of a run, of which no scan enters a mean."""
    if not isinstance(settle, Real) or isinstance(settle, bool) or not 0 <= float(settle) <= LONGEST:
        raise ValueError(f"settle must be a number from 0 to {LONGEST:g} s, got {settle!r}; give 2 for two seconds")


def check_jobs(jobs: Any) -> None:
    """A number of processes, or -1 for one a core."""
    most = max(PROCESSES * (os.cpu_count() or 1), 2 * PROCESSES)
    if isinstance(jobs, bool) or not isinstance(jobs, Integral) or (int(jobs) < 1 and jobs != -1):
        raise ValueError(f"jobs must be 1 or more, or -1 for all cores, got {jobs!r}")
    if int(jobs) > most:
        raise ValueError(f"jobs must be at most {most}, {PROCESSES} for each core, got {jobs}; -1 takes all cores")


def check_folder(out: Any) -> None:
    """A directory for results."""
    if not isinstance(out, str | PathLike):
        raise ValueError(f"out must be a directory, got {out!r}; write out='runs'")


def check_choice(name: str, value: Any, choices: Sequence[str]) -> None:
    """One of some words."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(choices)}, got {value!r}; choose one of them")


def check_names(what: str, names: Any) -> None:
    """Names in a tuple or list, at least one and none twice."""
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise ValueError(f"{what} must be a tuple of names, got {names!r}; put them in a tuple")
    if not names:
        raise ValueError(f"{what} must name at least one of them, got none; `testbed list` shows all")
    if other := [name for name in names if not isinstance(name, str)]:
        raise ValueError(f"{what} must be names, got {other[0]!r}; `testbed list` shows all")
    if len(set(names)) < len(names):
        raise ValueError(f"{what} must differ, got {', '.join(names)}; drop the repetition")

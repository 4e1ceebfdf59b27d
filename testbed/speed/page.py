"""docs/speed.md: what tracking costs beside the simulation; written by `testbed bench --docs`."""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from testbed.files import make_directory, write_atomic
from testbed.speed import goals, shares
from testbed.speed.figure import draw
from testbed.speed.goals import Goal
from testbed.speed.shares import Costs

PICTURE = "pictures/speed.png"
TEXT = """# Speed

Written by `testbed bench --docs {folder}` on {date}; do not edit it by hand.

## Goals

Ratios of CPU times, both sides measured in turns in one run, so that a busy machine hardly changes them.

{goals}

## Where the time of a frame goes

Shares of the wall time of a run with the default tracker, without a log.

{shares}

## Cost against vehicles

The stock highway-v0, and beside it the radar `surround` and the default tracker, wall time a frame.

{costs}

![Cost of a frame against the number of vehicles]({picture})

## Beside others

EnvPool has highway-env rewritten in C++, hundreds of times as fast as highway-env. Its infos hold no traffic, so the
radar here cannot stand on it, and no speed is claimed against it.
"""


def write(docs: Path, quick: bool, progress: Callable[[float, float, str], None]) -> Path:
    """Measure, write the page and its picture, and return where the page is.

    Raises:
        OSError: nothing can be written there.
    """
    make_directory(docs / "pictures")
    found = goals.measure(quick, progress)
    with TemporaryDirectory() as out:
        parts = {name: shares.shares(name, 2 if quick else 8, out) for name in shares.SCENARIOS}
    costs = [shares.costs(vehicles, 1 if quick else 5) for vehicles in shares.VEHICLES]
    draw(costs, docs / PICTURE)
    page = docs / "speed.md"
    write_atomic(page, render(docs, found, parts, costs, f"{datetime.now(UTC):%Y-%m-%d}"))
    return page


def render(
    docs: Path, found: Sequence[Goal], parts: Mapping[str, Mapping[str, float]], costs: Sequence[Costs], date: str
) -> str:
    """The text of the page."""
    verdicts = [[g.what, g.against, f"{g.found:.2f}", f"{g.goal:g}", "met" if g.met else "not met"] for g in found]
    names = list(next(iter(parts.values())))
    rows = [[scenario, *(f"{row[name]:.0%}" for name in names)] for scenario, row in parts.items()]
    cost = [[str(c.vehicles), str(c.tracks), *(f"{ms:.1f}" for ms in c[1:4])] for c in costs]
    return TEXT.format(
        folder=docs,
        date=date,
        picture=PICTURE,
        goals=table(["what", "against", "found", "goal", "verdict"], verdicts),
        shares=table(["scenario", *names], rows),
        costs=table(["vehicles", "tracks reported", "highway-env [ms]", "radar [ms]", "tracker [ms]"], cost),
    )


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (heads, ["---"] * len(heads), *rows))

"""docs/speed.md: what tracking costs beside the simulation; written by `testbed bench --docs`."""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from testbed.bench import Pairs
from testbed.files import make_directory, write_atomic
from testbed.speed import forms, goals, shares
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

## With the extra fast

`pip install "eot-testbed[fast]"` brings numba (210 MB with its compiler), which compiles the loops of the default
tracker that cost most: the spatial update of the contour, the likelihood of sizes, the ground under long tracks
(`trackers/compiled/`). They are used wherever numba is installed; `EOT_TESTBED_COMPILED=0` switches them off. The first
use takes about a minute of CPU time and says so on stderr; afterwards they are read from the user's cache folder.

CPU time of the default tracker a frame, both forms in turns on the same scans.

{forms}

The numpy form is the reference. Tracks of the two forms agree to 1e-9 with the same decisions, on recorded scans and on
drawn ones (`tests/trackers/compiled/`), but not to the last bit. So results name their form: where kernels are in use,
the versions in logs, comparisons and studies have numba and a digest of the kernels among them, and a folder of results
refuses runs of the other form. Everything that `make` measures for these pages is made in the numpy form.

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
        kernels = {name: forms.forms(name, 2 if quick else 8, out) for name in shares.SCENARIOS}
    costs = [shares.costs(vehicles, 1 if quick else 5) for vehicles in shares.VEHICLES]
    draw(costs, docs / PICTURE)
    page = docs / "speed.md"
    write_atomic(page, render(docs, found, parts, costs, kernels, f"{datetime.now(UTC):%Y-%m-%d}"))
    return page


def render(
    docs: Path, found: Sequence[Goal], parts: Mapping[str, Mapping[str, float]], costs: Sequence[Costs],
    kernels: Mapping[str, Pairs | None], date: str,
) -> str:  # fmt: skip
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
        forms=forms_table(kernels),
        costs=table(["vehicles", "tracks reported", "highway-env [ms]", "radar [ms]", "tracker [ms]"], cost),
    )


def forms_table(kernels: Mapping[str, Pairs | None]) -> str:
    """Median times a frame of both forms, or that they were not measured."""
    rows = []
    for scenario, pairs in kernels.items():
        if pairs is None:
            rows.append([scenario, "numba is not installed", "", ""])
            continue
        plain, fast = 1e3 * median(pairs.extra), 1e3 * median(pairs.plain)
        rows += [
            [scenario, "numpy", f"{plain:.1f}", "1"],
            [scenario, "with the extra fast", f"{fast:.1f}", f"{median(pairs.plain / pairs.extra):.2f}"],
        ]
    return table(["scenario", "form", "tracker [ms]", "ratio"], rows)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (heads, ["---"] * len(heads), *rows))

"""docs/speed.md: what tracking costs beside the simulation."""

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from studies.page import DOCS, Docs
from studies.speed import goals, growth, shares, training
from studies.speed.figure import draw
from studies.speed.goals import Goal
from studies.speed.growth import Growth
from studies.speed.shares import Costs
from studies.speed.training import Step
from testbed.command_line.terminal import console, progress_bar, user_input
from testbed.files import make_directory, write_atomic
from testbed.log.text import markdown_table

PICTURE = "pictures/speed.png"
TEXT = """# Speed

Written by `PYTHONPATH=docs python -m studies speed --docs {folder}` on {date}; do not edit it by hand.

## Goals

Ratios of CPU times, both sides measured in turns in one run, so that a busy machine hardly changes them.

{goals}

The rows of perception, "scene, radar and tracker", and of two processes have wall times instead.

## What a decision is made of

A decision of highway-v0 with 20 vehicles has 15 simulated frames. CPU time in units of the stock environment, whose
road is slower than the one that `TrackedEnv` puts in its place, with the same states bit by bit.

{steps}

`radar={{"name": "surround", "rate": 5}}` scans five times a second. That is another sensor: compare results within one
rate only.

## Why not faster

- **The scans alone leave no room.** What is added to perfect tracks before any tracker runs is in the table above: the
  goal of 1 leaves the tracker nothing of the time of a frame.
- **The time is in the calls, not in the sums.** A frame of the default tracker is about a thousand numpy calls on small
  arrays, spread over births, claims, three layers of filters and their checks; no function has a tenth of it.
- **Compiled kernels** of all the arithmetic of the default tracker (numba, 600 lines, 210 MB installed) were built,
  held equal to 1e-9 and measured: a step was 1.22 to 1.36 times as fast. They were taken out again: two thirds of a
  step are calls between layers, which they leave as they are, and every result would have had a second form.
- **One tracker call for several environments** could save no more than half of the tracker's time: a track costs
  {many} us in a batch of {most} and {few} us in one of {least}, without what it costs to gather the scans.
- **Updates of the contour filter** ask three times which of 24 pieces of a contour each detection is of. For 100
  objects a third of the time are these densities; a random matrix has one.
- **Metrics**: half of their time is the area that each track shares with its vehicle, box and contour, 35 us a pair in
  a library; the rest assigns tracks to vehicles and measures the drive.
- **The log** keeps some 60 entities a frame, each of a few numbers: most of its time goes into their rows in Python,
  less than a third into the file.
- **A log in blocks of 30 steps** instead of 15 takes a quarter less time, and loses two seconds instead of one where a
  run is killed.
- **Two processes** wait at every step for the slower of the two, and share one machine: 1.04 to 1.09 in six
  measurements on two idle cores, up to 1.6 where others used these.
- **What helps training** is a process for each environment all the same, and fewer scans.

## Where the time of a frame goes

Shares of the wall time of a run with the default tracker, without a log.

{shares}

{before}
## Cost against vehicles, tracks and detections

![Cost of a frame against the numbers of vehicles, tracks and detections]({picture})

Left, and in the first table, the stock highway-v0, and beside it the radar `surround` and the default tracker, wall
time a frame. Where vehicles are many, most are hidden: tracks do not grow with them. The others are CPU times of a step
of the default tracker on a motorway of {lanes} lanes where all vehicles have the same number of detections in every
scan, of which at most 16 of a track are used.

{costs}

{growth}

## Beside others

EnvPool has highway-env rewritten in C++, hundreds of times as fast as highway-env. Its infos hold no traffic, so the
radar here cannot stand on it, and no speed is claimed against it.
"""
BEFORE = """Before ({before}) and after ({after}) what was done for speed, with the same tracks: {measured}.

{table}

What brought it: work that was done several times a scan is done once, gates are searched instead of tried, errors of
pairs are worked out for many scans at once, perfect tracks need no scan, metrics can be left out, and the cached road
stands under every id of highway-env. The scan of the six radars takes 0.9 times as long as before, the ray cast is a
third of it.
"""


def main(docs: Docs = DOCS, quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions.")] = False) -> None:
    """Measure speed against the goals and write the page, for some minutes."""
    with user_input((OSError,)), progress_bar("part {task.completed:.0f} / {task.total:.0f}") as bar:
        task = bar.add_task("goals", total=1)
        written = write(
            docs, quick, lambda done, total, what: bar.update(task, completed=done, total=total, description=what)
        )
    console.print(f"page     {written}", soft_wrap=True)


def write(docs: Path, quick: bool, progress: Callable[[float, float, str], None]) -> Path:
    """Measure, write the page and its picture, and return where the page is.

    Raises:
        OSError: nothing can be written there.
    """
    make_directory(docs / "pictures")
    grown = [growth.growth(objects) for objects in growth.OBJECTS[: 2 if quick else None]]
    denser = [growth.growth(growth.AMONG, each) for each in growth.DETECTIONS[: 2 if quick else None]]
    found = goals.measure(quick, grown, progress)
    steps = training.steps(3 if quick else 12)
    with TemporaryDirectory() as out:
        parts = {name: shares.shares(name, 2 if quick else 8, out) for name in shares.SCENARIOS}
    costs = [shares.costs(vehicles, 1 if quick else 5) for vehicles in shares.VEHICLES]
    draw(costs, grown, denser, docs / PICTURE)
    page = docs / "speed.md"
    write_atomic(page, render(docs, found, steps, [*grown, *denser], parts, costs, f"{datetime.now(UTC):%Y-%m-%d}"))
    return page


def render(
    docs: Path, found: Sequence[Goal], steps: Sequence[Step], grown: Sequence[Growth],
    parts: Mapping[str, Mapping[str, float]], costs: Sequence[Costs], date: str,
) -> str:  # fmt: skip
    """The text of the page."""
    verdicts = [[g.what, g.against, f"{g.found:.2f}", f"{g.goal:.3g}", "met" if g.met else "not met"] for g in found]
    names = list(next(iter(parts.values())))
    rows = [[scenario, *(f"{row[name]:.0%}" for name in names)] for scenario, row in parts.items()]
    cost = [[str(c.vehicles), str(c.tracks), *(f"{ms:.1f}" for ms in c[1:4])] for c in costs]
    growing = [
        [
            str(g.objects),
            str(g.each),
            str(g.tracks),
            f"{1e3 * g.seconds:.1f}",
            f"{1e6 * g.seconds / g.objects:.0f}",
            f"{g.peak / 1e6:.1f}",
        ]
        for g in grown
    ]
    fewest, most = (choose(grown, key=lambda g: g.objects) for choose in (min, max))
    return TEXT.format(
        folder=docs,
        before=before_and_after(docs / "results"),
        steps=markdown_table(("decision with", "of stock highway-v0"), [(s.what, f"{s.ratio:.2f}") for s in steps]),
        growth=markdown_table(
            ["vehicles", "detections of each", "tracks reported", "step [ms]", "of a track [us]", "peak memory [MB]"],
            growing,
        ),
        least=fewest.objects,
        few=f"{1e6 * fewest.seconds / fewest.objects:.0f}",
        many=f"{1e6 * most.seconds / most.objects:.0f}",
        most=most.objects,
        lanes=growth.LANES,
        date=date,
        picture=PICTURE,
        goals=markdown_table(["what", "against", "found", "goal", "verdict"], verdicts),
        shares=markdown_table(["scenario", *names], rows),
        costs=markdown_table(["vehicles", "tracks reported", "highway-env [ms]", "radar [ms]", "tracker [ms]"], cost),
    )


def before_and_after(results: Path) -> str:
    """What a frame took before and after, from the committed results; nothing where there are none."""
    path = results / "speed-before.json"
    if not path.exists():
        return ""
    found = json.loads(path.read_text())
    parts = {name: found[name] for name in shares.SCENARIOS}
    heads = ["", *(f"{name}, {when}" for name in parts for when in ("before", "after"))]
    rows = [[part, *(f"{ms:.1f}" for row in parts.values() for ms in row[part])] for part in parts[shares.SCENARIOS[0]]]
    facts = {key: found[key] for key in ("measured", "before", "after")}
    return BEFORE.format(**facts, table=markdown_table(heads, rows))

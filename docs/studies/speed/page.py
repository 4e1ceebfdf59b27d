"""docs/speed.md: what tracking costs beside the simulation."""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from studies.page import DOCS, Docs, fill
from studies.speed import goals, growth, shares, training
from studies.speed.figure import draw
from studies.speed.goals import Goal
from studies.speed.growth import Growth
from studies.speed.shares import Costs
from studies.speed.training import Step
from testbed.bench.compile import compile_all
from testbed.command_line.terminal import console, progress_bar, user_input
from testbed.files import make_directory, write_atomic
from testbed.log.text import markdown_table
from trackers.compiled import form as compiled_form

PICTURE = "pictures/speed.png"


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
    compile_all()
    grown = [growth.growth(objects) for objects in growth.OBJECTS[: 2 if quick else None]]
    denser = [growth.growth(growth.AMONG, each) for each in growth.DETECTIONS[: 2 if quick else None]]
    found = goals.measure(quick, grown, progress)
    steps = training.steps(3 if quick else 12)
    rates = training.throughput(3 if quick else 40)
    with TemporaryDirectory() as out:
        parts = {name: shares.shares(name, 2 if quick else 8, out) for name in shares.SCENARIOS}
    costs = [shares.costs(vehicles, 1 if quick else 5) for vehicles in shares.VEHICLES]
    draw(costs, grown, denser, docs / PICTURE)
    page = docs / "speed.md"
    write_atomic(
        page, render(docs, found, steps, rates, [*grown, *denser], parts, costs, f"{datetime.now(UTC):%Y-%m-%d}")
    )
    return page


def render(
    docs: Path, found: Sequence[Goal], steps: Sequence[Step], rates: Mapping[str, tuple[float, float]],
    grown: Sequence[Growth], parts: Mapping[str, Mapping[str, float]], costs: Sequence[Costs], date: str,
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
    return fill(
        "speed/page.md.j2",
        folder=docs,
        steps=markdown_table(("decision with", "of stock highway-v0"), [(s.what, f"{s.ratio:.2f}") for s in steps]),
        throughput=markdown_table(
            ("both environments, decisions a second", *(f"`{name}`" for name in rates)),
            [
                (form, *(f"{pair[i]:.0f}" for pair in rates.values()))
                for i, form in enumerate(("numpy", compiled_form()))
            ],
        ),
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

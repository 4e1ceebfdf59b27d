"""The page docs/traffic.md, and the committed quantiles that it is made from."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from studies.drivers import page as drivers
from studies.drivers.fit import near
from studies.page import DOCS, Docs, Page, fill
from studies.runs import calculate
from studies.traffic.distributions import LEVEL, SHOWN, UNITS, Distribution, distributions, table_of
from studies.traffic.driven import CATALOGUE, DRIVEN, NATIVE, SCENES, SEEDS, driven
from studies.traffic.figure import draw
from studies.traffic.recorded import FILES, ONE_CLOCK, recorded
from studies.traffic.rows import FARTHEST, Row
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import console, user_input
from testbed.experiments.engine import Engine
from testbed.files import make_directory, write_json
from testbed.log.text import markdown_table

RESULTS = "traffic.json"
DOCS_RESULTS = Path(__file__).parents[2] / "results"
COMMAND = "PYTHONPATH=docs python -m studies traffic DATA --docs docs"  # DATA lies elsewhere on every machine


class Study(NamedTuple):
    """What is committed."""

    seeds: int  # drives of each scenario
    inside: Mapping[str, float]  # share of the vehicles of a recording that are inside of others at some time
    found: Sequence[Distribution]


def counted(data: Path, engine: Engine, seeds: Sequence[int] = SEEDS) -> Study:
    """The study made anew, from a folder of recordings and from drives.

    Raises:
        ValueError: a recording is missing or cannot be used.
    """
    rows: list[Row] = []
    inside: dict[str, float] = {}
    for source in FILES:
        more, inside[source] = recorded(source, data)
        rows += more
    drives = [(CATALOGUE, name, seed) for name in SCENES for seed in seeds] + [(NATIVE, NATIVE, s) for s in seeds]
    for found in calculate(driven, drives, engine, "drives"):
        rows += found
    return Study(len(seeds), inside, distributions(table_of(rows)))


def write(study: Study, path: Path) -> None:
    """Write the committed results."""
    found = [one._asdict() for one in study.found]
    write_json(path, {"seeds": study.seeds, "inside": dict(study.inside), "distributions": found})


def read(path: Path) -> Study:
    """The committed results; ValueError where there are none."""
    if not path.exists():
        raise ValueError(f"{path} is not there yet; give the folder of the recordings")
    held: dict[str, Any] = json.loads(path.read_text())
    return Study(held["seeds"], held["inside"], [Distribution(**one) for one in held["distributions"]])


def render(study: Study) -> str:
    """The page from the results."""
    found, fit = study.found, drivers.read(DOCS_RESULTS / drivers.RESULTS)
    rows = fit["rows"]
    return fill(
        "traffic/page.md.j2",
        drivers=drivers.table(rows),
        near=sum(map(near, rows)),
        alike=sum(near(row._replace(simulated=row.default)) for row in rows),
        statistics=len(rows),
        followers=18,
        together=fit["population"]["speed_unrest"],
        seeds=study.seeds,
        driven=DRIVEN[CATALOGUE],
        native=DRIVEN[NATIVE],
        scenes=len(SCENES),
        farthest=FARTHEST,
        level=LEVEL,
        fewest=UNITS,
        clock=_clock(study.inside),
        length=_table([d for d in found if d.quantity == "length"], "class"),
        time_gap=_table([d for d in found if d.quantity == "time_gap" and d.by == "speed"], "speed [m/s]"),
    )


def _clock(inside: Mapping[str, float]) -> str:
    """Which recordings have the times of all vehicles on one clock."""
    sentences = []
    for source, share in inside.items():
        verdict = "are not of one clock, so it has no gaps" if share >= ONE_CLOCK else "are of one clock"
        overlap = f"In {source} {share:.1%} of the vehicles are inside of another one at some time"
        sentences.append(f"{overlap}: its times {verdict}.")
    return " ".join(sentences)


def _table(found: Sequence[Distribution], group: str) -> str:
    """A row a distribution: quantiles, those of 5, 50 and 95 % with their interval."""
    head = ("source", group, "vehicles", "values", *(f"{level} %" for level in SHOWN))
    return markdown_table(head, [(d.source, d.group, f"{d.vehicles:,}", f"{d.values:,}", *_cells(d)) for d in found])


def _cells(one: Distribution) -> Iterator[str]:
    for k, value in enumerate(one.quantiles):
        limits = f" ({one.low[k]:.2f} to {one.high[k]:.2f})" if one.low and k % 2 == 0 else ""
        yield f"{value:.2f}{limits}"


def main(
    data: Annotated[
        Path | None, typer.Argument(help="Folder of ngsim_i80 and ngsim_us101. Without it: the page as committed.")
    ] = None,
    docs: Docs = DOCS,
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Write the page "Our traffic beside real traffic", its picture and the quantiles that it shows."""
    with user_input((OSError, ValueError)):
        path = docs / "results" / RESULTS
        if data is not None:
            study = counted(data, Engine(jobs, dask))
            make_directory(path.parent)
            write(study, path)
            console.print(f"results  {path}", soft_wrap=True)
        study = read(path)
        page = Page("traffic", docs)
        draw(study.found, page.picture("traffic"))
        page.write(render(study), COMMAND)

"""The page docs/regret.md, and the committed tables of drives and pairs that it is made from."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from studies.page import DOCS, Docs, Page, fill
from studies.regret.caution import differences
from testbed.command_line.terminal import console, user_input
from testbed.experiments.pairs import KEY, SCORE, Attribution, Cell, scored
from testbed.experiments.regret import DRIVES, PAIRS, write_table
from testbed.experiments.report import figures_regret
from testbed.experiments.report import tables_regret as tables
from testbed.experiments.report.figures import draw
from testbed.experiments.report.grid import markdown
from testbed.experiments.report.regret import TABLE, drawable, find
from testbed.experiments.report.texts import seeds_text
from testbed.experiments.report.words import one_sided, unresolved_pairs
from testbed.files import make_directory
from testbed.log.text import markdown_table
from trackers import DEFAULT

ABOUT = "about.txt"  # in docs/results/regret, written by hand: of which code the drives are, and what they say
PARTS = ("main", "attribution", "doses", "caution")  # folders of docs/results/regret


def main(
    studies: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PART=FOLDER]...",
            help=f"A folder of `testbed regret --out` for a part: {', '.join(PARTS)}; several folders for one part are "
            "joined. Without any: as committed.",
        ),
    ] = None,
    add: Annotated[bool, typer.Option("--add", help="To what is committed, instead of in its place.")] = False,
    docs: Docs = DOCS,
) -> None:
    """Write the page "What tracking error costs in driving" and the tables that it shows.

    PYTHONPATH=docs python -m studies regret main=runs/regret/main caution=runs/regret/caution --docs docs
    """
    with user_input((OSError, ValueError)):
        results = docs / "results" / "regret"
        for name, folders in by_part(studies or ()).items():
            (results / ABOUT).unlink(missing_ok=True)  # is of other drives
            kept = [results / name] if add and (results / name / DRIVES).exists() else []
            publish([*kept, *folders], results / name)
        found = {name: load(results / name) for name in PARTS if (results / name / DRIVES).exists()}
        if "main" not in found:
            raise ValueError(f"{results} has no drives yet; give main=FOLDER of `testbed regret --out FOLDER`")
        page = Page("regret", docs)
        page.write(text(found, page, about_of(results)))


def by_part(studies: Sequence[str]) -> dict[str, list[Path]]:
    """Folders by part, from `PART=FOLDER`; ValueError for anything else.

    >>> by_part(["main=runs/a", "main=runs/b"])["main"] == [Path("runs/a"), Path("runs/b")]
    True
    """
    found: dict[str, list[Path]] = {}
    for study in studies:
        name, equals, folder = study.partition("=")
        if name not in PARTS or not (equals and folder):
            raise ValueError(f"a study reads PART=FOLDER with PART one of {', '.join(PARTS)}, got {study!r}")
        found.setdefault(name, []).append(Path(folder))
    return found


def publish(folders: Sequence[Path], place: Path) -> None:
    """Join the tables of some folders in a place; ValueError where one has none, or two differ about a drive."""
    for folder in folders:
        for name in (DRIVES, PAIRS):
            if not (folder / name).exists():
                raise ValueError(f"{folder} has no {name}; make it with `testbed regret --out {folder}`")
    for name, keys in ((DRIVES, [*KEY]), (PAIRS, ["reference", *KEY])):
        table = joined([pd.read_parquet(folder / name) for folder in folders], keys)
        make_directory(place)
        write_table(table, place / name)
    console.print(f"tables   {place}", soft_wrap=True)


def joined(tables: Sequence[pd.DataFrame], keys: list[str]) -> pd.DataFrame:
    """One table of all rows, each drive once, in the order of the keys; ValueError where two rows of a drive differ.

    The CPU time of a drive is its first one.
    """
    table = pd.concat(tables, ignore_index=True)
    twice = table[table.duplicated(keys, keep=False)].drop(columns="cpu", errors="ignore")
    if differing := twice.drop_duplicates().groupby(keys).size().loc[lambda n: n > 1].index.tolist():
        raise ValueError(f"two folders differ about {differing[0]}; make both with the same code")
    return table.drop_duplicates(keys).sort_values(keys, ignore_index=True)


def load(place: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The tables of drives and of pairs."""
    drives, pairs = (pd.read_parquet(place / name) for name in (DRIVES, PAIRS))
    return scored(drives, pairs)


def about_of(results: Path) -> str:
    """What was written by hand about the drives of a folder; nothing where nothing was."""
    file = results / ABOUT
    return file.read_text().strip() if file.exists() else ""


def text(found: dict[str, tuple[pd.DataFrame, pd.DataFrame]], page: Page | None = None, about: str = "") -> str:
    """The page from the tables of its parts, below what is said of them; with a page its pictures are drawn as well."""
    written = [_main(*found["main"], page, about)]
    if "attribution" in found:
        written.append(_attribution(*found["attribution"], page))
    if "doses" in found:
        written.append(_doses(*found["doses"], page))
    if "caution" in found:
        written.append(_caution(found["caution"][0]))
    return "\n".join(written)


def _main(drives: pd.DataFrame, pairs: pd.DataFrame, page: Page | None, about: str) -> str:
    found = find(drives, pairs)
    total, _, errors, _ = drawable(found)
    _draw(page, total, errors=errors)
    grids = {
        "overview": tables.overview(found.together, ""),
        "total": tables.changes([c for c in found.total if c.measure in TABLE], ""),
        "sensing": tables.changes([c for c in found.sensing if c.measure in TABLE], ""),
        "errors": tables.correlation(found.ranks),
        "worst": tables.worst(found.worst),
    }
    sides = one_sided(found.total)
    by_probe = [sentence for sentence in found.verdict if sentence.startswith("With ")]
    shown = [s for s in found.verdict if s not in by_probe or f"tracks of {DEFAULT} " in s]
    return fill(
        "regret/page.md.j2",
        facts=_facts(drives),
        about=about,
        verdict="\n\n".join(shown),
        cells=markdown_table(("finding",), [(sentence,) for sentence in by_probe]),
        sides=say_sides(sides),
        **{name: markdown(grid) for name, grid in grids.items()},
    )


def say_sides(sides: Sequence[str]) -> str:
    """In how many cells risk and loss are on different sides, and some of them."""
    some = _items(sides[:4])
    return f"Risk and loss are on different sides in {len(sides)} cells, such as:\n\n{some}" if sides else ""


def _attribution(drives: pd.DataFrame, pairs: pd.DataFrame, page: Page | None) -> str:
    found = find(drives, pairs)
    _, shares, _, _ = drawable(found)
    _draw(page, shares=shares)
    return fill("regret/attribution.md.j2", facts=_facts(drives), table=markdown(tables.attribution(found.shares)))


def _doses(drives: pd.DataFrame, pairs: pd.DataFrame, page: Page | None) -> str:
    found = find(drives, pairs)
    *_, doses = drawable(found)
    _draw(page, doses=doses)
    shown = [c for c in found.doses if c.measure in TABLE]
    return fill("regret/doses.md.j2", facts=_facts(drives), table=markdown(tables.changes(shown, "")))


def _caution(drives: pd.DataFrame) -> str:
    cells = list(differences(drives))
    open_questions = _items(unresolved_pairs([c for c in cells if c.measure == SCORE]))
    return fill(
        "regret/caution.md.j2", facts=_facts(drives), table=markdown(tables.changes(cells, "")), open=open_questions
    )


def _draw(
    page: Page | None,
    total: Sequence[Cell] = (),
    shares: Sequence[Attribution] = (),
    errors: pd.DataFrame | None = None,
    doses: Sequence[Cell] = (),
) -> None:
    """Draw the pictures of a part beside the page; arguments as those of `figures_regret.plots`."""
    if page is not None:
        table = pd.DataFrame() if errors is None else errors
        plots = figures_regret.plots(total, shares, table, doses)
        for figure in draw(plots, page.docs / "pictures", "regret-"):
            console.print(f"picture  {figure.path}", soft_wrap=True)


def _facts(drives: pd.DataFrame) -> str:
    seeds = tuple(sorted(drives["seed"].unique().tolist()))
    planners = ", ".join(f"`{p}`" for p in drives["planner"].unique())
    return (
        f"{len(drives)} drives, {drives['cpu'].sum() / 60:.0f} CPU minutes: {drives['scenario'].nunique()} scenarios, "
        f"planners {planners}, {len(seeds)} seeds ({seeds_text(seeds)})."
    )


def _items(sentences: Sequence[str]) -> str:
    return "\n".join(f"- {sentence}" for sentence in sentences)

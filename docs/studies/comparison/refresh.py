"""Committed results repeated with the code at hand, bit for bit as far as their digits reach.

`PYTHONPATH=docs python -m studies refresh` repeats samples of the drives of regret and of the probes, and everything in
`KEPT`: limits of probes, a small case of each paper, and drives of regret, with all digits. Where a number is not the
committed one, a table says which, and the exit status is 1. Runs of the benchmark have `testbed benchmark check`.

A part says what it has committed and how a piece of it is made again; `PARTS` is the only place where the rest of the
testbed comes in.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isclose, isnan, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd
import typer
from rich.markup import escape

from studies.page import steps
from studies.papers.cases import CASES
from studies.probes import drives as probes
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.tables import light_table
from testbed.command_line.terminal import console, user_input
from testbed.evaluation.metric import old_names
from testbed.experiments import probe as probing
from testbed.experiments.engine import Engine, check, perform
from testbed.experiments.pairs import KEY as DRIVE_KEY
from testbed.experiments.pairs import SCORE, Drive
from testbed.experiments.probe import limit, parameter_of
from testbed.experiments.regret import DRIVES, Regret
from testbed.experiments.run import FAILED, Outcome, Run, outcome_of
from testbed.experiments.store import Store
from testbed.files import write_json
from testbed.frame import TRUTH
from trackers import DEFAULT
from trackers.lookup import look_up

KEPT = "repeated.json"
LIMITS = (  # probe, tracker, seed, resolution
    ("probe-passing", TRUTH, 0, 0.05),
    ("probe-passing", TRUTH, 1, 0.05),
    ("probe-passing", "imm-spline", 0, 0.1),
    ("probe-passing", "rm-koch", 0, 0.1),  # survives nothing
    ("probe-brake", "imm-spline", 0, 4.0),
)
EXACT = (  # scenario, planner, condition, seed
    ("probe-cutin", "mpc", "imm-spline", 200),
    ("probe-oncoming", "idm", "rm-feldmann:EG", 201),
    ("probe-merge", "tree", "in-view+latency=0.2", 202),
    ("probe-brake", "mpc-cautious", "edra-imm+drop:0.2", 203),
    ("probe-jam", "idm", "truth", 204),
)
OLD = old_names("drives")  # of metrics of drives, in `KEPT`
SHOWN = 40  # rows of the table
SEARCHED = 1e-5  # relative: a paper's descent ends elsewhere on another processor, once 1.3e-7 apart
NOT_ALONE = ("cpu", SCORE)  # not compared: the time differs, the score needs the drive on the truth too
DIGITS = 9  # significant; that tell a float32 from its neighbours
Numbers = dict[str, float]


class Piece(NamedTuple):
    """What is repeated at once: a run, a drive, a limit, a case."""

    part: str
    name: str
    group: str  # no group has two in a sample before every one has one
    arguments: tuple[Any, ...]  # of the part's function

    @property
    def title(self) -> str:
        """Part and name."""
        return f"{self.part}: {self.name}"


class Part(NamedTuple):
    """Committed results of one kind."""

    pieces: Callable[[Path], list[Piece]]  # in a folder of results
    committed: Callable[[Path, Sequence[Piece]], Iterator[Numbers]]
    again: Callable[..., Numbers]  # of (folder, *arguments): the same numbers by the code at hand


class Mismatch(NamedTuple):
    """One number that is not the committed one."""

    part: str
    name: str
    measure: str
    committed: float
    now: float


def drives(results: Path) -> list[Piece]:
    """Drives of all parts of the study of regret."""
    return [
        Piece("drives", f"{folder.name}: {drive.name}", drive.condition, (drive, folder.name))
        for folder in sorted(place.parent for place in (results / "regret").glob(f"*/{DRIVES}"))
        for drive in (
            Drive(*row) for row in pd.read_parquet(folder / DRIVES)[[*DRIVE_KEY]].itertuples(index=False, name=None)
        )
    ]


def drives_committed(results: Path, pieces: Sequence[Piece]) -> Iterator[Numbers]:
    """Measures of the drive and errors of its tracker."""
    for piece in pieces:
        drive, folder = piece.arguments
        table = pd.read_parquet(results / "regret" / folder / DRIVES)
        own = table[np.logical_and.reduce([table[key] == value for key, value in drive._asdict().items()])]
        (row,) = own.drop(columns=[*DRIVE_KEY, *NOT_ALONE]).to_dict("records")
        yield row


def drive_again(folder: Path, drive: Drive, *part: str) -> Numbers:
    """The same of a drive made now."""
    study = Regret((drive.scenario,), (drive.planner,), (DEFAULT,), (drive.seed,))
    (found,) = study.make(study.run(drive), Store(study, folder)).spans
    return {
        key: nan if value is None else float(value) for key, value in found.items() if key not in ("phase", *NOT_ALONE)
    }


def exact_drives(results: Path) -> list[Piece]:
    """Some drives of regret with all digits, which change with the machine."""
    return [Piece("exact", drive.name, drive.condition, (drive,)) for drive in map(Drive._make, EXACT)]


def probe_drives(results: Path) -> list[Piece]:
    """Drives of the probes on the truth."""
    known = json.loads((results / "probes.json").read_text())
    return [
        Piece("probes", f"{probe}, seed {seed}", probe, (probe, seed))
        for probe, rows in known["drives"].items()
        for seed in range(len(rows))
    ]


def probes_committed(results: Path, pieces: Sequence[Piece]) -> Iterator[Numbers]:
    """Measures, rounded as they are committed."""
    known = json.loads((results / "probes.json").read_text())["drives"]
    for piece in pieces:
        probe, seed = piece.arguments
        yield known[probe][seed]


def probe_again(folder: Path, probe: str, seed: int) -> Numbers:
    """The same of a drive made now."""
    row = probes.row(probing.driven(probes.drive_of(probe, seed)))
    return {key: nan if value is None else float(value) for key, value in row.items()}


def limits(results: Path) -> list[Piece]:
    """Limits of probes."""
    return [Piece("limits", f"{p} on {t}, seed {s}", t, (p, t, s, step)) for p, t, s, step in LIMITS]


def limit_again(folder: Path, probe: str, tracker: str, seed: int, resolution: float) -> Numbers:
    """The hardest value of the first parameter that is survived."""
    parameter = parameter_of(probe, None)

    def survives(value: float) -> bool:
        run = Run(probe, seed, tracker, config=((parameter.name, value),))
        return probing.survived(probing.find_probe(probe), probing.driven(run))

    return {parameter.name: limit(survives, parameter.easy, parameter.hard, resolution)}


def papers(results: Path) -> list[Piece]:
    """One case of each paper."""
    return [Piece("papers", name, name, (name,)) for name in CASES]


def paper_again(folder: Path, name: str) -> Numbers:
    """All figures of its rows."""
    return {
        f"{row.case}: {row.method}: {key}": float(value) for row in CASES[name]() for key, value in row.measured.items()
    }


def kept(results: Path, pieces: Sequence[Piece]) -> Iterator[Numbers]:
    """Numbers of limits and papers, from `KEPT`."""
    known = json.loads((results / KEPT).read_text())
    for piece in pieces:
        numbers = known[piece.part][piece.name]
        yield {OLD.get(key, key): nan if value is None else value for key, value in numbers.items()}


PARTS: Mapping[str, Part] = {
    "drives": Part(drives, drives_committed, drive_again),
    "probes": Part(probe_drives, probes_committed, probe_again),
    "limits": Part(limits, kept, limit_again),
    "papers": Part(papers, kept, paper_again),
    "exact": Part(exact_drives, kept, drive_again),
}
IN_KEPT = tuple(name for name, part in PARTS.items() if part.committed is kept)


def draw(pieces: Sequence[Piece], sample: int, seed: int) -> list[Piece]:
    """A sample of pieces; no group has two before every one has one, and so on."""
    count: dict[str, int] = {}
    ranked = []
    for k in np.random.default_rng(seed).permutation(len(pieces)):
        group = pieces[k].group
        count[group] = count.get(group, 0) + 1
        ranked.append((count[group], pieces[k]))
    return [piece for _, piece in sorted(ranked, key=lambda item: item[0])[:sample]]


def again(piece: Piece, folder: Path) -> Outcome:
    """Make a piece again; the numbers are the note of the outcome, as JSON."""
    return outcome_of(piece.title, lambda: json.dumps(PARTS[piece.part].again(folder, *piece.arguments)))


def repeat(pieces: Sequence[Piece], engine: Engine, folder: Path) -> dict[str, Outcome]:
    """Make the pieces again, in a folder without others; outcomes by title."""
    outcomes = {}
    with steps(len(pieces)) as step:
        for outcome in perform(again, [(piece, folder) for piece in pieces], engine):
            step(outcome.name)
            outcomes[outcome.name] = outcome
    return outcomes


def mismatches(piece: Piece, committed: Numbers, now: Numbers) -> Iterator[Mismatch]:
    """Numbers of a piece that are not the committed ones; NaN stands for what was not measured."""
    measures = {_measure(key) for key in committed}
    for key in dict.fromkeys([*committed, *(key for key in now if _measure(key) in measures)]):
        a, b = float(committed.get(key, nan)), float(now.get(key, nan))
        if piece.part != "exact":
            a, b = _float32(a), _float32(b)
        near = piece.part == "papers" and isclose(a, b, rel_tol=SEARCHED)
        if a != b and not near and not (isnan(a) and isnan(b)):
            yield Mismatch(piece.part, piece.name, key, a, b)


def _float32(value: float) -> float:
    """A number without the last digits, in which processors and versions of numpy differ."""
    return float(np.float32(value))


def _measure(key: str) -> str:
    return key.rpartition(": ")[2]


def main(
    results: Annotated[Path, typer.Option(help="Directory of the committed results.")] = Path("docs/results"),
    part: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(PARTS)}; by default all.")] = None,
    sample: Annotated[int, typer.Option(min=1, help="How many pieces of each part.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the samples.")] = 0,
    jobs: Jobs = 1,
    dask: Dask = None,
    keep: Annotated[bool, typer.Option("--keep", help=f"Write {KEPT} anew, and hold nothing against it.")] = False,
) -> None:
    """Repeat samples of what is committed; exit status 1 where a number is another."""
    with user_input(), TemporaryDirectory() as folder:
        engine = Engine(jobs, dask)
        check(engine)
        chosen = IN_KEPT if keep else tuple(part or PARTS)
        pieces = [
            piece for name in chosen for piece in draw(look_up(name, PARTS, "part").pieces(results), sample, seed)
        ]
        outcomes = repeat(pieces, engine, Path(folder))
    if failed := [outcome for outcome in outcomes.values() if outcome.status == FAILED]:
        for outcome in failed:
            console.print(f"failed   {outcome.name}\n{outcome.note}", markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(1)
    now = {piece: json.loads(outcomes[piece.title].note) for piece in pieces}
    with user_input((OSError, ValueError)):
        if keep:
            known = {name: {p.name: _nulls(now[p]) for p in pieces if p.part == name} for name in IN_KEPT}
            write_json(results / KEPT, known)
            console.print(f"kept     {results / KEPT}", soft_wrap=True)
            return
        found = [m for name in chosen for m in _differing(results, name, now)]
        if found:
            console.print(_table(found))
            raise typer.Exit(1)
        for name in chosen:
            equal = ", ".join(piece.name for piece in pieces if piece.part == name)
            console.print(f"equal    {name}: {equal}", soft_wrap=True, highlight=False)


def _differing(results: Path, part: str, now: Mapping[Piece, Numbers]) -> Iterator[Mismatch]:
    pieces = [piece for piece in now if piece.part == part]
    for piece, committed in zip(pieces, PARTS[part].committed(results, pieces), strict=True):
        yield from mismatches(piece, committed, now[piece])


def _nulls(numbers: Numbers) -> dict[str, float | None]:
    return {key: None if isnan(value) else value for key, value in numbers.items()}


def _table(found: Sequence[Mismatch]) -> Any:
    table = light_table(f"{len(found)} numbers that are not the committed ones")
    for head in ("part", "piece", "measure"):
        table.add_column(head, overflow="fold")
    for head in ("committed", "now"):
        table.add_column(head, justify="right")
    for m in found[:SHOWN]:
        table.add_row(*map(escape, m[:3]), f"{m.committed:.{DIGITS}g}", f"{m.now:.{DIGITS}g}")
    if len(found) > SHOWN:
        table.add_row(f"and {len(found) - SHOWN} more", *[""] * 4)
    return table

"""`testbed benchmark`: the commands, each of which imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

import typer

from testbed.command_line import options
from testbed.command_line.terminal import busy, show, user_input

app = typer.Typer(help="Benchmarks with a version: run, score, check, and tables of entries.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="A name of `testbed benchmark list`.")]
Phrase = Annotated[
    str | None, typer.Option(help="The seeds are made from it. Without it: the development seeds, which all know.")
]
Track = Annotated[list[str] | None, typer.Option(help="open, closed or faults; repeat. Without it: all.")]
First = Annotated[int | None, typer.Option(help="Only so many of the seeds. Without it: all.")]


@app.command("list")
def list_benchmarks() -> None:
    """Show the benchmarks and their tracks.

    Example: [bold]testbed benchmark list[/bold]
    """
    from testbed.command_line.tables import filled_table
    from testbed.experiments.benchmark.definition import BENCHMARKS, frozen

    for benchmark in BENCHMARKS.values():
        now = "as frozen" if benchmark.digests() == frozen(benchmark) else "not as frozen"
        rows = [
            (t.name, t.what, f"{len(t.case_names)} cases", f"{len(benchmark.development)} seeds", t.measure)
            for t in benchmark.tracks
        ]
        heads = ("track", "what", "cases", "seeds", "ranked by")
        show(filled_table(f"{benchmark.name}, {now}", heads, rows, heads, overflow="fold"))


@app.command()
def run(
    name: Name,
    tracker: Annotated[list[str] | None, typer.Option(help="Repeat for several, or all.")] = None,
    phrase: Phrase = None,
    track: Track = None,
    first: First = None,
    jobs: options.Jobs = 1,
    dask: options.Dask = None,
    out: options.Results = Path("runs/benchmark"),
) -> None:
    """Make all runs of trackers, or of all, and an entry of each: OUT/NAME_TRACKER_SEEDS.json.

    After Ctrl-C the same command does the rest.

    Example: [bold]testbed benchmark run v1 --tracker rm-feldmann --jobs 2[/bold]
    Example: [bold]testbed benchmark run v1 --tracker my_ekf:CentroidEKF --phrase "rain on Tuesday"[/bold]
    """
    from testbed.experiments.benchmark.runs import BenchmarkRuns
    from testbed.experiments.command import run_study
    from testbed.experiments.run import expand
    from trackers import DEFAULT

    given = expand(tracker or [DEFAULT], "trackers"), phrase, tuple(track or ()), first
    run_study(lambda: BenchmarkRuns(name, *given, out=str(out)), jobs, dask)


@app.command()
def record(
    name: Name,
    out: Annotated[Path, typer.Option(help="Folder for the recordings.")],
    phrase: Phrase = None,
    track: Track = None,
    first: First = None,
    format: options.Format = "csv",
) -> None:
    """Write the recordings of the tracks in open loop, for trackers in any language; those that are there are kept.

    Example: [bold]testbed benchmark record v1 --out recordings[/bold]
    """
    from testbed.experiments.benchmark import runs
    from testbed.experiments.benchmark.definition import find
    from testbed.files import make_directory, write_json
    from trackers import DEFAULT

    with user_input():
        benchmark = find(name)
        tracks = track or [one.name for one in benchmark.tracks]
        study = runs.BenchmarkRuns(name, (DEFAULT,), phrase, tuple(track or ()), first, out=str(out / "drives"))
        work = runs.recorded(benchmark, phrase, tracks, first)
        make_directory(out)
        write_json(out / runs.LISTED, {"benchmark": name, "phrase": phrase, **benchmark.digests()})
    for place in work:
        folder = runs.folder_of(place.case, place.run.seed)
        if not (out / folder / f"lanes.{format}").exists():  # the last table
            with user_input((OSError,)), busy(folder):
                runs.record(place, study, out, format)
            show(f"recorded  {out / folder}")


@app.command()
def score(
    name: Name,
    tracks: Annotated[list[str], typer.Argument(help="Files of tracks, patterns, folders; docs/own-tracks.md.")],
    against: Annotated[Path, typer.Option(help="The folder that `testbed benchmark record` has written.")],
    called: Annotated[str, typer.Option("--name", help="Of the tracker.")],
    columns: options.Columns = None,
    tolerance: options.Tolerance = 0.01,
    interpolate: options.Interpolate = False,
    jobs: options.Jobs = 1,
    out: options.Results = Path("runs/benchmark-score"),
) -> None:
    """Score tracks of any origin on the recordings of a benchmark, and write the entry.

    Example: [bold]testbed benchmark score v1 'mine/*.csv' --against recordings --name mine[/bold]
    """
    from testbed.experiments.benchmark.definition import find
    from testbed.experiments.benchmark.runs import ScoredTracks
    from testbed.experiments.command import run_study
    from testbed.replay.pairing import Files

    def study() -> ScoredTracks:
        find(name)
        files = Files.of(tracks, [str(against)], columns, tolerance, interpolate)
        return ScoredTracks.of_folder(name, against, called, files.each, files.recordings, str(out))

    run_study(study, jobs, None)


@app.command()
def check(
    entry: Annotated[Path, typer.Argument(help="What `testbed benchmark run` or `score` has written.")],
    again: Annotated[Path | None, typer.Argument(help="Another entry, to compare with instead.")] = None,
    runs: Annotated[int | None, typer.Option(help="So many of them, drawn by the entry. Without it: all.")] = None,
    jobs: options.Jobs = 1,
    out: options.Results = Path("runs/benchmark-check"),
) -> None:
    """Make the runs of an entry again, and compare every value. Exit status 1: one differs.

    An entry of files of tracks is compared with one that was scored again.

    Example: [bold]testbed benchmark check v1_rm-feldmann_development.json --runs 10[/bold]
    """
    from testbed.experiments.benchmark.checking import Again, of_files
    from testbed.experiments.command import run_study

    if again is not None:
        with user_input():
            found = of_files(entry, again)
        show(*found.shown)
        raise typer.Exit(int(found.failed))

    run_study(lambda: Again.of(entry, runs, str(out)), jobs, None)


@app.command()
def table(
    folder: Annotated[Path, typer.Argument(help="With entries, also below.")],
    out: Annotated[Path | None, typer.Option(help="Also as markdown, in this file.")] = None,
) -> None:
    """Show the table of all entries: intervals, and ranks that say what is not resolved.

    Example: [bold]testbed benchmark table runs[/bold]
    """
    from testbed.experiments.benchmark.entries import read_all
    from testbed.experiments.benchmark.table import page, shown
    from testbed.files import write_atomic

    with user_input():
        entries = read_all(folder)
        show(*shown(entries))
        if out is not None:
            write_atomic(out, page(entries))


@app.command(hidden=True)
def freeze(name: Name) -> None:
    """Write the digests of the present code as those of a version; before 1.0.0 only, and in a checkout."""
    from testbed.experiments.benchmark.definition import find
    from testbed.experiments.benchmark.definition import freeze as write

    with user_input():
        show(f"frozen   {write(find(name))}")

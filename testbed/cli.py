"""The command line. Options are what people vary; each command imports what it needs when it is called."""

import shlex
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

import testbed
from scenarios.drivers import DEFAULT as ALIKE
from scenarios.drivers import with_drivers
from testbed.command_line import options, tables
from testbed.command_line.terminal import (
    busy,
    complain,
    console,
    drop_stdout,
    lenient_streams,
    losses,
    progress_bar,
    reported,
    show,
    user_input,
)
from testbed.experiments.benchmark.command import app as benchmark
from testbed.files import LostFileWarning
from testbed.limits import check_choice
from trackers import DEFAULT

app = typer.Typer(
    name="testbed",
    help="Closed-loop highway simulation testbed for extended object tracking with automotive radar.\n\n"
    "Example: [bold]testbed run cut-in[/bold]",
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)


app.add_typer(benchmark, name="benchmark")


def show_version(wanted: bool) -> None:
    """Print the version and exit, if it is wanted."""
    if wanted:
        console.print(f"testbed {testbed.__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """What comes before a command."""


@app.command("list")
def list_command(
    what: Annotated[str, typer.Argument(help="scenarios, probes, trackers, radars, planners, metrics, all.")] = "all",
) -> None:
    """Show what there is: scenarios, probes, trackers, radars, planners and metrics, a line each.

    Example: [bold]testbed list scenarios[/bold]
    """
    with user_input():
        chosen = tables.catalogues(what)
    show(*chosen)


@app.command()
def run(
    scenario: options.Scenario,
    tracker: options.Trackers = None,
    radar: options.Radar = "surround",
    planner: options.Planner = "idm",
    seed: options.Seed = 0,
    duration: options.Duration = None,
    after: options.After = None,
    out: Annotated[Path, typer.Option(help="Directory for the log and the results.")] = Path("runs"),
    log: options.Log = "full",
    no_metrics: Annotated[bool, typer.Option("--no-metrics", help="No measures, for speed; needs --log off.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(help="Of the radar, such as front:outage:3:5; repeat for several at once. docs/faults.md."),
    ] = None,
    config: Annotated[Path | None, typer.Option(help="JSON file of the environment's config.")] = None,
    focus: options.Focus = None,
    drivers: options.Drivers = ALIKE,
) -> None:
    """Run one scenario in closed loop: traffic, radar, tracker, planner.

    All trackers get the same detections. Writes RUN.rrd (the review log) and
    RUN.json (the results) and prints the metrics. Ctrl-C ends the run early and
    keeps what there is; a second Ctrl-C does not wait.

    Your own code, MODULE:OBJECT, and ids of highway-env stand wherever a name
    does; docs/own-code.md has an example of each.

    Example: [bold]testbed run cut-in[/bold]
    Example: [bold]testbed run merge --tracker htg-map --tracker rm-feldmann --radar front --seed 3[/bold]
    Example: [bold]testbed run cut-in --fault front:outage:3:5 --fault drop:0.2[/bold]
    Example: [bold]testbed run highway-v0 --config cfg.json --tracker my_ekf:CentroidEKF[/bold]

    Recorded traffic: [bold]testbed run replay:i80.csv:ego=12,react=5[/bold]; docs/real-traffic.md
    """
    from testbed.environment.validation import WrongTracks
    from testbed.experiments.single import RunConfig, Unusable, check, length
    from testbed.experiments.single import run as run_once

    with user_input():
        scenario = with_drivers(scenario, drivers)
        driven = scenario, tuple(tracker or (DEFAULT,)), radar, planner, seed, duration
        file, faults = None if config is None else str(config), tuple(fault or ())
        settings = RunConfig(*driven, str(out), log, not no_metrics, faults, file, focus, after)
        check(settings)
    with user_input((OSError, Unusable, WrongTracks)), progress_bar("{task.completed:.1f} / {task.total:.1f} s") as bar:
        task = bar.add_task(f"{scenario}, seed {seed}", total=length(settings))
        result = run_once(settings, lambda done, total: bar.update(task, completed=done, total=total))
    with losses(result.lost):
        tables.show_run(result.result, {"results": result.json, "log": result.rrd}, focus, console)
    raise typer.Exit(result.exit_status)


@app.command()
def replay(
    folder: Annotated[list[Path], typer.Argument(help="Of tables, see docs/own-recordings.md, or of such folders.")],
    tracker: options.Trackers = None,
    start: Annotated[float | None, typer.Option("--from", help="Seconds after the first scan. Without it: 0.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Seconds after the first scan. Without it: all.")] = None,
    out: Annotated[Path, typer.Option(help="Directory for the log, the results and the tracks.")] = Path("runs"),
    log: options.Log = "full",
    fix: options.Fixes = None,
    accept: options.Accept = False,
    format: options.Format = "parquet",
) -> None:
    """Give recordings of your own to trackers: tables in, tracks out.

    FOLDER holds the tables detections, ego and sensors, as .csv or .parquet, and
    if there are any, scans, truth and lanes. Writes RUN.parquet or RUN.csv (the
    tracks), RUN.rrd (the review log) and RUN.json (the results, where there is truth).

    Example: [bold]testbed replay drive --tracker imm-spline --tracker rm-feldmann --from 5 --to 10[/bold]
    """
    from testbed.replay import command
    from testbed.replay.pairing import recordings_in
    from testbed.replay.replaying import ReplayConfig, prepare

    status, trackers, fixes = 0, tuple(tracker or (DEFAULT,)), tuple(fix or ())
    with user_input():
        recordings = [inner for path in folder for inner in recordings_in(path) or [path]]
    for one in recordings:
        with user_input(), busy(f"reading {one}"):
            settings = ReplayConfig(str(one), trackers, start, end, str(out), log, fixes, accept, format=format)
            recorded = prepare(settings)
        status = max(status, command.replayed(settings, recorded, console))
        if status > 2:  # a signal ended it
            break
    raise typer.Exit(status)


@app.command()
def score(
    tracks: Annotated[
        list[str], typer.Argument(help="Files of tracks, patterns, folders; a folder of tables is one of --against.")
    ],
    against: Annotated[
        list[str], typer.Option(help="Recording, pattern, or folder of recordings. Repeat for several.")
    ],
    tracker: Annotated[list[str] | None, typer.Option(help="Ours, on the same detections. Repeat for several.")] = None,
    name: Annotated[str | None, typer.Option(help="Of the tracks. Without it: that of the file, or tracks.")] = None,
    columns: options.Columns = None,
    tolerance: options.Tolerance = 0.01,
    interpolate: options.Interpolate = False,
    out: Annotated[Path, typer.Option(help="Directory for log, results and report.")] = Path("runs/score"),
    log: options.Log = "full",
    accept: options.Accept = False,
    jobs: options.Jobs = 1,
) -> None:
    """Score tracks of any origin, CSV or Parquet, against recordings: measures, log, report as of our trackers.

    A file belongs to the recording that its name begins with. Of one recording:
    RUN.json, RUN.rrd; of several: a comparison as of `testbed compare`.
    docs/own-tracks.md has the columns.

    Example: [bold]testbed score mine.csv --against recordings/cut-in --tracker imm-spline[/bold]
    Example: [bold]testbed score 'mine/*.csv' --against recordings --name mine --jobs 2[/bold]
    """
    from testbed.experiments.command import run_study
    from testbed.experiments.recorded import RecordedComparison
    from testbed.replay import command
    from testbed.replay.pairing import Files
    from testbed.replay.replaying import ReplayConfig, prepare

    with user_input(), busy("reading"):
        files = Files.of(tracks, against, columns, tolerance, interpolate)
        single = files.named(name) if len(files.recordings) == 1 else ()
        if single:
            folder, trackers = str(files.recordings[0]), tuple(tracker or ())
            settings = ReplayConfig(folder, trackers, out=str(out), log=log, accept=accept, tracks=single)
            recorded = prepare(settings)
    if single:
        raise typer.Exit(command.replayed(settings, recorded, console))

    def study() -> RecordedComparison:
        found = {name or "tracks": files.each}
        return RecordedComparison.of(files.recordings, tracker or (), found, accept=accept, out=str(out))

    run_study(study, jobs, None)


@app.command()
def record(
    scenario: Annotated[list[str], typer.Argument(help="Names of `testbed list scenarios`.")],
    out: Annotated[Path, typer.Option(help="Folder for the tables, or of several recordings for theirs.")],
    seed: options.Seed = 0,
    seeds: Annotated[
        str | None, typer.Option(help="Several: 0:20, or a list 0,3,7. Each goes into its folder.")
    ] = None,
    radar: options.Radar = "surround",
    duration: options.Duration = None,
    format: options.Format = "parquet",
) -> None:
    """Record the scans of scenarios and their truth, as tables that `testbed replay` reads.

    The planner gets the true state, so that the scans depend on no tracker. A
    tracker gives the same tracks on the tables as in the scenario. Several go
    into OUT/SCENARIO_seedN; those that are there are kept.

    Example: [bold]testbed record cut-in --seed 3 --out recordings/cut-in --format csv[/bold]
    Example: [bold]testbed record cut-in merge --seeds 0:20 --out recordings[/bold]
    """
    from testbed.experiments.run import parse_seeds
    from testbed.replay import command

    with user_input():
        drives = command.drives(scenario, seed if seeds is None else parse_seeds(seeds), out)
        for drive in drives:
            command.check(*drive, radar, duration, format)
    for name, number, folder in drives:
        with user_input((OSError,)), busy(f"driving {name}, seed {number}"):
            written = command.record(name, number, folder, radar, duration, format)
        show(*([f"{path.stem:10} {path}" for path in written] if len(drives) == 1 else [f"recorded  {folder}"]))
    show(f"replay it  testbed replay {shlex.quote(str(drives[0][2]))}")


@app.command()
def review(
    path: Annotated[list[Path] | None, typer.Argument(help="Logs (.rrd) of runs; of a folder the newest.")] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve the viewer to a browser on this machine.")] = False,
    screenshot: Annotated[Path | None, typer.Option(help="Write a picture (.png) instead of opening a window.")] = None,
    at: Annotated[float | None, typer.Option(help="Seconds, of the picture. Without it: the middle one.")] = None,
    view: Annotated[str | None, typer.Option(help="Name of a view, or its begin: a picture of that alone.")] = None,
    focus: options.Focus = None,
    gif: Annotated[Path | None, typer.Option(help="Write an animation (.gif) from above instead.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write one page (.html) for a browser instead.")] = None,
    report: Annotated[Path | None, typer.Option(help="Serve a folder of results to a browser on this machine.")] = None,
) -> None:
    """Open the logs of runs in the viewer, or make a page, an animation or a picture of one.

    Example: [bold]testbed review runs/*.rrd[/bold]
    Example: [bold]testbed review runs[/bold]
    Example: [bold]testbed review runs/a.rrd --html a.html[/bold]
    Example: [bold]testbed review runs/a.rrd --gif a.gif[/bold]
    Example: [bold]testbed review runs/a.rrd --screenshot a.png --at 9 --view overview[/bold]
    Example: [bold]testbed review runs/a.rrd --focus 3[/bold]
    Example: [bold]testbed review --report runs/compare[/bold]
    """
    from testbed.command_line import reviewing

    with user_input():
        reviewing.show(path or [], reviewing.Options(web, screenshot, at, view, focus, gif, html, report), console)


@app.command()
def diff(
    first: Annotated[Path, typer.Argument(help="A log (.rrd) or results (.json) of a run.")],
    second: Annotated[Path, typer.Argument(help="Another of the same kind.")],
) -> None:
    """Say at which step two runs part, and what differs there; of results, which values differ.

    Exit status 1: they differ. Numbers are compared exactly; what a run took is
    left out.

    Example: [bold]testbed diff before/cut-in.rrd after/cut-in.rrd[/bold]
    """
    from testbed.command_line import differences

    with user_input():
        status = differences.show(first, second, console)
    raise typer.Exit(status)


@app.command()
def check(
    what: Annotated[str, typer.Argument(help="tracker, planner, radar, scenario or recording.")],
    name: Annotated[str, typer.Argument(help="MODULE:OBJECT or a name, also with :KEY=VALUE,KEY=VALUE; or a folder.")],
    fix: options.Fixes = None,
) -> None:
    """Check your own code against the laws that every entry of the catalogue keeps, and say which it breaks.

    Of a recording: what its numbers say about each other, and what cannot be
    right. Exit status 1: a law is broken. The bracket behind a fault repeats
    it in Python.

    Example: [bold]testbed check tracker my_ekf:CentroidEKF[/bold]
    Example: [bold]testbed check recording drive --fix range_rate=km/h[/bold]
    """
    from testbed.check import command

    with user_input():
        if what == "recording":
            from testbed.replay.command import report

            raise typer.Exit(report(Path(name), tuple(fix or ()), console))
        found = command.results(what, name)
    raise typer.Exit(command.show(name, found, console))


@app.command()
def radar(
    what: Annotated[str, typer.Argument(help="show.")],
    name: Annotated[str, typer.Argument(help="A name of `testbed list radars`, MODULE:OBJECT, or a file.")],
) -> None:
    """Write a radar as TOML, to be changed and given as `--radar FILE.toml`.

    Example: [bold]testbed radar show surround > my.toml[/bold]
    """
    from sensors import find
    from sensors.radar_file import text_of

    with user_input():
        check_choice("what", what, ("show",))
        text = text_of(find(name))
    print(text)


@app.command()
def scenario(
    what: Annotated[str, typer.Argument(help="show.")],
    name: Annotated[str, typer.Argument(help="A name of `testbed list scenarios`, MODULE:OBJECT, or a file.")],
) -> None:
    """Write a scenario as TOML, to be changed and given in place of a name, `testbed run my.toml`.

    Example: [bold]testbed scenario show cut-in > my.toml[/bold]
    """
    from scenarios import find
    from scenarios.scenario_file import text_of

    with user_input():
        check_choice("what", what, ("show",))
        text = text_of(find(name))
    print(text)


@app.command()
def bench(
    scenario: Annotated[list[str] | None, typer.Argument(help="Scenarios. Without it: all benchmarks.")] = None,
    tracker: Annotated[list[str] | None, typer.Option(help="Repeat for several, on the same scans.")] = None,
    radar: Annotated[list[str] | None, typer.Option(help="Repeat for several, one after the other.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions.")] = False,
) -> None:
    """Measure speed: ratios of CPU times that are taken in turn in this run.

    With a scenario, tracker or radar: what a frame costs with these, where the
    planner gets the tracks of the first tracker.

    Example: [bold]testbed bench --quick[/bold]
    Example: [bold]testbed bench cut-in --tracker rm-koch --tracker imm-spline --radar imaging[/bold]
    """
    from testbed import bench as benching
    from testbed.bench import chosen

    with user_input():
        choice = chosen.Choice.of(scenario, tracker, radar, quick)
        choice.check()
    named = scenario or tracker or radar
    show(*reported(partial(chosen.measure, choice) if named else partial(benching.measure, quick), "benchmarks"))


@app.command()
def info(
    compile: Annotated[bool, typer.Option("--compile", help="Compile now, once for many processes.")] = False,
) -> None:
    """Show versions, extras, and whether tracker and radar are compiled.

    Example: [bold]testbed info[/bold]
    """
    from testbed.command_line.info import info as found

    if compile:
        from testbed.bench.compile import compile_all

        compile_all()
    show(found())


@app.command("learn-htg")
def learn_htg(
    data: options.Detections,
    out: Annotated[Path, typer.Option(help="The table, a .json file.")],
    bins: Annotated[int, typer.Option(help="Number of aspect bins.")] = 8,
    mass_min: Annotated[
        float, typer.Option(help="Least mass inside the bounds; .25 for filters with pseudo-measurements.")
    ] = 0.0,
    count: options.Count = 60000,
    seed: options.Seed = 0,
    edges: Annotated[bool, typer.Option("--edges", help="Edges, not middles, of bins at 0 and 180 degrees.")] = False,
    no_mirror: options.NoMirror = False,
) -> None:
    """Learn a table of truncated Gaussians, one for each aspect bin, from detections; docs/learning.md has the formats.

    Example: [bold]testbed learn-htg sampler:surround:car --out car.json[/bold]
    """
    from testbed.learn.models import TableConfig, learn

    with user_input():
        config = TableConfig(data, bins, not edges, not no_mirror, mass_min, count, seed)
        learned = reported(partial(learn, config, out), "learning")
    show(*learned.report(), f"table    {learned.path}")


@app.command("learn-spline")
def learn_spline(
    data: options.Detections,
    out: Annotated[Path, typer.Option(help="The model, a .json file.")],
    ellipses: Annotated[int, typer.Option(help="Number of ellipses on the contour.")] = 24,
    points: Annotated[int, typer.Option(help="Number of its control points.")] = 12,
    visibility: Annotated[str, typer.Option(help="rays: ellipses weighed by visibility; none: all alike.")] = "rays",
    count: options.Count = 20000,
    seed: options.Seed = 0,
    no_mirror: options.NoMirror = False,
) -> None:
    """Learn ellipses on a B-spline contour, the model of the pmht-spline trackers; data as for learn-htg.

    Example: [bold]testbed learn-spline sampler:surround:car --out car.json[/bold]
    """
    from testbed.learn.models import SplineConfig, learn
    from trackers.pmht.offline import OfflineLearning

    with user_input():
        model = OfflineLearning(ellipses, points, visibility=visibility, mirrored=not no_mirror)
        config = SplineConfig(data, count, seed, model)
        learned = reported(partial(learn, config, out), "learning")
    show(*learned.report(), f"model    {learned.path}")


@app.command()
def compare(
    scenario: Annotated[list[str] | None, typer.Argument(help="Names of `testbed list scenarios`, or all.")] = None,
    tracker: options.EveryTracker = None,
    seeds: options.Seeds = "0:20",
    reference: Annotated[
        str | None, typer.Option(help="The tracker that the others are compared with. Without it: the first.")
    ] = None,
    radar: options.Radar = "surround",
    loop: Annotated[str, typer.Option(help="open: all get the same scans; closed: the planner uses each.")] = "open",
    planner: options.Planner = "idm",
    fault: options.Faults = None,
    duration: options.Duration = None,
    after: options.After = None,
    settle: Annotated[float, typer.Option(help="Seconds at the start of a run of which no scan enters a mean.")] = 0.0,
    jobs: options.Jobs = 1,
    dask: options.Dask = None,
    out: options.Results = Path("runs/compare"),
    recording: Annotated[
        list[str] | None, typer.Option(help="In place of scenarios: a recording, pattern, or folder of them; repeat.")
    ] = None,
    tracks: Annotated[list[str] | None, typer.Option(help="NAME=PATTERN, files of tracks of these; repeat.")] = None,
    columns: options.Columns = None,
    tolerance: options.Tolerance = 0.01,
    interpolate: options.Interpolate = False,
    accept: options.Accept = False,
    drivers: options.Drivers = ALIKE,
) -> None:
    """Compare trackers on common random numbers: tables with 95 % intervals, Parquet, figures, a report page.

    Every finished run has its file in OUT/rows, so after Ctrl-C the same
    command does the rest, and another machine may work on the same folder. Exit
    status 1: some runs failed; their tracebacks are shown.

    Example: [bold]testbed compare cut-in merge --tracker htg-map --tracker rm-feldmann --seeds 0:20 --jobs 2[/bold]
    Example: [bold]testbed compare cut-in --tracker imm-spline --fault drop:0.2 --fault front:outage:3:5[/bold]
    Example: [bold]testbed compare all --seeds 0:5 --after 3 --settle 2 --jobs -1 --reference htg-map[/bold]
    Example: [bold]testbed compare --recording recordings --tracker imm-spline --tracks mine='mine/*.csv'[/bold]
    """
    from testbed.experiments.command import run_study
    from testbed.experiments.compare import Comparison, Settings
    from testbed.experiments.recorded import RecordedComparison
    from testbed.experiments.run import expand, parse_seeds, with_faults
    from testbed.replay.pairing import Files

    def study() -> Comparison:
        if recording or tracks:
            other = [
                scenario,
                fault,
                duration,
                after,
                drivers != ALIKE,
                loop != "open",
                radar != "surround",
                seeds != "0:20",
            ]
            if not recording or any(other):
                raise ValueError("recordings are compared as they are; give --recording, without scenarios and --seeds")
            files = [Files.of([t.partition("=")[2]], recording, columns, tolerance, interpolate) for t in tracks or ()]
            found = {t.partition("=")[0]: f.each for t, f in zip(tracks or (), files, strict=True)}
            folders = files[0].recordings if files else Files.of((), recording).recordings
            trackers = expand(tracker or [], "trackers")
            return RecordedComparison.of(folders, trackers, found, settle, reference, accept, out=str(out))
        if not scenario:
            raise ValueError("give the names of scenarios, or all; or recordings with --recording")
        cases = with_faults([with_drivers(s, drivers) for s in expand(scenario, "scenarios")], fault or ())
        trackers = expand(tracker or ["all"], "trackers")
        settings = Settings(radar, loop, planner, duration, after, settle)
        return Comparison(cases, trackers, parse_seeds(seeds), settings, reference, out=str(out))

    run_study(study, jobs, dask)


@app.command()
def regret(
    scenario: Annotated[
        list[str] | None,
        typer.Argument(help="Probes or other scenarios, also NAME:parameter=value. Without: all probes."),
    ] = None,
    planner: Annotated[list[str] | None, typer.Option(help="Repeat for several. Without it: idm.")] = None,
    tracker: Annotated[
        list[str] | None, typer.Option(help=f"Repeat for several. Without it: {DEFAULT}, unless errors are injected.")
    ] = None,
    fault: options.Faults = None,
    seeds: options.Seeds = "200:220",
    attribute: Annotated[bool, typer.Option("--attribute", help="Also what each group of errors costs.")] = False,
    inject: Annotated[list[str] | None, typer.Option(help="NAME=VALUE, an error of what is in view; repeat.")] = None,
    limit: Annotated[
        list[str] | None, typer.Option(help="NAME=VALUE, how much worse than on the truth a mean may be; repeat.")
    ] = None,
    radar: options.Radar = "surround",
    duration: options.Duration = None,
    jobs: options.Jobs = 1,
    dask: options.Dask = None,
    junit: options.Junit = None,
    out: options.Results = Path("runs/regret"),
) -> None:
    """What tracking error costs in driving: drives on the truth, on what is in view, and on tracks, paired by seed.

    Every finished drive has its file in OUT/rows, so after Ctrl-C the same
    command does the rest. Exit status 1: some drives failed, or a limit is
    exceeded. docs/methods/regret.md has the definitions.

    Example: [bold]testbed regret probe-brake --tracker imm-spline --tracker rm-koch --seeds 200:208 --jobs 2[/bold]
    Example: [bold]testbed regret probe-brake --fault front:outage:2:3[/bold]
    Example: [bold]testbed regret probe-brake --inject velocity_lag=0.25 --inject velocity_lag=0.5[/bold]
    Example: [bold]testbed regret probe-brake --limit collisions=0 --limit score=0.2 --junit regret.xml[/bold]
    """
    from scenarios.probes import PROBES
    from testbed.experiments.command import run_study
    from testbed.experiments.regret import Limit, Regret
    from testbed.experiments.run import parse_seeds, with_faults

    def study() -> Regret:
        scenarios, planners, errors = tuple(scenario or PROBES), tuple(planner or ["idm"]), tuple(inject or [])
        conditions = with_faults(tracker or ([] if inject else [DEFAULT]), fault or ())
        drives = scenarios, planners, conditions, parse_seeds(seeds)
        limits = tuple(map(Limit.parse, limit or []))
        return Regret(*drives, radar, duration, attribute, errors, limits=limits, out=str(out))

    run_study(study, jobs, dask, junit)


@app.command()
def probe(
    name: Annotated[str, typer.Argument(help="A name of `testbed list probes`.")],
    search: Annotated[str | None, typer.Option(help="The parameter to make harder. Without it: the first one.")] = None,
    planner: options.Planner = "idm",
    tracker: Annotated[str, typer.Option(help="A name of `testbed list trackers`; compared with the truth.")] = DEFAULT,
    radar: options.Radar = "surround",
    seeds: options.Seeds = "0:20",
    resolution: Annotated[float, typer.Option(help="In the unit of the parameter.")] = 0.5,
    jobs: options.Jobs = 1,
    dask: options.Dask = None,
    out: options.Results = Path("runs/probe"),
) -> None:
    """Find the hardest setting of a probe that 95 % of the seeds survive, on the truth and on tracks.

    The difference, in metres where the parameter is a distance, is what tracking
    costs. Every seed's limit is found by bisection and has its file in OUT, so
    after Ctrl-C the same command does the rest. Exit status 1: on tracks no
    setting is survived, or some drives failed.

    Example: [bold]testbed probe probe-brake --search gap --tracker rm-feldmann --jobs 2[/bold]
    """
    from testbed.experiments.command import run_study
    from testbed.experiments.probe import Probe
    from testbed.experiments.run import parse_seeds

    def study() -> Probe:
        return Probe(name, planner, tracker, parse_seeds(seeds), search, resolution, radar, out=str(out))

    run_study(study, jobs, dask)


@app.command()
def regress(
    update: Annotated[bool, typer.Option("--update", help="Write the results as the new baselines.")] = False,
    tracker: options.EveryTracker = None,
    scenario: Annotated[list[str] | None, typer.Option(help="Repeat for several. Without it: all.")] = None,
    fault: options.Faults = None,
    jobs: Annotated[int | None, typer.Option(help="Number of processes. Without it: one a core.")] = None,
    dask: options.Dask = None,
    junit: options.Junit = None,
    baselines: Annotated[Path | None, typer.Option(help="File of baselines. Without it: the committed one.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help="A result without a baseline fails too.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Two scenarios and the default tracker: a minute.")] = False,
    out: Annotated[Path, typer.Option(help="Directory of the runs; those of other code go.")] = Path("runs/regress"),
) -> None:
    """Compare every tracker in every scenario with the committed baselines; docs/regression.md has the rules.

    Exit status 1: a measure got worse, a run failed, or nothing has a baseline; a
    table says which, and a log of the worst run is written. After Ctrl-C the same command does the
    rest. With --update, the changes are printed as a list for a commit message.

    Example: [bold]testbed regress[/bold]
    Example: [bold]testbed regress --tracker htg-map --scenario cut-in --scenario merge --junit regress.xml[/bold]
    Example: [bold]testbed regress --update --tracker htg-map[/bold]
    Example: [bold]testbed regress --quick --tracker my:Tracker --baselines my.json[/bold]
    Example: [bold]testbed regress --scenario cut-in --fault drop:0.2[/bold]
    """
    from testbed.experiments.command import run_study
    from testbed.experiments.regress import COMMITTED, QUICK, Regress

    def study() -> Regress:
        files = {"baselines": baselines or COMMITTED, "update": update, "strict": strict, "out": str(out)}
        scenarios, trackers = (scenario or list(QUICK), tracker or [DEFAULT]) if quick else (scenario, tracker)
        return Regress.of(scenarios, trackers, fault or (), **files)

    run_study(study, jobs, dask, junit)


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(help="hoher2022, xia2020, xia2020-learned, xu2023 or yao2021.")],
    runs: Annotated[int, typer.Option(help="Monte Carlo runs of each case.")] = 100,
    seed: options.Seed = 0,
    out: Annotated[Path, typer.Option(help="Directory for the figures and the results.")] = Path("runs/reproduce"),
    jobs: options.Jobs = -1,
    dask: options.Dask = None,
) -> None:
    """Repeat a paper's experiment: its numbers beside ours, and a verdict on each claim.

    A command of a checkout: the experiments are no part of the package. Exit
    status 1: a claim is not confirmed under any condition. Ctrl-C keeps the
    cases that are finished.

    Example: [bold]testbed reproduce hoher2022 --runs 20[/bold]
    """
    from testbed.command_line.checkout import study
    from testbed.experiments.engine import Engine

    with user_input():
        catalogue = study("papers.catalogue", "testbed reproduce")
        engine = Engine(jobs, dask)
        catalogue.check(paper, runs, seed, out, engine)
    with user_input((OSError,)):
        experiment = partial(catalogue.reproduce, paper, runs, seed, out, engine=engine)
        done = reported(experiment, paper, "{task.percentage:.0f} %", 600.0)
    with losses(done.report.lost):
        show(*done.report.tables())
        if done.report.interrupted:
            show("[yellow]interrupted: tables and file hold the rows run until then, no verdicts[/yellow]")
        if done.report.json is not None:
            show(f"results  {done.report.json}")
        show(*(f"figure   {figure}" for figure in done.report.figures))
    raise typer.Exit(done.exit_status)


@app.command()
def calibrate(
    data: Annotated[Path | None, typer.Option(help="Folder of the real detections, with objects.npz.")] = None,
    radar: Annotated[str, typer.Option(help="The rig whose front radar is compared.")] = "imaging",
) -> None:
    """Compare simulated with real detections of cars: where they lie and how many there are.

    A command of a checkout: the comparison is no part of the package.

    Example: [bold]testbed calibrate --radar imaging[/bold]
    """
    from testbed.command_line.checkout import study

    with user_input():
        report = study("calibration.report", "testbed calibrate").report(data, radar)
    show(*report)


def main() -> None:
    """Entry point of the `testbed` command."""
    warnings.simplefilter("ignore", LostFileWarning)  # commands say it at their end
    lenient_streams()
    try:
        status = app(standalone_mode=False)
        sys.stdout.flush()
    except typer.TyperException as error:
        status = 2
        context = getattr(error, "ctx", None)
        if text := error.format_message():  # empty where the help was shown
            command = context.command_path if context else "testbed"
            complain(f"{text.rstrip('.')}; see `{command} --help`")
    except OSError as error:
        if not drop_stdout():
            raise
        complain(f"cannot write to standard output: {error.strerror}; send it elsewhere")
        status = 2
    sys.exit(status)

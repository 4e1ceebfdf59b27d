"""What `testbed regress` does: the runs, the verdict, new baselines, a log of the worst run."""

import shlex
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from joblib import cpu_count
from rich.console import Console
from rich.progress import Progress

from sensors.fault_text import split_faults
from testbed.command_line.terminal import stages, user_input
from testbed.compare.command import show_tally
from testbed.compare.runs.config import check as check_comparison
from testbed.compare.runs.results import Results, collect, write_runs
from testbed.compare.runs.tasks import RecordingTask, obtain
from testbed.compare.runs.work import execute
from testbed.environment.registration import scenario_of
from testbed.experiments.engine import Engine
from testbed.experiments.engine import check as check_engine
from testbed.experiments.report import junit
from testbed.files import check_target, make_directory, versions
from testbed.regress import tables
from testbed.regress.baselines import NONE, Baselines, Update, load, merge, save
from testbed.regress.findings import Findings, examine, measured, orphans, worst_run
from testbed.regress.suite import LOGS, Suite, prepare_folder
from testbed.regress.verdict import OVERALL
from testbed.replay.rescan import write_log
from trackers import SensorModel, build

COMMITTED = Path(str(files("testbed.regress"))) / "baselines.json"


@dataclass(frozen=True)
class Options:
    """The options of a call."""

    suite: Suite
    baselines: Path | None = None  # None: the committed file
    update: bool = False
    junit: Path | None = None
    jobs: int | None = None  # None: one process a core

    @property
    def path(self) -> Path:
        """The file of the baselines."""
        return self.baselines or COMMITTED

    @property
    def engine(self) -> Engine:
        """As many processes as asked for, else one a core, and not more than runs."""
        return Engine(min(cpu_count(), len(self.suite.comparison.tasks)) if self.jobs is None else self.jobs)


def prepare(options: Options) -> Baselines:
    """Check everything that may be wrong before the long run, and read the baselines.

    Raises:
        LookupError, ValueError, OSError: in one sentence.
    """
    suite = options.suite
    comparison = suite.comparison  # finds repeated names
    for scenario in suite.scenarios:
        scenario_of(split_faults(scenario)[0])
    for tracker in suite.trackers:
        build(tracker, (SensorModel(),))
    check_engine(options.engine)
    baselines = starting_point(options) if options.update else load(options.path, suite)
    for name, path in (("junit", options.junit), ("baselines", options.path if options.update else None)):
        if path is not None:
            _check_file(name, path)
    prepare_folder(suite)
    check_comparison(comparison)
    return baselines


def starting_point(options: Options) -> Baselines:
    """Baselines that an update changes; a complete update may replace a file that cannot be read."""
    try:
        return load(options.path, options.suite)
    except FileNotFoundError:
        return NONE
    except ValueError as error:
        if options.suite.complete:
            return NONE
        raise ValueError(f"{error} without --tracker and --scenario") from None


def _check_file(name: str, path: Path) -> None:
    """Raise OSError, in one sentence, where a file cannot be written."""
    try:
        check_target(path)
        make_directory(path.parent)
    except OSError as error:
        raise OSError(f"{name}: {str(error).removeprefix('out: ')}") from None


def regress(options: Options, baselines: Baselines, console: Console, bar: Progress) -> int:
    """Run what is missing, show what moved or write baselines; returns the exit status."""
    comparison = options.suite.comparison
    with user_input((OSError, ValueError)), bar:
        tally = execute(comparison, options.engine, stages(bar))
    show_tally(tally, console)
    if tally.interrupted:
        console.print("[yellow]interrupted: the same command makes the rest[/yellow]")
        return tally.exit_status
    results = collect(comparison)
    findings = examine(results, tally, options.suite, baselines)
    with user_input((OSError,)):
        if options.update:
            status = _update(options, baselines, results, findings, console)
        else:
            status = _judge(options.suite, baselines, results, findings, console)
        if options.junit is not None:
            junit.write(findings, options.junit)
            console.print(f"junit    {options.junit}", soft_wrap=True, highlight=False)
        write_runs(results)
    return status


def _judge(suite: Suite, baselines: Baselines, results: Results, findings: Findings, console: Console) -> int:
    """Show what moved; the status says whether anything failed or got worse."""
    _show(findings, baselines, console)
    if findings.worse:
        _write_log(suite, results, findings, baselines, console)
    return 0 if findings.passed else 1


def _show(findings: Findings, baselines: Baselines, console: Console) -> None:
    if findings.worse:
        console.print(tables.moved(findings.worse, "worse than the baselines"))
    if findings.better:
        console.print(tables.moved(findings.better, "better than the baselines"))
        console.print("keep the improvement with `testbed regress --update`")
    for what, keys, remedy in (
        ("new, without a baseline", findings.new, "makes them"),
        ("gone, with a baseline", findings.orphans, "drops them"),
    ):
        if keys:
            sentence = f"{what}: {tables.cells(keys)}; `testbed regress --update` {remedy}"
            console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    compared = [key for key in findings.cells if key in baselines.values]
    bad = {(c.tracker, c.scenario) for c in findings.worse} | set(findings.failed)
    overall = sum(scenario == OVERALL for _, scenario in bad)
    console.print(
        f"{len(compared)} results compared with baselines: {len(compared) - len(bad) + overall} good, "
        f"{len(bad) - overall} worse or failed, {overall} trackers worse over all scenarios",
        highlight=False,
        soft_wrap=True,
    )
    if not findings.passed:
        for note in _other_versions(baselines):
            console.print(f"[yellow]![/yellow] {note}", highlight=False, soft_wrap=True)


def _other_versions(baselines: Baselines) -> list[str]:
    """One sentence for each library that was another one when baselines were made."""
    here = versions()
    then = {(name, v) for update in baselines.updates.values() for name, v in update.versions.items()}
    return [
        f"baselines were made with {name} {v}, here is {here.get(name, 'none')}"
        for name, v in sorted(then)
        if here.get(name) != v
    ]


def _write_log(suite: Suite, results: Results, findings: Findings, baselines: Baselines, console: Console) -> None:
    """Write the review log of the worst run; where it cannot be written, the exit status stays as it is."""
    (tracker, scenario), k = worst_run(findings, measured(results, suite), baselines)
    out = Path(suite.out)
    try:
        name, faults = split_faults(scenario)
        recording = obtain(RecordingTask(name, suite.seeds[k]), suite.comparison.settings, out)
        path = write_log(recording, (tracker,), out / LOGS, faults)
    except OSError as error:
        console.print(f"[yellow]no log of the worst run: {error}[/yellow]", soft_wrap=True)
        return
    console.print(f"worst    {tracker} in {scenario}, seed {suite.seeds[k]}", highlight=False, soft_wrap=True)
    console.print(f"open it  testbed review {shlex.quote(str(path))}", highlight=False, soft_wrap=True)


def _update(options: Options, old: Baselines, results: Results, findings: Findings, console: Console) -> int:
    """New baselines, unless a run failed."""
    if findings.failed:
        console.print(f"[red]baselines are left as they were: {len(findings.failed)} results failed[/red]")
        return 1
    today = Update(datetime.now(UTC).date().isoformat(), versions())
    dropped = orphans(old, options.suite) if options.suite.complete else []
    new = merge(old, measured(results, options.suite), today, [key for key in old.values if key not in dropped])
    save(new, options.suite, options.path)
    console.print(f"Baselines of {today.date}:\n", highlight=False)
    console.print(tables.update_list(old, new, dropped), markup=False, highlight=False, soft_wrap=True)
    console.print(f"\nwritten  {options.path}", soft_wrap=True, highlight=False)
    return 0

"""`testbed replay` and `testbed record` as people see them."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from testbed.command_line import tables
from testbed.command_line.tables import show_files, show_measures
from testbed.command_line.terminal import losses, progress_bar, user_input
from testbed.environment.perception import radar_of
from testbed.environment.registration import scenario_of
from testbed.files import file_stem
from testbed.limits import check_duration, check_seeds
from testbed.replay.fixes import DOUBT, FAULT, OPEN, Finding
from testbed.replay.plausibility import faults, judged
from testbed.replay.reading import Recorded
from testbed.replay.replaying import ReplayConfig, ReplayResult, replay
from testbed.replay.writing import check_folder, write

LIVES = (  # key, label, digits
    ("tracks_reported", "tracks", 0),
    ("tracks_per_scan", "tracks a scan", 1),
    ("life_median", "median life [s]", 2),
    ("life_longest", "longest life [s]", 2),
)


def show(done: ReplayResult, console: Console) -> None:
    """Tables and files of a replay: errors where there is a truth, and what became of the tracks."""
    if "trackers" in done.result:
        show_measures(done.result, console, done.result["run"]["scenario"])
    console.print(lives(done))
    if done.result["interrupted"]:
        console.print("[yellow]interrupted: the tables and files hold what was replayed until then[/yellow]")
    show_files({"results": done.json, "tracks": done.tracks, "log": done.rrd}, console)


def brief(found: list[Finding], console: Console) -> None:
    """One line where all is well, else one for each doubt, and for each fault that is accepted."""
    open_ = [finding.test for finding in found if finding.verdict == OPEN]
    bad = [finding for finding in found if finding.verdict in (DOUBT, FAULT)]
    if not bad:
        said = f"; nothing can be said of {', '.join(open_)}" if open_ else ""
        console.print(f"plausible  {len(found)} tests{escape(said)}", highlight=False, soft_wrap=True)
    for finding in bad:
        line = f"[yellow]{finding.verdict}[/yellow]  {escape(finding.sentence)}"
        console.print(line, highlight=False, soft_wrap=True)


def report(folder: Path, fixes: Sequence[str], console: Console) -> int:
    """What was tested, at length; the exit status is 1 where something cannot be right. Errors as in `judged`."""
    recorded, found = judged(folder, None, None, fixes)
    table = tables.light_table(f"{recorded.name}: {len(recorded.frames)} scans")
    for heading in ("test", "figure", "fits", "verdict"):
        table.add_column(heading)
    for one in found:
        table.add_row(*map(escape, (one.test, one.figure, one.fits, one.verdict)))
    console.print(table)
    brief(found, console)
    return 1 if faults(found) else 0


def lives(done: ReplayResult) -> Table:
    """Numbers and lives of the tracks, a column a tracker."""
    table = tables.light_table(f"{done.result['run']['scenario']}: reported tracks")
    table.add_column("measure")
    for name in done.lives:
        table.add_column(escape(name), justify="right")
    for key, label, digits in LIVES:
        table.add_row(escape(label), *(tables.number(row[key], digits) for row in done.lives.values()))
    if "trackers" not in done.result:  # else the table of errors has it
        costs = done.result["timing"]["trackers"].values()
        table.add_row("ms a scan", *(tables.number(cost["ms_per_scan"], 1) for cost in costs))
    return table


def replayed(settings: ReplayConfig, recorded: Recorded, console: Console) -> int:
    """Replay, with a bar, and show the results; returns the exit status."""
    brief(list(recorded.findings), console)
    for tracks in recorded.tracks:
        if tracks.said:
            console.print(f"[yellow]{escape(tracks.name)}: {escape(tracks.said)}[/yellow]", soft_wrap=True)
    with user_input((OSError,)), progress_bar("{task.completed:.0f} / {task.total:.0f} scans") as bar:
        task = bar.add_task(recorded.name, total=len(recorded.frames))
        done = replay(settings, recorded, lambda scans, total: bar.update(task, completed=scans, total=total))
    with losses(done.lost):
        show(done, console)
    return done.exit_status


def drives(scenarios: Sequence[str], seeds: int | Sequence[int], out: Path) -> list[tuple[str, int, Path]]:
    """Scenario, seed and folder of each recording: `out` itself of a single one, else OUT/SCENARIO_seedN."""
    if isinstance(seeds, int) and len(scenarios) == 1:
        return [(scenarios[0], seeds, out)]
    each = [seeds] if isinstance(seeds, int) else seeds
    return [(s, k, out / file_stem(s, f"seed{k}")) for s in scenarios for k in each]


def check(scenario: str, seed: int, out: Path, radar: str, duration: float | None, format: str) -> None:
    """Raise LookupError, ValueError or OSError, in one sentence, for a drive that cannot be recorded."""
    scenario_of(scenario)
    radar_of(radar)
    check_seeds(seed)
    check_duration(duration)
    check_folder(out, format)


def record(scenario: str, seed: int, out: Path, radar: str, duration: float | None, format: str) -> list[Path]:
    """Drive once on the truth, and write the tables; returns their paths. OSError where one cannot be written."""
    from testbed.replay.recording import record as drive

    return write(drive(scenario, seed, radar, duration), out, format)

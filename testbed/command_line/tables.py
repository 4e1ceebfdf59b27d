"""What people read on the terminal: catalogues, the results of a run, and where its files are."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import EntryPoint
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from trackers.lookup import installed, look_up

if TYPE_CHECKING:
    from testbed.evaluation.metric import Metric

DASH = "–"
EXPLAINED = (  # measures whose names do not say what they are
    "GOSPA: the error of a whole scan, position and size of every vehicle against its track, with a price for each "
    "missed vehicle and each false track; 0 is perfect.",
    "NEES: squared error over the tracker's own variance; 2 where that is right, more where it is too small.",
)
SEVERITY = (
    "severity: squared error at GOSPA's prices over the time that it lasted, nearer to the ego weighing more [m^2 s]; "
    "docs/methods/metrics.md."
)

BESIDE = {  # what runs without being an entry, by catalogue
    "scenarios": "Recorded traffic runs too: replay:FILE[:ego=ID,react=METRES,smooth=SECONDS]; docs/real-traffic.md."
}


def number(value: float | None, digits: int) -> str:
    """A figure as people read it; a dash where nothing was measured."""
    return DASH if value is None or not isfinite(value) else f"{value:.{digits}f}"


def metrics(result: Mapping[str, Any], title: str | None = None) -> Table:
    """Trackers against the truth, one column each; the title says of what, without one of which run."""
    from testbed.log.text import OF_TRACKER, shown

    run = result["run"]
    of = title or f"{run['scenario']}, {run['radar']}, seed {run['seed']}"
    rows = []
    for metric in shown(OF_TRACKER):
        ideal = f" ({metric.sense})" if metric.ideal is not None else ""
        values = (metric.text(row[metric.key], DASH) for row in result["trackers"].values())
        rows.append((metric.title + ideal, *values))
    costs = (number(cost["ms_per_scan"], 1) for cost in result["timing"]["trackers"].values())
    heads = ("metric", *result["trackers"])
    return filled_table(f"{of}: tracks against the truth", heads, [*rows, ("ms a scan", *costs)])


def moments(result: Mapping[str, Any]) -> Table:
    """The worst moments of the run, the worst first."""
    from testbed.log.text import happened, subject

    several = len(result["trackers"]) > 1
    rows = []
    for m in result["moments"]:
        who = subject(m) + (f"\n{m['tracker']}" if several else "")
        rows.append((number(m["time"], 1), who, f"{happened(m)}\n{m['why']}", number(m["severity"], 1)))
    heads, words = ("time [s]", "who", "what and why", "severity"), ("who", "what and why")
    return filled_table(f"the {len(rows)} worst moments", heads, rows, words, overflow="fold")


def costs(result: Mapping[str, Any]) -> Table:
    """What each tracker of a run without metrics took."""
    run = result["run"]
    title = f"{run['scenario']}, {run['radar']}, seed {run['seed']}: cost of the trackers"
    spent = result["timing"]["trackers"].items()
    return filled_table(title, ("tracker", "ms a scan"), [(name, number(c["ms_per_scan"], 1)) for name, c in spent])


def drive(result: Mapping[str, Any]) -> Table:
    """Driving measures of the ego, and the speed of the simulation."""
    from testbed.log.text import OF_DRIVE, shown

    run, row = result["run"], result["drive"]
    rows, wall = [(m.title, m.text(row[m.key], DASH)) for m in shown(OF_DRIVE)], result["timing"]["wall"]
    speed = "simulated seconds a second", number(row["elapsed"] / wall if wall else None, 1)
    title = f"the drive: planner {run['planner']} on {run['trackers'][0]}"
    return filled_table(title, ("metric", "value"), [*rows, speed])


def catalogues(what: str = "all") -> list[Table]:
    """Tables of the registries; raises LookupError for anything else."""
    found = entries()
    chosen = found if what == "all" else {what: look_up(what, found, "catalogue")}
    return [_catalogue(*item) for item in chosen.items()]


def entries() -> dict[str, list[tuple[str, str]]]:
    """Name and one line of each entry, by catalogue; last those that installed packages have registered."""
    from scenarios import PROBES, SCENARIOS
    from sensors import RADARS
    from testbed.evaluation.metric import METRICS
    from testbed.planners import PLANNERS
    from trackers import TRACKERS

    found = {
        "scenarios": [(s.name, s.purpose) for s in SCENARIOS.values()],
        "probes": [(p.name, p.purpose) for p in PROBES.values()],
        "trackers": [(t.name, t.source) for t in TRACKERS.values()],
        "radars": [(r.name, r.note) for r in RADARS.values()],
        "planners": [(p.name, p.note) for p in PLANNERS.values()],
        "metrics": [(m.key, line(m)) for m in METRICS.values()],
    }
    for what in ("scenario", "tracker", "radar", "planner"):
        ours = {name for name, _ in found[f"{what}s"]}
        for name, point in installed(what).items():
            taken = f"; the name is ours, write {point.value}" if name in ours else ""
            found[f"{what}s"].append((name, origin(point) + taken))
    return found


def line(metric: "Metric") -> str:
    """A metric in one line: words, unit, which way is better, of what."""
    unit = f" [{metric.unit}]" if metric.unit != "1" else ""
    needs = f"; needs {metric.needs}" if metric.needs else ""
    return f"{metric.words}{unit}; {', '.join(filter(None, (metric.sense, f'of a {metric.of}')))}{needs}"


def origin(point: EntryPoint) -> str:
    """Which package has registered an entry, and what it stands for."""
    package = f"{point.dist.name} {point.dist.version}" if point.dist is not None else "an installed package"
    return f"from {package}: {point.value}"


def _catalogue(title: str, rows: Sequence[tuple[str, str]]) -> Table:
    table = light_table(title)
    table.add_column("name", style="bold", no_wrap=True)
    table.add_column("what")
    for row in rows:
        table.add_row(*map(escape, row))
    table.caption = escape(BESIDE[title]) if title in BESIDE else None
    return table


def filled_table(
    title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], words: Sequence[str] = (), **columns: Any
) -> Table:
    """A light table; columns of words stand on the left, which without their heads is the first one alone.

    columns: what else `Table.add_column` takes, for all of them.
    """
    table = light_table(title)
    for k, head in enumerate(heads):
        left = head in words if words else k == 0
        table.add_column(escape(head), justify="left" if left else "right", **columns)
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def light_table(title: str) -> Table:
    """Light lines: wide rows, and little to delete when a table is pasted into a report."""
    return Table(
        title=escape(title),
        title_justify="left",
        title_style="bold",
        caption_justify="left",
        caption_style="",
        box=box.SIMPLE_HEAD,
        min_width=len(title) + 2,
    )


def show_measures(result: Mapping[str, Any], console: Console, title: str | None = None) -> None:
    """Errors of the trackers and what they mean, and the worst moments if any; see `metrics` for the title."""
    console.print(metrics(result, title))
    for line in EXPLAINED:
        console.print(line)
    console.print()
    if result["moments"]:
        console.print(moments(result))
        console.print(escape(SEVERITY))
        console.print()


def show_files(files: Mapping[str, Path | None], console: Console) -> None:
    """Where each file is that was written, and how to open the one called "log"."""
    for name, path in files.items():
        if path is not None:
            console.print(f"{name:8} {path}", soft_wrap=True)
    if files["log"] is not None:
        console.print(f"open it  testbed review {shlex.quote(str(files['log']))}", soft_wrap=True)


def show_run(result: Mapping[str, Any], files: Mapping[str, Path | None], focus: int | None, console: Console) -> None:
    """What a run was: the measures, or where there are none the costs; its events, and where the files are.

    focus: id of the vehicle that the user wants to see first, None for no wish.
    """
    if "objects" in result:
        show_measures(result, console)
        console.print(drive(result))
    else:
        console.print(costs(result))
    for event in result["run"].get("events", ()):
        console.print(escape(f"at {event['time']:.1f} s: {event['text']}"))
    there = sorted({row["object"] for row in result.get("objects", ())})
    if focus not in (None, *there):
        known = ", ".join(map(str, there)) or "none"
        console.print(f"[yellow]--focus: there was no vehicle {focus}; vehicles: {known}[/yellow]", highlight=False)
    if result["interrupted"]:
        console.print("[yellow]interrupted: the tables and files hold what was run until then[/yellow]")
    show_files(files, console)

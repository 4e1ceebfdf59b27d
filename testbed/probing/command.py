"""What `testbed probe` does: the limits of all seeds on the truth and on tracks, and the table."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress as Bar
from rich.table import Table

from testbed.command_line.interruption import interruptible
from testbed.command_line.tables import DASH, light_table
from testbed.command_line.terminal import user_input
from testbed.evaluation.intervals import Interval
from testbed.experiments.engine import Engine, perform
from testbed.experiments.identity import own_code, own_names, shared_digest, tracker_digest
from testbed.experiments.run import FAILED
from testbed.files import make_directory
from testbed.frame import TRUTH
from testbed.probing.drives import Setting
from testbed.probing.search import SHARE, Limits, Search, limit_path, limits, parameter_of, search, stored


class Options(NamedTuple):
    """A search, and where it is done."""

    setting: Setting  # with the tracker that is compared with the truth
    parameter: str | None  # None: the first of the probe
    seeds: tuple[int, ...]
    resolution: float  # in the unit of the parameter
    engine: Engine
    out: Path

    def check(self) -> None:
        """Raise LookupError, TypeError, ValueError or OSError, in one sentence, for what cannot be searched."""
        self.setting.check()
        if self.setting.tracker == TRUTH:
            raise ValueError("tracker: the truth is what a tracker is compared with; name a tracker")
        parameter_of(self.setting.probe, self.parameter)
        if not self.resolution > 0:
            raise ValueError(f"resolution must be positive, got {self.resolution}")
        make_directory(self.out)


def probe(options: Options, console: Console, bar: Bar) -> int:
    """Find the limits that are missing, and show them; the exit status is 1 where nothing was survived on tracks."""
    setting, parameter = options.setting, parameter_of(options.setting.probe, options.parameter)
    own = own_code(own_names([setting.probe], [setting.radar], [setting.planner]))
    code = "-".join([shared_digest(), tracker_digest(setting.tracker), *own.values()])
    pair = [
        [Search(each, parameter.name, options.resolution, code, seed) for seed in options.seeds]
        for each in (setting._replace(tracker=TRUTH), setting)
    ]
    with user_input((OSError, ValueError)), bar, interruptible() as request:
        tasks = [(task, options.out) for searches in zip(*pair, strict=True) for task in searches]
        line = bar.add_task(f"limits of {parameter.name}", total=len(tasks))
        outcomes = perform(search, tasks, options.engine, lambda task, out: [limit_path(task, out)])
        for outcome in outcomes:
            bar.advance(line)
            if outcome.status == FAILED:
                console.print(f"[red]failed[/red] {outcome.name}\n{outcome.note}", highlight=False, soft_wrap=True)
            if request.signal is not None:
                break
        outcomes.close()
    found = np.array([[_known(task, options.out) for task in searches] for searches in pair])
    kept = ~np.isinf(found).any(0)  # seeds of which both limits are known
    if request.signal is not None or not kept.any():
        console.print(f"{kept.sum()} of {len(options.seeds)} seeds are done; the same command does the rest")
        return request.exit_status or 1
    known = limits(found[0, kept], found[1, kept], parameter)
    console.print(table(options, known, int(kept.sum())))
    return 0 if np.isfinite(known.tracks.value) and kept.all() else 1


def _known(task: Search, out: Path) -> float:
    """The limit of a seed, NaN where it survives nothing, infinite where it was not found."""
    value = stored(task, out)
    return np.inf if value is None else value


def table(options: Options, found: Limits, seeds: int) -> Table:
    """The limits on the truth and on tracks, and their difference."""
    setting, parameter = options.setting, parameter_of(options.setting.probe, options.parameter)
    shown = light_table(
        f"{setting.probe}, planner {setting.planner}, {seeds} seeds: {parameter.name}, {parameter.note}"
    )
    shown.add_column("")
    shown.add_column(f"{parameter.name} [{parameter.unit}]", justify="right")
    shown.add_column("95 % interval", justify="right")
    hardest = f"hardest that {SHARE:.0%} of the seeds survive"
    shown.add_row(f"{hardest}, on the truth", *_cells(found.truth))
    shown.add_row(f"{hardest}, on {setting.tracker}", *_cells(found.tracks))
    shown.add_row("easier by, because of tracking", *_cells(found.cost))
    shown.add_row("the same, mean over the seeds", *_cells(found.mean_cost))
    return shown


def _cells(interval: Interval) -> tuple[str, str]:
    value, low, high = (f"{x:.1f}" if np.isfinite(x) else DASH for x in interval)
    return value, f"{low} to {high}"

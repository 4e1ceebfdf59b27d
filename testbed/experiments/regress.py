"""`testbed regress`: every scenario by every tracker, compared with committed baselines of the same runs.

Every scenario on two seeds, to 3 s after its maneuver, in open loop. The folder holds runs of the present code only:
runs of other code or versions are deleted, those of the same code, of an interrupted call, are kept.
"""

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.table import Table

from scenarios import SCENARIOS
from testbed.command_line.tables import light_table, number
from testbed.evaluation.intervals import mean_of_means
from testbed.evaluation.metric import METRICS
from testbed.experiments import study
from testbed.experiments.baselines import NONE, Baselines, Key, Update, load, merge, save
from testbed.experiments.compare import RECORD, Comparison, Settings, write_runs
from testbed.experiments.engine import Engine
from testbed.experiments.identity import project_digest
from testbed.experiments.report import junit
from testbed.experiments.report.texts import say
from testbed.experiments.run import with_faults
from testbed.experiments.store import LOGS, Results
from testbed.experiments.study import Progress, Tally
from testbed.experiments.tolerated import BETTER, GONE, OVERALL, TOLERANCES, WORSE, Moved, tolerated
from testbed.files import versions
from testbed.replay.rescan import write_log
from trackers import TRACKERS

COMMITTED = Path(str(files("testbed.experiments"))) / "baselines.json"
UNREAD = "its file of rows is not there or cannot be read"
ROWS = 40  # of a table; there may be thousands of changes
NAMES = 4  # in a sentence

# The fault matrix: all kinds of faults of the radar, in one scenario with traffic on all sides.
FAULTS = ("front:outage:2:4", "drop:0.2", "corners:yaw:2+clock:0.05", "blind:rain:0.5+burst:3:100")
CASES = (*SCENARIOS, *(f"cut-in+{fault}" for fault in FAULTS))
QUICK = ("following", "cut-in")  # under a minute with one tracker on one core


@dataclass(frozen=True)
class Regress(Comparison):
    """The runs that are compared with the baselines, or that make new ones."""

    scenarios: tuple[str, ...] = CASES  # with faults: NAME+FAULT+FAULT
    trackers: tuple[str, ...] = tuple(TRACKERS)
    seeds: tuple[int, ...] = (0, 1)
    settings: Settings = RECORD
    baselines: Path = COMMITTED
    update: bool = False  # write the baselines
    strict: bool = False  # a result without a baseline fails too

    name: ClassVar[str] = "regress"
    fresh: ClassVar[bool] = True
    whole: ClassVar[bool] = True

    @classmethod
    def of(
        cls, scenarios: Sequence[str] | None, trackers: Sequence[str] | None, faults: Sequence[str] = (), **more: Any
    ) -> "Regress":
        """The part with these names; all of them where none is named.

        With faults each scenario takes part as it is and under each of them. ValueError for what is no fault.
        """
        cases = with_faults(scenarios or tuple(SCENARIOS), faults) if faults else tuple(scenarios or CASES)
        return cls(cases, tuple(trackers or TRACKERS), **more)

    @property
    def complete(self) -> bool:
        """Whether everything in the catalogues takes part."""
        return set(self.scenarios) >= set(CASES) and set(self.trackers) >= set(TRACKERS)

    @property
    def conditions(self) -> dict[str, Any]:
        """What baselines must have been made with."""
        return {"seeds": list(self.seeds), **asdict(self.settings)}

    def identity(self) -> dict[str, Any]:
        """Everything that decides about results, with a digest of all our code."""
        return {**super().identity(), "all code": project_digest()}

    def check(self) -> None:
        """Also read the baselines, and see whether they can be written; OSError or ValueError in one sentence."""
        super().check()
        self.known()
        if self.update:
            study.check_file("baselines", self.baselines)

    def known(self) -> Baselines:
        """The baselines; a complete update may replace a file that is not there or cannot be read."""
        try:
            return load(self.baselines, self.conditions)
        except FileNotFoundError:
            if self.update:
                return NONE
            raise
        except ValueError as error:
            if self.update and self.complete:
                return NONE
            if self.update:
                raise ValueError(f"{error} without --tracker and --scenario") from None
            raise

    def judge(self, results: Results, tally: Tally) -> study.Findings:
        """What moved."""
        known = self.known()
        found = examine(results, tally, known)
        if self.update:
            return study.Findings([], bool(found.failed), found)
        lacking = bool(found.new) if self.strict else not found.compared
        return study.Findings(list(_shown(found, known, self)), lacking or not found.passed, found)

    def write(self, results: Results, found: study.Findings, console: Console) -> None:
        """Write new baselines, or the log of the worst run."""
        if self.update:
            _update(results, found.data, console)
        elif found.data.worse:
            _write_log(results, found.data, self.known(), console)
        write_runs(results)

    def page(self, results: Results, found: Any, tally: Tally, engine: Engine, progress: Progress) -> Path | None:
        """None: what moved is a table on the terminal."""
        return None

    def junit(self, results: Results, found: study.Findings, tally: Tally, path: Path) -> None:
        """A suite a tracker, a case a scenario."""
        junit.write("regress", list(suites(found.data)), path)


class Findings(NamedTuple):
    """What a regression run reports."""

    cells: Sequence[Key]  # of the suite
    changes: Sequence[Moved]  # all differences that were examined
    failed: Mapping[Key, str]  # traceback of a run
    new: Sequence[Key]  # without a baseline
    orphans: Sequence[Key]  # baselines of what is no longer in the catalogues
    seconds: Mapping[Key, float]  # wall time

    @property
    def worse(self) -> list[Moved]:
        """Regressions, the largest first."""
        return self._sorted(WORSE, GONE)

    @property
    def better(self) -> list[Moved]:
        """Improvements, the largest first."""
        return self._sorted(BETTER)

    @property
    def compared(self) -> list[Key]:
        """What has a baseline, or failed."""
        return [key for key in self.cells if key not in self.new]

    @property
    def passed(self) -> bool:
        """Whether nothing failed or got worse."""
        return not self.failed and not self.worse

    def _sorted(self, *verdicts: str) -> list[Moved]:
        return sorted((c for c in self.changes if c.verdict in verdicts), key=lambda c: -c.size)


def suites(found: Findings) -> Iterator[junit.Suite]:
    """A suite a tracker, a case a scenario and one for all of them together."""
    for tracker in dict.fromkeys(tracker for tracker, _ in found.cells):
        keys = [*(key for key in found.cells if key[0] == tracker), (tracker, OVERALL)]
        yield junit.Suite(tracker, [_case(found, key) for key in keys])


def _case(found: Findings, key: Key) -> junit.Case:
    worse, better = (
        "\n".join(sentence(c) for c in group if (c.tracker, c.scenario) == key) for group in (found.worse, found.better)
    )
    error, skipped = found.failed.get(key, ""), say("no baseline") if key in found.new else ""
    case = junit.Case(key[0], key[1], found.seconds.get(key, 0.0), error, "regression", worse, skipped)
    return case if error or worse or skipped else case._replace(output=better)


def sentence(change: Moved) -> str:
    """One change in words."""
    return say("moved", name=METRICS[change.measure].title, gone=change.verdict == GONE, **change._asdict())


def examine(results: Results, tally: Tally, baselines: Baselines) -> Findings:
    """Compare the results with the baselines."""
    suite, failed = results.study, failures(results, tally)
    values = {key: v for key, v in measured(results).items() if key not in failed}
    cells = [(t, c) for t in suite.trackers for c in suite.scenarios]
    return Findings(
        cells,
        tolerated(values, baselines.values),
        failed,
        [key for key in cells if key not in baselines.values and key not in failed],
        orphans(baselines, suite),
        _seconds(results.seconds),
    )


def measured(results: Results) -> dict[Key, dict[str, NDArray]]:
    """Values by seed of all runs that there are; NaN where a run measured nothing, or is missing."""
    found: dict[Key, dict[str, NDArray]] = {}
    if results.runs.empty:
        return found
    for (tracker, scenario), runs in results.runs.groupby(["tracker", "scenario"], sort=False, observed=True):
        runs = runs.set_index("seed").reindex(list(results.study.seeds))
        found[str(tracker), str(scenario)] = {measure: runs[measure].to_numpy(float) for measure in TOLERANCES}
    return found


def failures(results: Results, tally: Tally) -> dict[Key, str]:
    """The last lines of each failed run by tracker and scenario."""
    notes = {outcome.name: outcome.note for outcome in tally.failed}
    return {(run.source, run.case): notes.get(run.name, UNREAD) for run in results.missing}


def orphans(baselines: Baselines, suite: Regress) -> list[Key]:
    """Baselines of trackers and scenarios that are no longer in the catalogues, nor asked for by a name of the user."""
    trackers, scenarios = {*TRACKERS, *suite.trackers}, {*CASES, *suite.scenarios}
    return [key for key in baselines.values if key[0] not in trackers or key[1] not in scenarios]


def worst_run(findings: Findings, values: Mapping[Key, Mapping[str, NDArray]], baselines: Baselines) -> tuple[Key, int]:
    """Tracker and scenario of the worst change, and which of the seeds shows it most.

    A change over all scenarios is shown by the one in which it is largest.
    """
    tracker, scenario, measure, *_ = findings.worse[0]
    if scenario == OVERALL:
        own = [c for c in findings.changes if c[0] == tracker and c.measure == measure and c.scenario != OVERALL]
        scenario = max(own, key=lambda c: np.nan_to_num(c.change, nan=-np.inf)).scenario
    key = tracker, scenario
    moved = np.abs(values[key][measure] - baselines.values[key][measure])
    return key, int(np.argmax(np.where(np.isnan(moved), np.inf, moved)))


def _seconds(frame: pd.DataFrame) -> dict[Key, float]:
    if frame.empty:
        return {}
    parts = [c for c in frame.columns if c not in ("scenario", "tracker", "seed")]
    sums = frame.assign(total=frame[parts].sum(axis=1)).groupby(["tracker", "scenario"])["total"].sum()
    return {(str(t), str(c)): float(s) for (t, c), s in sums.items()}


def _shown(findings: Findings, baselines: Baselines, suite: Regress) -> Iterator[RenderableType]:
    for changes, title in ((findings.worse, "worse"), (findings.better, "better")):
        if changes:
            yield moved(changes, f"{title} than the baselines")
    compared = [key for key in findings.cells if key in baselines.values]
    bad = {(c.tracker, c.scenario) for c in findings.worse} | set(findings.failed)
    overall = sum(scenario == OVERALL for _, scenario in bad)
    counts: dict[str, Any] = {
        "compared": len(compared),
        "bad": len(bad) - overall,
        "overall": overall,
        "better": bool(findings.better),
    }
    new, gone = escape(cells(findings.new)), escape(cells(findings.orphans))
    counts |= {"failing": suite.strict or not findings.compared, "command": _makes(findings, suite)}
    yield say("regress", **counts, new=new, gone=gone, versions=[] if findings.passed else _other_versions(baselines))


def _makes(findings: Findings, suite: Regress) -> str:
    """The command that makes the baselines that are missing."""
    words = ["testbed", "regress", "--update"]
    if suite.baselines != COMMITTED:
        words += ["--baselines", str(suite.baselines)]
    for option, column in (("--tracker", 0), ("--scenario", 1)):
        names = list(dict.fromkeys(str(key[column]).partition("+")[0] for key in findings.new))
        words += [word for name in names[:NAMES] for word in (option, name)] if len(names) <= NAMES else []
    return escape(shlex.join(words))


def _other_versions(baselines: Baselines) -> list[tuple[str, str, str]]:
    """Each library that was another one when baselines were made, its version then, and here."""
    here = versions()
    then = {(name, v) for update in baselines.updates.values() for name, v in update.versions.items()}
    return [(name, v, here.get(name, "none")) for name, v in sorted(then) if here.get(name) != v]


def _write_log(results: Results, findings: Findings, baselines: Baselines, console: Console) -> None:
    """Write the review log of the worst run; where it cannot be written, the exit status stays as it is."""
    suite = results.study
    (tracker, scenario), k = worst_run(findings, measured(results), baselines)
    run = suite.run(scenario, tracker, suite.seeds[k])
    try:
        path = write_log(results.store.recording(run), (tracker,), results.store.out / LOGS, run.faults)
    except OSError as error:
        console.print(f"[yellow]no log of the worst run: {error}[/yellow]", soft_wrap=True)
        return
    console.print(f"worst    {tracker} in {scenario}, seed {run.seed}", highlight=False, soft_wrap=True)
    console.print(f"open it  testbed review {shlex.quote(str(path))}", highlight=False, soft_wrap=True)


def _update(results: Results, findings: Findings, console: Console) -> None:
    """New baselines, unless a run failed."""
    suite = results.study
    if findings.failed:
        console.print(f"[red]baselines are left as they were: {len(findings.failed)} results failed[/red]")
        return
    old, today = suite.known(), Update(datetime.now(UTC).date().isoformat(), versions())
    dropped = orphans(old, suite) if suite.complete else []
    new = merge(old, measured(results), today, [key for key in old.values if key not in dropped])
    save(new, suite.conditions, suite.baselines)
    console.print(f"Baselines of {today.date}:\n", highlight=False)
    console.print(update_list(old, new, dropped), markup=False, highlight=False, soft_wrap=True)
    console.print(f"\nwritten  {suite.baselines}", soft_wrap=True, highlight=False)


def moved(changes: Sequence[Moved], title: str) -> Table:
    """Changes, the largest first, with what was allowed."""
    table = light_table(title)
    table.add_column("tracker, scenario")
    table.add_column("measure")
    for name in ("before", "now", "change", "allowed"):
        table.add_column(name, justify="right", no_wrap=True)
    for c in changes[:ROWS]:
        digits = METRICS[c.measure].digits + 1
        numbers = (number(c.before, digits), number(c.after, digits), _signed(c.change, digits))
        table.add_row(f"{c.tracker}, {c.scenario}", escape(METRICS[c.measure].title), *numbers, number(c.limit, digits))
    if len(changes) > ROWS:
        table.add_row(f"and {len(changes) - ROWS} more", *[""] * 5)
    return table


def cells(keys: Sequence[Key]) -> str:
    """Trackers and scenarios in a few words.

    >>> cells([("a", "x"), ("a", "y")])
    'a (x, y)'
    """
    by_tracker: dict[str, list[str]] = {}
    for tracker, scenario in keys:
        by_tracker.setdefault(tracker, []).append(scenario)
    return _few([f"{t} ({_few(c)})" for t, c in by_tracker.items()])


def update_list(old: Baselines, new: Baselines, dropped: Sequence[Key]) -> str:
    """What an update of baselines changed, as a short markdown list."""
    fresh = [key for key in new.values if key not in old.values]
    changed: dict[str, list[Key]] = {}
    for key, values in new.values.items():
        if key in old.values and _differ(old.values[key], values):
            changed.setdefault(key[0], []).append(key)
    of = Counter(tracker for tracker, _ in new.values)
    parts = [(tracker, len(keys), of[tracker], _means(old, new, keys)) for tracker, keys in changed.items()]
    same = len(new.values) - len(fresh) - sum(map(len, changed.values()))
    lists = {"fresh": len(fresh), "new": cells(fresh), "dropped": len(dropped), "gone": cells(dropped)}
    return say("baselines updated", changed=parts, same=same, **lists)


def _means(old: Baselines, new: Baselines, keys: Sequence[Key]) -> str:
    """Mean of each measure that moved, before and after."""
    parts = []
    for measure in TOLERANCES:
        a, b = (_mean([baselines.values[key][measure] for key in keys]) for baselines in (old, new))
        digits = METRICS[measure].digits + 1
        before, after = f"{a:.{digits}f}", f"{b:.{digits}f}"
        if before != after:
            parts.append(f"{METRICS[measure].title} {before} -> {after}")
    return ", ".join(parts) or "less than the digits shown"


def _mean(groups: Iterable[NDArray]) -> float:
    known = [group[np.isfinite(group)] for group in groups]
    return float(mean_of_means(*[group for group in known if len(group)])) if any(map(len, known)) else np.nan


def _differ(a: Mapping[str, NDArray], b: Mapping[str, NDArray]) -> bool:
    return any(not np.array_equal(a[measure], b[measure], equal_nan=True) for measure in b)


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMES} more" if len(names) > NAMES else ""
    return ", ".join(names[:NAMES]) + more


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}f}" if np.isfinite(value) else "gone"

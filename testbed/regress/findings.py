"""What a regression run found: the runs' values, what moved, what failed, what has no counterpart."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from testbed.compare.runs.results import Results
from testbed.compare.runs.work import Tally
from testbed.regress.baselines import Baselines, Key
from testbed.regress.suite import CASES, TOLERANCES, Suite
from testbed.regress.verdict import BETTER, GONE, OVERALL, WORSE, Change, judge
from trackers import TRACKERS

UNREAD = "its file of rows is not there or cannot be read"


class Findings(NamedTuple):
    """What a regression run reports."""

    cells: Sequence[Key]  # of the suite
    changes: Sequence[Change]  # all differences that were examined
    failed: Mapping[Key, str]  # traceback of a run
    new: Sequence[Key]  # without a baseline
    orphans: Sequence[Key]  # baselines of what is no longer in the catalogues
    seconds: Mapping[Key, float]  # wall time

    @property
    def worse(self) -> list[Change]:
        """Regressions, the largest first."""
        return self._sorted(WORSE, GONE)

    @property
    def better(self) -> list[Change]:
        """Improvements, the largest first."""
        return self._sorted(BETTER)

    @property
    def passed(self) -> bool:
        """Whether nothing failed or got worse."""
        return not self.failed and not self.worse

    def _sorted(self, *verdicts: str) -> list[Change]:
        return sorted((c for c in self.changes if c.verdict in verdicts), key=lambda c: -c.size)


def examine(results: Results, tally: Tally, suite: Suite, baselines: Baselines) -> Findings:
    """Compare the results of a suite with the baselines."""
    failed = failures(results, tally)
    values = {key: v for key, v in measured(results, suite).items() if key not in failed}
    cells = [(t, c) for t in suite.trackers for c in suite.scenarios]
    return Findings(
        cells,
        judge(values, baselines.values),
        failed,
        [key for key in cells if key not in baselines.values and key not in failed],
        orphans(baselines, suite),
        _seconds(results.seconds),
    )


def measured(results: Results, suite: Suite) -> dict[Key, dict[str, NDArray]]:
    """Values by seed of all runs that there are; NaN where a run measured nothing, or is missing."""
    found: dict[Key, dict[str, NDArray]] = {}
    if results.runs.empty:
        return found
    for (tracker, scenario), runs in results.runs.groupby(["tracker", "scenario"], sort=False, observed=True):
        runs = runs.set_index("seed").reindex(list(suite.seeds))
        found[str(tracker), str(scenario)] = {measure: runs[measure].to_numpy(float) for measure in TOLERANCES}
    return found


def failures(results: Results, tally: Tally) -> dict[Key, str]:
    """The last lines of each failed run by tracker and scenario."""
    notes = {outcome.name: outcome.note for outcome in tally.failed}
    return {(task.tracker, task.scenario): notes.get(task.name, UNREAD) for task in results.missing}


def orphans(baselines: Baselines, suite: Suite) -> list[Key]:
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

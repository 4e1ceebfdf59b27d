"""What the experiments of xia2020 have measured so far."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from testbed.papers.verdict import Progress, Row
from testbed.papers.xia2020_trials import Errors, Method, Trace, Trial, errors, track
from trackers.geometry import unit

COLUMNS: Mapping[str, int] = {
    "pos": 3, "vel": 3, "head": 2, "len": 3, "wid": 3, "len bias": 2, "gwd2": 3, "se": 3, "gwd": 3, "nees": 1,
    "nees vel": 1,
}  # fmt: skip


@dataclass
class Results:
    """Trials by case; traces, errors and rows by case and method."""

    trials: dict[str, Trial] = field(default_factory=dict)
    traces: dict[tuple[str, str], Trace] = field(default_factory=dict)
    errors: dict[tuple[str, str], Errors] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)
    used: dict[tuple[str, str], Method] = field(default_factory=dict)
    figures: list[Path] = field(default_factory=list)

    def add(self, trial: Trial, method: Method, reference: Mapping[str, float]) -> None:
        """Run a method on a trial and keep what it says."""
        key = trial.name, method.name
        self.trials[trial.name], self.used[key] = trial, method
        self.traces[key] = track(method, trial)
        self.errors[key] = errors(self.traces[key], trial)
        self.rows.append(Row(*key, self.errors[key].summary(), reference))

    def run(
        self,
        trial: Trial,
        methods: Sequence[Method],
        reference: Callable[[str, str], dict[str, float]] = lambda case, method: {},
        progress: Progress | None = None,
    ) -> None:
        """All methods on the same detections."""
        for k, method in enumerate(methods):
            if progress is not None:
                progress(k, len(methods), f"{trial.name}: {method.name}")
            self.add(trial, method, reference(trial.name, method.name))

    def methods(self, case: str, names: Sequence[str]) -> dict[str, Method]:
        """Methods by name, as they were used in a case."""
        return {name: self.used[case, name] for name in names}

    def gwd2(self, case: str, method: str) -> float:
        """Mean squared Gaussian Wasserstein distance [m^2]."""
        return float(self.errors[case, method].gwd2.mean())

    def pull(self, case: str, method: str) -> float:
        """Mean shift [m] of the estimated centre towards the sensor."""
        trial, trace = self.trials[case], self.traces[case, method]
        sensor = trial.scan.pose[..., 0, :2]
        d = sensor - trial.pose[..., :2]
        toward = unit(np.arctan2(d[..., 1], d[..., 0]))
        shift = ((trace.estimate.pose[..., :2] - trial.pose[..., :2]) * toward).sum(-1)
        return float(shift[trial.settled :].mean())

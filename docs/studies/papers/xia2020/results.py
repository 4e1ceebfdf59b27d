"""What the experiments of xia2020 have measured so far."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from studies.papers.reference import figures
from studies.papers.report import MethodRow
from studies.papers.xia2020.trials import EllipseErrors, NamedFilter, Trial, TrialEstimates, errors
from trackers.geometry import unit

REFERENCE = figures("xia2020")
COLUMNS: Mapping[str, int] = {  # of `Errors.summary`, on paper; the JSON has them all
    "pos": 2, "vel": 2, "head": 1, "len": 2, "wid": 2, "gwd2": 3, "se": 3, "gwd": 2, "nees": 1,
}  # fmt: skip
LEGEND = (
    "pos, vel, head, len, wid: root mean square errors [m, m/s, deg, m, m]; gwd2 [m^2]: mean squared Gaussian "
    "Wasserstein distance, se its standard error; gwd [m]: mean of the root; nees of the position, 2 is ideal"
)


@dataclass
class TrialRuns:
    """Trials by case; filters, estimates, errors and rows by case and method, as far as they were run."""

    trials: dict[str, Trial] = field(default_factory=dict)
    estimates: dict[tuple[str, str], TrialEstimates] = field(default_factory=dict)
    errors: dict[tuple[str, str], EllipseErrors] = field(default_factory=dict)
    rows: list[MethodRow] = field(default_factory=list)
    used: dict[tuple[str, str], NamedFilter] = field(default_factory=dict)

    def add(self, trial: Trial, method: NamedFilter, estimates: TrialEstimates) -> None:
        """Keep what a filter made of a trial, and its errors."""
        key = trial.name, method.name
        self.trials[trial.name], self.used[key] = trial, method
        self.estimates[key] = estimates
        self.errors[key] = errors(self.estimates[key], trial)
        self.rows.append(MethodRow(*key, self.errors[key].summary(), REFERENCE.get(key, {})))

    def methods(self, case: str, names: Sequence[str]) -> dict[str, NamedFilter]:
        """Filters by name, as they were used in a case."""
        return {name: self.used[case, name] for name in names}

    def gwd2(self, case: str, method: str) -> float:
        """Mean squared Gaussian Wasserstein distance [m^2]."""
        return float(self.errors[case, method].gwd2.mean())

    def shift_to_sensor(self, case: str, method: str) -> float:
        """Mean shift [m] of the estimated centre towards the sensor."""
        trial, found = self.trials[case], self.estimates[case, method]
        sensor = trial.scan.pose[..., 0, :2]
        d = sensor - trial.pose[..., :2]
        toward = unit(np.arctan2(d[..., 1], d[..., 0]))
        shift = ((found.estimate.pose[..., :2] - trial.pose[..., :2]) * toward).sum(-1)
        return float(shift[trial.settled :].mean())

"""What is driven: all scenarios with all planners, conditions and seeds, and settings that all drives share."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import testbed.compare.runs.config as comparison
from sensors import faults_of
from sensors import find as find_radar
from sensors.faults import chosen
from testbed.environment.registration import scenario_of
from testbed.environment.sources import conditions
from testbed.environment.sources.conditions import IN_VIEW
from testbed.environment.sources.substitution import GROUPS, subsets
from testbed.experiments.identity import modules_digest, own_code, own_names, shared_digest, tracker_digest
from testbed.files import make_directory, versions
from testbed.frame import TRUTH
from testbed.limits import MOST_RUNS, check_duration, check_folder, check_names, check_seeds
from testbed.planners import find as find_planner

DRIVES = (  # what decides about a drive, beside the code behind every run of a comparison
    "testbed.planners",
    "testbed.environment.sources", "testbed.regret.curves", "testbed.regret.discrepancy", "testbed.regret.drives",
)  # fmt: skip


class Task(NamedTuple):
    """One drive."""

    scenario: str  # NAME or NAME:parameter=value,parameter=value
    planner: str
    condition: str  # as in `conditions`
    seed: int

    @property
    def name(self) -> str:
        """Stem of its file."""
        parts = f"{self.scenario}_{self.planner}_{self.condition}_seed{self.seed}"
        return parts.replace(":", "~").replace("/", "-")


@dataclass(frozen=True)
class Settings:
    """What all drives of a folder have in common."""

    radar: str = "surround"
    duration: float | None = None  # [s], None: the scenario's own
    warm_up: float = 1.0  # [s] before the first decision, so that no tracker starts blind; the truth waits as long

    def __post_init__(self) -> None:
        check_duration(self.duration)


@dataclass(frozen=True)
class Study:
    """A study of regret, and the folder of its results."""

    scenarios: tuple[str, ...]
    planners: tuple[str, ...]
    trackers: tuple[str, ...]  # or conditions of a tracker, such as NAME+covariance=4
    seeds: tuple[int, ...]
    settings: Settings = Settings()
    attribute: bool = False  # also drive with groups of errors
    inject: tuple[str, ...] = ()  # errors put into what is in view, one condition each
    out: str = "runs/regret"

    def __post_init__(self) -> None:
        check_names("scenarios", self.scenarios)
        check_names("planners", self.planners)
        if self.trackers or not self.inject:
            check_names("trackers", self.trackers)
        if not self.seeds:
            raise ValueError("seeds must name at least one of them, got none; see `testbed regret --help`")
        check_seeds(*self.seeds, name="seeds")
        for what in ("seeds", "inject"):
            if len(set(getattr(self, what))) < len(getattr(self, what)):
                raise ValueError(f"{what} must differ, got {getattr(self, what)}; drop the repetition")
        check_folder(self.out)
        if (runs := len(self.tasks)) > MOST_RUNS:
            raise ValueError(f"a study has at most {MOST_RUNS} drives, got {runs}; take fewer seeds or trackers")

    @property
    def injected(self) -> tuple[str, ...]:
        """The conditions with an injected error."""
        return tuple(str(conditions.parse(f"{IN_VIEW}+{text}")) for text in self.inject)

    @property
    def attributed(self) -> tuple[str, ...]:
        """The trackers whose errors are taken apart: all, or none."""
        return tuple(t for t in self.trackers if is_plain(t)) if self.attribute else ()

    @property
    def conditions(self) -> tuple[str, ...]:
        """All conditions of every seed."""
        partial = [f"{t}:{groups}" for t in self.attributed for groups in subsets() if groups not in ("", GROUPS)]
        return (TRUTH, IN_VIEW, *self.trackers, *partial, *self.injected)

    @property
    def tasks(self) -> list[Task]:
        """All drives, those of one seed next to each other; the self-test of the attribution is of the first seed."""
        found = []
        for scenario in self.scenarios:
            for seed in self.seeds:
                test = [f"{t}:{GROUPS}" for t in self.attributed if seed == self.seeds[0]]
                found += [Task(scenario, p, c, seed) for p in self.planners for c in (*self.conditions, *test)]
        return found


def is_plain(tracker: str) -> bool:
    """Whether a condition is a tracker without groups, injected errors and faults."""
    condition = conditions.parse(tracker)
    return condition.groups is None and not condition.errors.sizes and not condition.faults


def check(study: Study) -> None:
    """Raise LookupError, ValueError or OSError, in one sentence, for what cannot be driven or written.

    A folder that holds drives of other settings, versions or code is refused: the sentence names what differs.
    """
    for scenario in study.scenarios:
        scenario_of(scenario)
    find_radar(study.settings.radar)
    for planner in study.planners:
        if find_planner(planner).knows_truth:
            raise ValueError(f"planner {planner} has no regret, it plans on the truth; choose another")
    for tracker in study.trackers:
        if conditions.parse(tracker).tracker is None:
            raise ValueError(f"{tracker} is no tracker; truth and in-view are driven anyway, errors are for --inject")
        condition = conditions.parse(tracker)
        conditions.source(condition, study.settings.radar, 0)
        for fault in faults_of(condition.faults):
            chosen(fault.sensors, find_radar(study.settings.radar).models)
    make_directory(Path(study.out))
    comparison.check_identity(Path(study.out), identity(study))


def write_settings(study: Study) -> None:
    """Write into the folder what its drives have in common, and the digest of the code of each tracker."""
    comparison.write_identity(Path(study.out), identity(study))


def identity(study: Study) -> dict[str, Any]:
    """Settings, versions of libraries, and digests of our code, as far as they decide about results."""
    trackers = dict.fromkeys(conditions.parse(t).tracker for t in study.trackers)
    return {
        **asdict(study.settings),
        **{f"version of {name}": version for name, version in versions().items()},
        "code": shared_digest(),
        "code of the drives": modules_digest(DRIVES),
        **{f"code of {tracker}": tracker_digest(tracker) for tracker in trackers if tracker is not None},
        **own_code(own_names(study.scenarios, [study.settings.radar], study.planners)),
    }

"""One run of a study, by names: what is driven, on what the planner plans, and how its making ended."""

import hashlib
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import gymnasium as gym

from scenarios import SCENARIOS
from scenarios.record import Scenario
from sensors import Radar, faults_of
from testbed import planners
from testbed.environment.registration import make, scenario_of
from testbed.environment.sources import conditions
from testbed.environment.validation import OF_USERS
from testbed.files import file_stem
from testbed.frame import TRUTH
from testbed.limits import LARGEST_SEED, MOST_RUNS, check_choice, check_duration, check_settle
from trackers import DEFAULT, TRACKERS

LOOPS = ("open", "closed")
ALL = "all"
DONE, FOUND, FAILED = "done", "found", "failed"


@dataclass(frozen=True)
class Run:
    """One episode; names as in the catalogues, or as users write their own."""

    scenario: str  # without faults
    seed: int = 0
    source: str = DEFAULT  # of the planner's tracks: truth, in-view, TRACKER, TRACKER:EG, in-view+near_edge=1
    planner: str = "idm"
    radar: str | Radar = "surround"
    faults: tuple[str, ...] = ()  # of the radar
    loop: str = "closed"  # open: the drive on the truth is recorded once and its scans are given to the source
    recorded_with: str | None = (
        None  # radar that recorded an open loop, None: `radar`; else the scenes are scanned anew
    )
    duration: float | None = None  # [s] at most, None: the scenario's own
    after: float | None = None  # [s] from the end of the maneuver, at which it ends; None: with its duration
    warm_up: float = 0.0  # [s] of traffic before the first decision
    settle: float = 0.0  # [s] from the start, of which no scan enters a mean
    config: tuple[tuple[str, Any], ...] = ()  # of the environment, beside what is said above

    def __post_init__(self) -> None:
        check_choice("loop", self.loop, LOOPS)
        check_duration(self.duration)
        check_duration(self.after, "after", "a run that ends with its duration")
        check_settle(self.settle)

    @property
    def case(self) -> str:
        """The scenario with its faults, NAME+FAULT+FAULT."""
        return "+".join([self.scenario, *self.faults])

    @property
    def condition(self) -> str:
        """The source with the faults of its radar, as in `conditions`."""
        return "+".join([self.source, *self.faults])

    @cached_property
    def name(self) -> str:
        """Stem of its file: what a study varies; runs that differ otherwise belong into different folders."""
        return self._stem(self.case, self.source, *([self.planner] if self.loop == "closed" else []))

    def _stem(self, *parts: str) -> str:
        radar = [] if self.radar == "surround" else [_short(self.radar)]
        config = [_short(self.config)] if self.config else []
        return file_stem(*parts, *radar, *config, f"seed{self.seed}")

    @property
    def key(self) -> dict[str, Any]:
        """All of it as JSON types: what the file of the run says it holds."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return found | {"radar": str(self.radar), "faults": list(self.faults), "config": [list(c) for c in self.config]}

    @property
    def recording(self) -> "Run":
        """The drive on the truth that an open loop replays."""
        radar = self.recorded_with or self.radar
        truth = replace(self, source=TRUTH, planner=TRUTH, radar=radar, faults=(), loop="closed", settle=0.0)
        return replace(truth, recorded_with=None)

    @property
    def recording_name(self) -> str:
        """Stem of the file of the recording."""
        return self.recording._stem(self.scenario)

    @property
    def settings(self) -> dict[str, Any]:
        """The configuration of the environment; only scenarios of ours know when a maneuver ends."""
        ours = isinstance(scenario_of(self.scenario), Scenario)
        given = {"duration": self.duration, "after": self.after if ours else None}
        known = {key: value for key, value in given.items() if value is not None}
        return planners.settings(planners.find(self.planner)) | known | dict(self.config)

    def environment(self, **options: Any) -> gym.Env:
        """The tracked environment; options go to `TrackedEnv`. A planner that knows the truth gets it first."""
        source = conditions.source(conditions.parse(self.source), self.radar, self.seed)
        beside = [source] if planners.find(self.planner).knows_truth and self.source != TRUTH else []
        return make(
            self.scenario,
            self.settings,
            tracker=TRUTH if beside else source,
            also=beside,
            radar=self.radar,
            planner=self.planner,
            warm_up=self.warm_up,
            faults=self.faults,
            **options,
        )


def _short(value: Any) -> str:
    """A name, or a short digest of what has none."""
    return value if isinstance(value, str) else hashlib.sha256(repr(value).encode()).hexdigest()[:8]


class Outcome(NamedTuple):
    """How the making of one run ended."""

    name: str
    status: str  # done, found (it has a valid file already), failed
    note: str = ""  # sentence or traceback of a failure; which damaged file was replaced and why
    value: Any = None  # what was calculated, where that is no file


def outcome_of(name: str, work: Callable[[], str]) -> Outcome:
    """A run that fails must not stop the others: any error is caught here, and reported with its traceback.

    Of a file that cannot be written or read, and of `OF_USERS`, the sentence is enough.
    """
    try:
        note = work()
    except (OSError, *OF_USERS) as error:
        return Outcome(name, FAILED, str(error))
    except Exception:
        return Outcome(name, FAILED, traceback.format_exc())
    return Outcome(name, FOUND) if note == FOUND else Outcome(name, DONE, note)


def parse_seeds(text: str) -> tuple[int, ...]:
    """Seeds of a range `0:20` (20 excluded), a list `0,3,7`, or a single number.

    >>> parse_seeds("2:5")
    (2, 3, 4)
    """
    try:
        if ":" in text:
            first, last = (int(part) for part in text.split(":"))
            found: Sequence[int] = range(first, last)
        else:
            found = [int(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"seeds must read like 0:20, 0,3,7 or 5, got {text!r}") from None
    if not found:
        raise ValueError(f"seeds {text!r} are empty; the range 0:20 has the seeds 0 to 19")
    if found[-1] - found[0] > LARGEST_SEED or len(found) > MOST_RUNS:
        raise ValueError(f"seeds {text!r} are too many, or too large; a comparison has at most {MOST_RUNS} runs")
    return tuple(found)


def expand(names: list[str], what: str) -> tuple[str, ...]:
    """Names of scenarios or trackers; `all` among them stands for the catalogue."""
    catalogue = SCENARIOS if what == "scenarios" else TRACKERS
    return tuple(name for one in names for name in (catalogue if one == ALL else (one,)))


def with_faults(scenarios: Sequence[str], faults: Sequence[str]) -> tuple[str, ...]:
    """The scenarios, each as it is and then under each of the faults; a fault may be several, joined by `+`.

    >>> with_faults(["cut-in"], ["drop:.2"])
    ('cut-in', 'cut-in+drop:0.2')
    """
    texts = ["+".join(map(str, faults_of([fault]))) for fault in faults]
    return tuple(case for scenario in scenarios for case in (scenario, *(f"{scenario}+{text}" for text in texts)))

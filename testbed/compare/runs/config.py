"""What is compared: all combinations of scenarios, trackers and seeds, with settings that all runs share."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

from scenarios import SCENARIOS
from scenarios.record import Scenario
from sensors import faults_of
from sensors import find as find_radar
from sensors.fault_text import split_faults
from sensors.faults import chosen
from testbed.environment.registration import scenario_of
from testbed.experiments.identity import own_code, own_names, shared_digest, tracker_digest
from testbed.files import make_directory, versions, write_json
from testbed.limits import (
    LARGEST_SEED,
    MOST_RUNS,
    check_choice,
    check_duration,
    check_folder,
    check_names,
    check_seeds,
    check_settle,
)
from testbed.planners import find as find_planner
from trackers import TRACKERS, SensorModel, build
from trackers.json_file import read_json

LOOPS = ("open", "closed")
ALL = "all"
SETTINGS = "comparison.json"


class Task(NamedTuple):
    """One run."""

    scenario: str  # NAME or, with faults of the radar, NAME+FAULT+FAULT
    tracker: str
    seed: int

    @property
    def name(self) -> str:
        """Stem of its files."""
        return f"{self.scenario}_{self.tracker}_seed{self.seed}".replace(":", "~").replace("/", "-")


@dataclass(frozen=True)
class Settings:
    """What all runs of a results folder have in common; runs of other settings are not comparable with them."""

    radar: str = "surround"
    loop: str = "open"  # open: recorded scans are replayed; closed: the planner uses the tracks of each
    planner: str = "idm"  # in closed loop; recordings use the planner that knows the truth
    duration: float | None = None  # [s] of a run at most, None: the scenario's own
    after: float | None = None  # [s] from the end of the maneuver, at which a run ends; None: with its duration
    settle: float = 0.0  # [s] from the start, of which no scan enters a mean

    def __post_init__(self) -> None:
        check_choice("loop", self.loop, LOOPS)
        check_duration(self.duration)
        check_duration(self.after, "after", "a run that ends with its duration")
        check_settle(self.settle)

    def config(self, scenario: str) -> dict[str, float]:
        """How long a run is, as configuration of its environment; only scenarios of ours know when a maneuver ends."""
        ours = isinstance(scenario_of(scenario), Scenario)
        given = {"duration": self.duration, "after": self.after if ours else None}
        return {key: value for key, value in given.items() if value is not None}

    @property
    def length(self) -> str:
        """How long a run is, in words."""
        if self.after is None:
            return f"{self.duration:g} s" if self.duration else "the scenarios' own"
        most = f"{self.duration:g} s" if self.duration else "the scenario's own length"
        return f"to {self.after:g} s after the maneuver, {most} at most"


RECORD = Settings(duration=60.0, after=3.0, settle=2.0)
"""What the comparison of record and the baselines of `testbed regress` are made with."""


@dataclass(frozen=True)
class Comparison:
    """A comparison, and the folder of its results."""

    scenarios: tuple[str, ...]
    trackers: tuple[str, ...]
    seeds: tuple[int, ...]
    settings: Settings = Settings()
    reference: str | None = None  # tracker that the others are compared with, None: the first
    out: str = "runs/compare"

    def __post_init__(self) -> None:
        check_names("scenarios", self.scenarios)
        check_names("trackers", self.trackers)
        if isinstance(self.seeds, str | bytes) or not isinstance(self.seeds, Sequence):
            raise ValueError(f"seeds must be a tuple of whole numbers, got {self.seeds!r}; put them in a tuple")
        if not self.seeds:
            raise ValueError("seeds must name at least one of them, got none; see `testbed compare --help`")
        check_seeds(*self.seeds, name="seeds")
        if len(set(self.seeds)) < len(self.seeds):
            raise ValueError(f"seeds must differ, got {', '.join(map(str, self.seeds))}; drop the repetition")
        if (runs := len(self.scenarios) * len(self.trackers) * len(self.seeds)) > MOST_RUNS:
            raise ValueError(f"a comparison has at most {MOST_RUNS} runs, got {runs}; take fewer seeds or trackers")
        if not isinstance(self.settings, Settings):
            raise ValueError(f"settings must be Settings, got {self.settings!r}; leave them out for those of a command")
        check_folder(self.out)
        if self.reference is not None and not (isinstance(self.reference, str) and self.reference in self.trackers):
            raise ValueError(
                f"reference {self.reference!r} is not compared; choose one of {', '.join(self.trackers)}, or add it"
            )

    @property
    def baseline(self) -> str:
        """The tracker that the others are compared with."""
        return self.reference or self.trackers[0]

    @property
    def tasks(self) -> list[Task]:
        """All runs, those on the same detections next to each other."""
        return [Task(c, t, s) for c in self.scenarios for s in self.seeds for t in self.trackers]


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


def check_case(case: str, models: Sequence[SensorModel]) -> None:
    """Raise LookupError or ValueError for an unknown scenario, or for faults that this rig cannot have."""
    scenario, faults = split_faults(case)
    scenario_of(scenario)
    if case != (written := "+".join([scenario, *faults])):
        raise ValueError(f"scenarios: {case!r} is written {written!r}; write it so, as its files are named by it")
    for fault in faults_of(faults):
        chosen(fault.sensors, models)


def check(comparison: Comparison) -> None:
    """Raise LookupError, ValueError or OSError, in one sentence, for what cannot be run or written.

    A folder that holds runs of other settings, versions or code is refused: the sentence names the field that differs.
    """
    radar = find_radar(comparison.settings.radar)
    for case in comparison.scenarios:
        check_case(case, radar.models)
    for tracker in comparison.trackers:
        build(tracker, radar.models)
    find_planner(comparison.settings.planner)
    make_directory(Path(comparison.out))
    check_identity(Path(comparison.out), _identity_of(comparison))


def check_identity(folder: Path, wanted: dict[str, Any]) -> None:
    """Raise ValueError, naming what differs, where a folder holds runs that cannot stand beside those wanted."""
    found = _read(folder)
    for key in wanted if found else ():
        if key.startswith("code of ") and key not in found:  # no run of this tracker in the folder yet
            continue
        if found.get(key) != wanted[key]:
            raise ValueError(
                f"out: {folder} holds runs with {key} {found.get(key)!r}, wanted is {wanted[key]!r}; "
                "choose another directory, or delete that one"
            )


def write_settings(comparison: Comparison) -> None:
    """Write into the folder what its runs have in common, and the digest of the code of each tracker."""
    write_identity(Path(comparison.out), _identity_of(comparison))


def split_all(cases: Sequence[str]) -> tuple[str, ...]:
    """The scenarios of cases, without their faults, each once."""
    return tuple(dict.fromkeys(split_faults(case)[0] for case in cases))


def _identity_of(comparison: Comparison) -> dict[str, Any]:
    settings = comparison.settings
    names = own_names(
        split_all(comparison.scenarios), [settings.radar], [settings.planner] if settings.loop == "closed" else []
    )
    return {**identity(settings, comparison.trackers), **own_code(names)}


def write_identity(folder: Path, wanted: dict[str, Any]) -> None:
    """Write what identifies the runs of a folder; what stands there already stays."""
    found = _read(folder)
    wanted = {**wanted, **found}
    if wanted != found:
        write_json(folder / SETTINGS, wanted)


def read_settings(folder: Path) -> tuple[Settings, dict[str, Any]]:
    """The settings that a folder was made with, and everything else that identifies its runs.

    Raises ValueError where there are none.
    """
    found = _read(folder)
    if not found:
        raise ValueError(f"out: {folder} holds no comparison; make one with `testbed compare --out {folder}`")
    try:
        return Settings(**{f.name: found[f.name] for f in fields(Settings)}), found
    except (KeyError, ValueError):
        raise ValueError(_damaged(folder)) from None


def identity(settings: Settings, trackers: Sequence[str] = ()) -> dict[str, Any]:
    """Settings, versions of libraries, and digests of our code, as far as they decide about results."""
    return {
        **asdict(settings),
        **{f"version of {name}": version for name, version in versions().items()},
        "code": shared_digest(),
        **{f"code of {tracker}": tracker_digest(tracker) for tracker in trackers},
    }


def _read(folder: Path) -> dict[str, Any]:
    """What stands in the file of settings, nothing where there is none; ValueError where it is damaged."""
    try:
        found = read_json(folder / SETTINGS)
    except FileNotFoundError:
        return {}
    except (ValueError, OSError):
        raise ValueError(_damaged(folder)) from None
    if not isinstance(found, dict) or not found:
        raise ValueError(_damaged(folder))
    return found


def _damaged(folder: Path) -> str:
    return f"out: {folder / SETTINGS} is damaged; delete the folder, or choose another directory"

"""What a study of many runs says of itself: which runs, what is kept of each, what identifies them, how it is judged.

`store` keeps the files, `engine` makes the runs, `command.carry_out` does all of it in turn.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar, NamedTuple, Protocol

import pyarrow as pa
from rich.console import Console, RenderableType

from sensors import Radar, faults_of
from sensors.faults import chosen
from testbed.environment.perception import radar_of
from testbed.environment.registration import scenario_of
from testbed.environment.sources import conditions
from testbed.experiments.engine import Engine
from testbed.experiments.episode import Played, episode
from testbed.experiments.identity import modules_digest, own_code, own_names, shared_digest, tracker_digest
from testbed.experiments.run import DONE, FAILED, Outcome, Run
from testbed.files import check_target, make_directory, versions
from testbed.frame import Frame
from testbed.limits import MOST_RUNS, check_folder, check_seeds
from testbed.planners import find as find_planner
from trackers import build

Progress = Callable[[int, int, str], None]  # done, total, what
WHOLE_RUN = "all"  # in place of a phase


class Kept(NamedTuple):
    """What is kept of a run."""

    table: pa.Table  # in the schema of the study
    spans: Sequence[Mapping[str, Any]]  # flat rows of JSON types: the whole run first, then its phases if there are any
    seconds: Mapping[str, float] = {}  # wall time by part
    more: Mapping[str, Any] = {}  # anything else of JSON types


@dataclass
class Tally:
    """How the runs of a study ended."""

    done: int = 0  # made now
    found: int = 0  # made before
    failed: list[Outcome] = field(default_factory=list)
    redone: list[Outcome] = field(default_factory=list)  # replaced damaged files, which the notes name
    wall: float = 0.0  # [s]
    exit_status: int = 0  # 128 + signal where one ended it early

    @property
    def interrupted(self) -> bool:
        """Whether runs are missing because a signal ended the work early."""
        return self.exit_status != 0

    def add(self, outcome: Outcome) -> None:
        """Count one outcome."""
        if outcome.status == FAILED:
            self.failed.append(outcome)
        elif outcome.status == DONE:
            self.done += 1
            if outcome.note:
                self.redone.append(outcome)
        else:
            self.found += 1


class Watch(Protocol):
    """What watches a run: an observer of its frames, called with every frame that has a scan.

    If it has `begin(phases)`, that is called before the first frame.
    """

    def __call__(self, frame: Frame) -> None:
        """Take one frame."""

    def kept(self, played: Played) -> Kept:
        """What is kept, when the run is over."""


class Findings(NamedTuple):
    """What a study found, as a terminal shows it."""

    shown: Sequence[RenderableType] = ()  # tables, then sentences
    failed: bool = False  # the answer is no: exit status 1
    data: Any = None  # of the study: what its page and its JUnit file are made from


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study and the folder of its results. A subclass says what is varied, what is kept and how it is judged.

    `store` is a `testbed.experiments.store.Store`, `results` are its `Results`.
    """

    out: str = "runs/study"

    name: ClassVar[str] = "study"  # `testbed NAME`, also in the file of the folder
    what: ClassVar[str] = "runs"  # of which a bar shows how many are done
    schema: ClassVar[pa.Schema]  # of the table of a run
    modules: ClassVar[tuple[str, ...]] = ()  # that decide about results, beside the code behind every run
    whole: ClassVar[bool] = False  # judged only when all work is done or has failed, then also where nothing was made
    fresh: ClassVar[bool] = False  # runs of other code are deleted; else the folder is refused

    def __post_init__(self) -> None:
        check_folder(self.out)

    def work(self) -> list[Any]:
        """All units of work, each for one process: a `Run`, or a search over many that has its `name` and its `key`."""
        raise NotImplementedError

    def together(self, work: Any) -> Any:
        """What belongs to one group of work, which is made together, so that an interruption leaves whole groups."""
        return work.scenario, work.seed

    def columns(self, work: Any) -> dict[str, Any]:
        """What names a unit of work in tables."""
        return {"scenario": work.case, "tracker": work.source, "seed": work.seed}

    def shared(self) -> dict[str, Any]:
        """What all runs have in common, as JSON types, as far as it decides about results."""
        return {}

    def watch(self, run: Run) -> Watch:
        """What watches a run."""
        raise NotImplementedError

    def make(self, work: Any, store: Any) -> Kept:
        """Do one unit of work: an episode, on its recording in open loop."""
        watch, start = self.watch(work), perf_counter()
        recording = store.recording(work) if work.loop == "open" else None
        seconds = {} if recording is None else {"loading": perf_counter() - start}
        played = episode(work, [watch], recording)
        kept = watch.kept(played)
        seconds = seconds | played.seconds
        return kept._replace(seconds=seconds | {"metrics": perf_counter() - start - sum(seconds.values())})

    def judge(self, results: Any, tally: Tally) -> Findings:
        """What the runs that there are say."""
        return Findings()

    def write(self, results: Any, found: Findings, console: Console) -> None:
        """Write tables into the folder; raises OSError, in one sentence, where that cannot be."""

    def page(self, results: Any, found: Findings, tally: Tally, engine: Engine, progress: Progress) -> Path | None:
        """Write a report with its figures, and logs made on the engine; return its path. OSError as in `write`."""
        return None

    def junit(self, results: Any, found: Findings, tally: Tally, path: Path) -> None:
        """Write the findings as JUnit XML; OSError as in `write`."""
        raise NotImplementedError

    def check(self) -> None:
        """Raise LookupError, TypeError or ValueError, in one sentence, for what cannot be run."""
        works = self.work()
        if len(works) > MOST_RUNS:
            raise ValueError(f"a study has at most {MOST_RUNS} runs, got {len(works)}; take fewer seeds or trackers")
        if len({work.name for work in works}) < len(works):
            raise ValueError("two runs have the same name; drop the repetition")
        check_runs([work for work in works if isinstance(work, Run)])

    def runs(self) -> list[Run]:
        """The runs of which the scenarios, sources, planners and radars are used."""
        return [work for work in self.work() if isinstance(work, Run)]

    def identity(self) -> dict[str, Any]:
        """Settings, versions of libraries, and digests of code, as far as they decide about results."""
        runs = self.runs()
        trackers = dict.fromkeys(conditions.parse(source).tracker for source in dict.fromkeys(r.source for r in runs))
        own = own_names(
            dict.fromkeys(run.scenario for run in runs),
            dict.fromkeys(run.radar for run in runs if isinstance(run.radar, str)),
            dict.fromkeys(run.planner for run in runs if run.loop == "closed"),
        )
        return {
            "study": self.name,
            **self.shared(),
            **{f"version of {name}": version for name, version in versions().items()},
            "code": shared_digest(),
            **({"code of the study": modules_digest(self.modules)} if self.modules else {}),
            **{f"code of {tracker}": tracker_digest(tracker) for tracker in trackers if tracker is not None},
            **own_code(own),
        }


def check_sample(seeds: Sequence[int], command: str) -> None:
    """Raise ValueError, in one sentence, for what is no tuple of different seeds."""
    if isinstance(seeds, str | bytes) or not isinstance(seeds, Sequence):
        raise ValueError(f"seeds must be a tuple of whole numbers, got {seeds!r}; put them in a tuple")
    if not seeds:
        raise ValueError(f"seeds must name at least one of them, got none; see `testbed {command} --help`")
    check_seeds(*seeds, name="seeds")
    if len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds must differ, got {', '.join(map(str, seeds))}; drop the repetition")


def check_file(what: str, path: Path) -> None:
    """Raise OSError, in one sentence that begins with what the file is, where it cannot be written."""
    try:
        check_target(path)
        make_directory(path.parent)
    except OSError as error:
        raise OSError(f"{what}: {str(error).removeprefix('out: ')}") from None


def check_runs(runs: Sequence[Run]) -> None:
    """Raise LookupError, TypeError or ValueError, in one sentence, for names and faults that no run can have."""
    for scenario in dict.fromkeys(run.scenario for run in runs):
        scenario_of(scenario)
    for planner in dict.fromkeys(run.planner for run in runs):
        find_planner(planner)
    for radar, faults in dict.fromkeys((run.radar, run.faults) for run in runs):
        models = radar_of(radar).models
        for fault in faults_of(faults):
            chosen(fault.sensors, models)
    for source, radar in dict.fromkeys((run.source, run.radar) for run in runs):
        check_source(source, radar)


def check_source(source: str, radar: str | Radar) -> None:
    """Raise LookupError or ValueError, in one sentence, for a source of tracks that cannot be."""
    condition = conditions.parse(source)
    if condition.tracker is not None:
        build(condition.tracker, radar_of(radar).models)
    conditions.source(condition, radar, 0)

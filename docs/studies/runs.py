"""The runs of a study made with what the testbed has for many runs: resume, processes here, or a Dask cluster.

`made` does it for any study, `summaries` for runs of which the summary of the tracker alone is kept.
"""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import pyarrow as pa
import typer

from sensors import Radar, Sensor
from testbed.command_line.terminal import console, progress_bar, stages, user_input
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.experiments.command import calculated, check, execute, show_tally
from testbed.experiments.engine import Engine
from testbed.experiments.episode import Played
from testbed.experiments.run import Run
from testbed.experiments.store import Results
from testbed.experiments.study import WHOLE_RUN, Kept, Study
from testbed.frame import Frame

COUNT = "{task.completed:.0f} of {task.total:.0f}"
NOTHING = pa.schema([("nothing", pa.int8())])  # of studies that keep no table of a run


def made(study: Study, engine: Engine) -> Results:
    """What the runs left, after those that the folder lacks have been made.

    Raises typer.Exit where a signal ended it early, or a run failed.
    """
    with (
        user_input((LookupError, OSError, TypeError, ValueError)),
        progress_bar(COUNT) as bar,
    ):
        check(study, engine)
        tally = execute(study, engine, stages(bar))
    show_tally(tally, console)
    if tally.interrupted or tally.failed:
        raise typer.Exit(tally.exit_status or 1)
    return Results.read(study)


@dataclass(frozen=True, kw_only=True)
class Summaries(Study):
    """Runs of which the summary of the tracker is kept."""

    asked: tuple[Run, ...] = ()

    name: ClassVar[str] = "summaries"
    schema: ClassVar[pa.Schema] = NOTHING
    modules: ClassVar[tuple[str, ...]] = ("studies.runs",)

    def work(self) -> list[Run]:
        """All of them."""
        return list(self.asked)

    def watch(self, run: Run) -> "Summary":
        """What evaluates the tracker."""
        return Summary(run.source)


class Summary:
    """Evaluates the tracker of a run."""

    def __init__(self, tracker: str) -> None:
        self._tracker, self._evaluator = tracker, Evaluator(tracker)

    def begin(self, phases: Sequence[Any]) -> None:
        """Phases are not told apart."""

    def __call__(self, frame: Frame) -> None:
        """Evaluate one frame."""
        self._evaluator.step(frame.time, frame.scene, frame.origin, frame.outputs[self._tracker][0])

    def kept(self, played: Played) -> Kept:
        """The summary."""
        return Kept(NOTHING.empty_table(), [{"phase": WHOLE_RUN, **jsonable(self._evaluator.summary())}])


def summaries(runs: Sequence[Run], out: str, engine: Engine) -> Callable[[Run], dict[str, Any]]:
    """The summary of each run by its measures, NaN where one was not measured."""
    metas = made(Summaries(asked=tuple(dict.fromkeys(runs)), out=out), engine).metas
    return lambda run: {key: float("nan") if v is None else v for key, v in metas[run]["spans"][0].items()}


def calculate(
    function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]], engine: Engine, what: str
) -> list[Any]:
    """function(*each) for all arguments, in their order, with a progress bar; nothing is kept in files."""
    found = []
    with (
        user_input((OSError, ValueError)),
        progress_bar(COUNT) as bar,
        closing(calculated(function, arguments, engine)) as values,
    ):
        show = stages(bar)
        for value in values:
            found.append(value)
            show(len(found), len(arguments), what)
    return found


def seen_by(radar: Radar, scenario: str, seed: int, tracker: str, duration: float) -> Run:
    """A run on a drive that the ideal radar recorded, as another one sees it; radars that draw alike see alike."""
    return Run(scenario, seed, tracker, radar=radar, loop="open", recorded_with="ideal", duration=duration)


def every_sensor(radar: Radar, change: Callable[[Sensor], Sensor]) -> Radar:
    """The rig with each of its sensors changed."""
    return replace(radar, sensors=tuple(change(sensor) for sensor in radar.sensors))

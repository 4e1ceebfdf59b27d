"""How soon the motion models of a tracker follow a vehicle: the page docs/modes.md, its tables and its figure.

The ego's planner uses the truth, so that every tracker gets the same detections.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pyarrow as pa
import typer
from numpy.typing import NDArray

from scenarios import find as find_scenario
from studies.modes.figure import ModePanel, draw
from studies.page import DOCS, Docs, Page, fill
from studies.runs import made
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import user_input
from testbed.evaluation.tracking import Evaluator
from testbed.experiments.engine import Engine
from testbed.experiments.episode import Played
from testbed.experiments.run import Run
from testbed.experiments.study import WHOLE_RUN, Kept, Study
from testbed.frame import Frame
from testbed.log.modes import mode_names, probabilities
from testbed.log.text import markdown_table
from trackers.geometry import dot, unit

ACCELERATION = 1.0  # [m/s^2] along the heading, above which a vehicle accelerates or brakes
YAW_RATE = 0.05  # [rad/s] above which it turns
SHORTEST = 0.5  # [s] a shorter phase belongs to the one before: the middle of a swerve is no straight drive
IN_TIME = 0.5  # [s] delay up to which a phase counts as recognised in time
MODES = ("cv", "ca", "ct")  # of the truth
SCENES = {"hard-brake": 13.0, "double-lane-change": 13.0, "u-turn": 14.0}  # [s] long enough for the maneuver
SEEDS = 5
RADAR = "surround"
SCHEMA = pa.schema([("value", pa.float64())])  # of rows as `history` takes them, one after the other


class ModeHistory(NamedTuple):
    """One vehicle in n frames, and the motion models of its track."""

    time: NDArray  # (n,) [s]
    acceleration: NDArray  # (n, 2) [m/s^2] along the heading and to its right
    yaw_rate: NDArray  # (n,) [rad/s]
    probability: NDArray  # (n, K), NaN without a track

    @property
    def velocity_change(self) -> float:
        """How much its velocity changed while it was tracked [m/s], changes in all directions added up."""
        tracked = np.isfinite(self.probability[:, 0])
        return float((np.hypot(*self.acceleration.T) * np.gradient(self.time))[tracked].sum())


Runs = dict[str, list[ModeHistory]]  # by scenario, one a seed


class MotionPhase(NamedTuple):
    """Frames `start` to `end` - 1, in which a vehicle moves in one way."""

    mode: int  # of MODES
    start: int
    end: int


class Delay(NamedTuple):
    """How late a phase was recognised; infinite where it never was."""

    mode: int  # of MODES
    right: float  # [s] until its own model was the most likely one
    moved: float  # [s] until the model of the phase before was not the most likely one any more


class ModeProbe:
    """Observer of a replay that keeps the motion of all vehicles and the models of their tracks."""

    def __init__(self, tracker: str) -> None:
        self.tracker, self.names = tracker, mode_names(tracker)
        if not self.names:
            raise ValueError(f"tracker {tracker} has no motion models to choose from; take one such as edra-imm")
        self._evaluator = Evaluator(tracker)
        self._rows: dict[int, list[NDArray]] = {}

    def __call__(self, frame: Frame) -> None:
        """Keep the states and mode probabilities of one frame."""
        tracks, info = frame.outputs[self.tracker]
        score = self._evaluator.step(frame.time, frame.scene, frame.origin, tracks)
        known = probabilities(info, self.names)
        unknown, objects = np.full(len(self.names), np.nan), frame.scene.objects
        for i, number in enumerate(objects.id.tolist()):
            p = known.get(score.pairs.get(number, -1), unknown)
            row = np.concatenate([[frame.time, objects.pose[i, 2], *objects.velocity[i], objects.yaw_rate[i]], p])
            self._rows.setdefault(number, []).append(row)

    def begin(self, phases: Sequence[Any]) -> None:
        """Phases of the maneuver are not told apart."""

    @property
    def rows(self) -> dict[int, NDArray]:
        """Rows (n, 5 + K) as `history` takes them, by object, of all that were there for at least three frames."""
        return {number: np.array(rows) for number, rows in self._rows.items() if len(rows) > 2}

    def kept(self, played: Played) -> Kept:
        """The vehicle whose velocity changes most."""
        rows = max(self.rows.values(), key=lambda rows: history(rows).velocity_change)
        table = pa.table({"value": rows.ravel()}, SCHEMA)
        return Kept(table, [{"phase": WHOLE_RUN}], more={"width": rows.shape[1]})


@dataclass(frozen=True, kw_only=True)
class Maneuvers(Study):
    """Runs on recordings, and the motion of one vehicle in each."""

    tracker: str = "edra-imm"
    durations: tuple[tuple[str, float], ...] = ()  # [s] by scenario
    seeds: int = 1

    name: ClassVar[str] = "modes"
    schema: ClassVar[pa.Schema] = SCHEMA
    modules: ClassVar[tuple[str, ...]] = ("studies.modes.page",)

    def work(self) -> list[Run]:
        """Every scenario with every seed."""
        return [
            Run(scenario, seed, self.tracker, radar=RADAR, loop="open", duration=duration)
            for scenario, duration in self.durations
            for seed in range(self.seeds)
        ]

    def watch(self, run: Run) -> ModeProbe:
        """What keeps the motion."""
        return ModeProbe(run.source)


def history(rows: NDArray) -> ModeHistory:
    """From rows (n, 5 + K) of time, heading, velocity, yaw rate and probabilities."""
    time, heading, velocity = rows[:, 0], rows[:, 1], rows[:, 2:4]
    a = np.gradient(velocity, time, axis=0)
    along = unit(heading)
    side = np.stack([-along[:, 1], along[:, 0]], -1)
    return ModeHistory(time, np.stack([dot(a, along), dot(a, side)], -1), rows[:, 4], rows[:, 5:])


def true_modes(history: ModeHistory) -> NDArray:
    """What the vehicle does in each frame (n,), of MODES; turning counts before braking."""
    brakes, turns = np.abs(history.acceleration[:, 0]) > ACCELERATION, np.abs(history.yaw_rate) > YAW_RATE
    return np.where(turns, 2, np.where(brakes, 1, 0))


def phases(mode: NDArray, time: NDArray) -> list[MotionPhase]:
    """The frames cut where their mode (n,) changes; phases shorter than SHORTEST belong to the one before."""
    cuts = [0, *(np.flatnonzero(np.diff(mode)) + 1).tolist(), len(mode)]
    found: list[MotionPhase] = []
    for start, end in pairwise(cuts):
        brief = time[min(end, len(time) - 1)] - time[start] < SHORTEST - 1e-9
        if found and (brief or found[-1].mode == mode[start]):
            found[-1] = found[-1]._replace(end=end)
        else:
            found.append(MotionPhase(int(mode[start]), start, end))
    return found


def delays(history: ModeHistory, names: Sequence[str]) -> list[Delay]:
    """Of every phase but the first, if the vehicle had a track when it began; 0 for a model that was ahead already."""
    likely = most_likely(history, names)
    found = []
    for before, phase in pairwise(phases(true_modes(history), history.time)):
        estimated = likely[phase.start : phase.end]
        if estimated[0] >= 0:
            time = history.time[phase.start : phase.end] - history.time[phase.start]
            right, moved = estimated == phase.mode, (estimated != before.mode) & (estimated >= 0)
            found.append(Delay(phase.mode, _first(time, right), _first(time, moved)))
    return found


def _first(time: NDArray, where: NDArray) -> float:
    """Least time [s] where it holds, infinite where it never does."""
    return float(time[where].min(initial=np.inf))


def most_likely(history: ModeHistory, names: Sequence[str]) -> NDArray:
    """The most likely model in each frame (n,), of MODES; -1 without a track."""
    known = np.isfinite(history.probability[:, 0])
    place = np.array([MODES.index(name) for name in names])
    return np.where(known, place[np.where(known[:, None], history.probability, 0.0).argmax(-1)], -1)


def confusion(histories: Sequence[ModeHistory], names: Sequence[str]) -> NDArray:
    """Frames with a track (3, 3): rows what the vehicle did, columns the most likely model."""
    table = np.zeros((len(MODES), len(MODES)), int)
    for h in histories:
        true, estimated = true_modes(h), most_likely(h, names)
        np.add.at(table, (true[estimated >= 0], estimated[estimated >= 0]), 1)
    return table


def delay_row(name: str, found: Sequence[Delay]) -> tuple[str, ...]:
    """Cells of a row: number of phases; median and worst delay and number in time, of the right model and of any."""
    cells = [name, str(len(found))]
    for d in (np.array([f.right for f in found]), np.array([f.moved for f in found])):
        cells += [_time(np.median(d)), _time(d.max()), f"{int((d <= IN_TIME + 1e-6).sum())}"] if len(d) else ["–"] * 3
    return tuple(cells)


def _time(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "never"


def delay_table(runs: Runs, names: Sequence[str]) -> str:
    """One row a scenario and way to move."""
    rows = []
    for scenario, histories in runs.items():
        found = [d for h in histories for d in delays(h, names)]
        for k, mode in enumerate(MODES):
            if chosen := [d for d in found if d.mode == k]:
                rows.append(delay_row(f"{scenario}, to {mode}", chosen))
    head = ("phase", "phases", "right: median [s]", "worst [s]", f"within {IN_TIME:g} s")
    return markdown_table((*head, "left the old: median [s]", "worst [s]", f"within {IN_TIME:g} s"), rows)


def confusion_table(runs: Runs, names: Sequence[str]) -> str:
    """Shares [%] of the frames, one row a scenario and way to move."""
    rows = []
    for scenario, histories in runs.items():
        for mode, row in zip(MODES, confusion(histories, names), strict=True):
            if row.sum():
                rows.append((f"{scenario}, {mode}", str(row.sum()), *(f"{100 * n / row.sum():.0f}" for n in row)))
    return markdown_table(("the vehicle", "frames", *(f"{mode} most likely [%]" for mode in MODES)), rows)


def render(tracker: str, runs: Runs) -> str:
    """What the page says about some runs."""
    names = mode_names(tracker)
    return fill(
        "modes/page.md.j2",
        tracker=tracker,
        seeds=max(map(len, runs.values())),
        radar=RADAR,
        yaw=YAW_RATE,
        accel=ACCELERATION,
        shortest=SHORTEST,
        delays=delay_table(runs, names),
        confusion=confusion_table(runs, names),
    )


def panels(runs: Runs) -> dict[str, list[ModePanel]]:
    """What the figure shows of some runs."""
    return {
        scenario: [ModePanel(h.time, true_modes(h), h.probability) for h in histories]
        for scenario, histories in runs.items()
    }


def main(
    docs: Docs = DOCS,
    tracker: Annotated[str, typer.Option(help="One that mixes motion models.")] = "edra-imm",
    scenario: Annotated[list[str] | None, typer.Option(help="Repeat; some with hard maneuvers without it.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="0 to one less than this.")] = SEEDS,
    out: Annotated[str, typer.Option(help="Directory of the runs; those that are there are kept.")] = "runs/modes",
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Hold the motion models of a tracker against the truth, and write modes.md with its figure.

    Example: PYTHONPATH=docs python -m studies modes --tracker dra-imm --scenario cut-in --seeds 2
    """
    with user_input():
        chosen = {name: SCENES.get(name, find_scenario(name).duration) for name in scenario or SCENES}
        ModeProbe(tracker)
        page = Page("modes", docs)
    study = Maneuvers(tracker=tracker, durations=tuple(chosen.items()), seeds=seeds, out=out)
    results = made(study, Engine(jobs, dask))
    runs: Runs = {name: [] for name in chosen}
    for run, meta in results.metas.items():
        values = results.store.table(run)["value"].to_numpy()
        runs[run.scenario].append(history(values.reshape(-1, meta["width"])))
    draw(panels(runs), mode_names(tracker), page.picture("modes"))
    page.write(render(tracker, runs))

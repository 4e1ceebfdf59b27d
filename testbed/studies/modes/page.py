"""How soon the motion models of a tracker follow a vehicle: the page docs/modes.md, its tables and its figure.

Made by `python -m testbed.studies.modes.page --docs docs`. The truth drives, so that every tracker sees the same. What
stands on the page below the line NOTES is written by hand, and kept.
"""

import shlex
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console

from scenarios import find as find_scenario
from sensors.origin import Origin
from sensors.scene import Scene
from testbed.command_line.terminal import progress_bar, user_input
from testbed.compare.runs.recording import record
from testbed.compare.runs.replay import replay
from testbed.evaluation.tracking import Evaluator
from testbed.files import make_directory, write_atomic
from testbed.frame import Outputs
from testbed.log.modes import mode_names, probabilities
from testbed.log.record import TrackerFrame
from testbed.log.text import markdown_table
from testbed.studies.modes.figure import Panel, draw
from testbed.studies.page import NOTES, notes_of
from trackers.geometry import dot, unit
from trackers.scan import Scan

ACCELERATION = 1.0  # [m/s^2] along the heading, above which a vehicle accelerates or brakes
YAW_RATE = 0.05  # [rad/s] above which it turns
SHORTEST = 0.5  # [s] a shorter phase belongs to the one before: the middle of a swerve is no straight drive
WANTED = 0.5  # [s] delay that the page is about
MODES = ("cv", "ca", "ct")  # of the truth
SCENES = {"hard-brake": 13.0, "double-lane-change": 13.0, "u-turn": 14.0}  # [s] long enough for the maneuver
SEEDS = 5
RADAR = "surround"


class Course(NamedTuple):
    """One vehicle at n looks of the radar, and the motion models of its track."""

    time: NDArray  # (n,) [s]
    acceleration: NDArray  # (n, 2) [m/s^2] along the heading and to its right
    yaw_rate: NDArray  # (n,) [rad/s]
    probability: NDArray  # (n, K), NaN without a track

    @property
    def liveliness(self) -> float:
        """How much its velocity changed while it was tracked [m/s], changes in all directions added up."""
        tracked = np.isfinite(self.probability[:, 0])
        return float((np.hypot(*self.acceleration.T) * np.gradient(self.time))[tracked].sum())


class Phase(NamedTuple):
    """A time in which a vehicle moves in one way, from a look to the one before `end`."""

    mode: int  # of MODES
    start: int
    end: int


class Delay(NamedTuple):
    """How late a phase was recognised; infinite where it never was."""

    mode: int  # of MODES
    right: float  # [s] until its own model was the most likely
    moved: float  # [s] until some other than that of the phase before was


class ModeProbe:
    """Observer of a replay that keeps the courses of all vehicles."""

    def __init__(self, tracker: str) -> None:
        self.tracker, self.names = tracker, mode_names(tracker)
        if not self.names:
            raise ValueError(f"tracker {tracker} has no motion models to choose from; take one such as edra-imm")
        self._evaluator = Evaluator(tracker)
        self._rows: dict[int, list[NDArray]] = {}

    def __call__(
        self, step: int, time: float, scene: Scene, scan: Scan, origin: Origin, outputs: Outputs, *drive: object
    ) -> None:
        """Take in one look."""
        tracks, info = outputs[self.tracker]
        score = self._evaluator.step(time, scene, origin, tracks)
        known = probabilities(TrackerFrame(tracks, info, score.pairs, score.errors, score.mean), self.names)
        unknown, objects = np.full(len(self.names), np.nan), scene.objects
        for i, number in enumerate(objects.id.tolist()):
            p = known.get(score.pairs.get(number, -1), unknown)
            row = np.concatenate([[time, objects.pose[i, 2], *objects.velocity[i], objects.yaw_rate[i]], p])
            self._rows.setdefault(number, []).append(row)

    @property
    def courses(self) -> dict[int, Course]:
        """By object, of all that were there for some looks."""
        return {number: course(np.array(rows)) for number, rows in self._rows.items() if len(rows) > 2}


def course(rows: NDArray) -> Course:
    """From rows (n, 5 + K) of time, heading, velocity, yaw rate and probabilities."""
    time, heading, velocity = rows[:, 0], rows[:, 1], rows[:, 2:4]
    a = np.gradient(velocity, time, axis=0)
    along = unit(heading)
    side = np.stack([-along[:, 1], along[:, 0]], -1)
    return Course(time, np.stack([dot(a, along), dot(a, side)], -1), rows[:, 4], rows[:, 5:])


def true_modes(course: Course) -> NDArray:
    """What the vehicle does at each look (n,), of MODES; one that turns turns, whether it brakes or not."""
    brakes, turns = np.abs(course.acceleration[:, 0]) > ACCELERATION, np.abs(course.yaw_rate) > YAW_RATE
    return np.where(turns, 2, np.where(brakes, 1, 0))


def phases(mode: NDArray, time: NDArray) -> list[Phase]:
    """The course cut where its mode (n,) changes; phases shorter than SHORTEST belong to the one before."""
    cuts = [0, *(np.flatnonzero(np.diff(mode)) + 1).tolist(), len(mode)]
    found: list[Phase] = []
    for start, end in pairwise(cuts):
        brief = time[min(end, len(time) - 1)] - time[start] < SHORTEST - 1e-9
        if found and (brief or found[-1].mode == mode[start]):
            found[-1] = found[-1]._replace(end=end)
        else:
            found.append(Phase(int(mode[start]), start, end))
    return found


def delays(course: Course, names: Sequence[str]) -> list[Delay]:
    """Of every phase but the first, where the vehicle had a track as it began; 0 for a model that led already."""
    likely = most_likely(course, names)
    found = []
    for before, phase in pairwise(phases(true_modes(course), course.time)):
        told = likely[phase.start : phase.end]
        if told[0] >= 0:
            time = course.time[phase.start : phase.end] - course.time[phase.start]
            right, moved = told == phase.mode, (told != before.mode) & (told >= 0)
            found.append(Delay(phase.mode, _first(time, right), _first(time, moved)))
    return found


def _first(time: NDArray, where: NDArray) -> float:
    """Least time [s] where it holds, infinite where it never does."""
    return float(time[where].min(initial=np.inf))


def most_likely(course: Course, names: Sequence[str]) -> NDArray:
    """Of MODES at each look (n,), -1 without a track."""
    known = np.isfinite(course.probability[:, 0])
    place = np.array([MODES.index(name) for name in names])
    return np.where(known, place[np.where(known[:, None], course.probability, 0.0).argmax(-1)], -1)


def confusion(courses: Sequence[Course], names: Sequence[str]) -> NDArray:
    """Looks with a track (3, 3): rows what the vehicle did, columns the most likely model."""
    table = np.zeros((len(MODES), len(MODES)), int)
    for c in courses:
        true, told = true_modes(c), most_likely(c, names)
        np.add.at(table, (true[told >= 0], told[told >= 0]), 1)
    return table


def maneuvering(scenario: str, seed: int, tracker: str, duration: float) -> Course:
    """The liveliest vehicle of one drive."""
    probe = ModeProbe(tracker)
    replay(record(scenario, seed, RADAR, duration), [tracker], [probe])
    return max(probe.courses.values(), key=lambda c: c.liveliness)


def delay_row(name: str, found: Sequence[Delay]) -> tuple[str, ...]:
    """Cells of a table: phases, median and worst delay of the right model, how many in time, the same of any move."""
    cells = [name, str(len(found))]
    for d in (np.array([f.right for f in found]), np.array([f.moved for f in found])):
        cells += [_time(np.median(d)), _time(d.max()), f"{int((d <= WANTED + 1e-6).sum())}"] if len(d) else ["–"] * 3
    return tuple(cells)


def _time(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "never"


def delay_table(runs: dict[str, list[Course]], names: Sequence[str]) -> str:
    """One row a scenario and way to move."""
    rows = []
    for scenario, courses in runs.items():
        found = [d for c in courses for d in delays(c, names)]
        for k, mode in enumerate(MODES):
            if chosen := [d for d in found if d.mode == k]:
                rows.append(delay_row(f"{scenario}, to {mode}", chosen))
    head = ("phase", "phases", "right: median [s]", "worst [s]", f"within {WANTED:g} s")
    return markdown_table((*head, "left the old: median [s]", "worst [s]", f"within {WANTED:g} s"), rows)


def confusion_table(runs: dict[str, list[Course]], names: Sequence[str]) -> str:
    """Shares [%] of the looks, one row a scenario and way to move."""
    rows = []
    for scenario, courses in runs.items():
        for mode, row in zip(MODES, confusion(courses, names), strict=True):
            if row.sum():
                rows.append((f"{scenario}, {mode}", str(row.sum()), *(f"{100 * n / row.sum():.0f}" for n in row)))
    return markdown_table(("the vehicle", "looks", *(f"{mode} likeliest [%]" for mode in MODES)), rows)


PAGE = """# Motion models against the truth

Written by `{command}` on {date}; do not edit it by hand but for the notes at its end.

`{tracker}` mixes the motion models cv (constant velocity), ca (constant acceleration) and ct (coordinated turn). This
page holds the probabilities of the models against what the vehicle does, for the vehicle whose velocity changes most in
each of {seeds} seeds. The truth drives the ego; the radar is `{radar}`.

A vehicle turns (ct) at a yaw rate above {yaw:g} rad/s, else accelerates or brakes (ca) at more than {accel:g} m/s^2
along its heading, else drives steadily (cv). Phases shorter than {shortest:g} s count to the one before. The delay of
a phase is the time from its beginning until its model is the most likely one, 0 where that led already, "never" where
it never was within the phase; "left the old" is the time until the model of the phase before is no longer the most
likely. On a road, ca and ct explain a swerve nearly as well: both have an acceleration across the heading.

![Probabilities of the motion models](pictures/modes.png)

The shade is what the vehicle does: none for cv, the colour of the model for ca and ct.

## Delays

{delays}

## Likeliest model at every look

{confusion}

{mark}{notes}"""


def page(command: str, tracker: str, runs: dict[str, list[Course]], notes: str = "\n") -> str:
    """The whole page with its notes."""
    names = mode_names(tracker)
    return PAGE.format(
        command=command,
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        tracker=tracker,
        seeds=max(map(len, runs.values())),
        radar=RADAR,
        yaw=YAW_RATE,
        accel=ACCELERATION,
        shortest=SHORTEST,
        delays=delay_table(runs, names),
        confusion=confusion_table(runs, names),
        mark=NOTES,
        notes=notes,
    )


def panels(runs: dict[str, list[Course]]) -> dict[str, list[Panel]]:
    """What the figure shows of the courses."""
    return {
        scenario: [Panel(c.time, true_modes(c), c.probability) for c in courses] for scenario, courses in runs.items()
    }


def main(
    docs: Annotated[Path, typer.Option(help="Directory for the page; its figure goes to pictures/ in it.")] = Path(
        "runs/modes"
    ),
    tracker: Annotated[str, typer.Option(help="One that mixes motion models.")] = "edra-imm",
    scenario: Annotated[list[str] | None, typer.Option(help="Repeat; some with hard maneuvers without it.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="0 to one less than this.")] = SEEDS,
) -> None:
    """Hold the motion models of a tracker against the truth, and write modes.md with its figure.

    Example: python -m testbed.studies.modes.page --tracker dra-imm --scenario cut-in --seeds 2
    """
    with user_input():
        chosen = {name: SCENES.get(name, find_scenario(name).duration) for name in scenario or SCENES}
        ModeProbe(tracker)
        make_directory(docs / "pictures")
    runs: dict[str, list[Course]] = {name: [] for name in chosen}
    with progress_bar("{task.completed:.0f} of {task.total:.0f} drives") as bar:
        task = bar.add_task(tracker, total=len(chosen) * seeds)
        for name, duration in chosen.items():
            for seed in range(seeds):
                runs[name].append(maneuvering(name, seed, tracker, duration))
                bar.advance(task)
    command = shlex.join(["python", "-m", "testbed.studies.modes.page", *sys.argv[1:]])
    path = docs / "modes.md"
    write_atomic(path, page(command, tracker, runs, notes_of(path)))
    draw(panels(runs), mode_names(tracker), docs / "pictures" / "modes.png")
    Console().print(f"page     {path}", soft_wrap=True)


if __name__ == "__main__":
    typer.run(main)

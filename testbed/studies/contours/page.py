"""What `pmht-spline-adaptive` learns of contours and classes: the page docs/contours.md, its picture and its tables.

Made by `python -m testbed.studies.contours.page --docs docs`. What stands on the page below the line NOTES is written
by hand, and kept.
"""

import shlex
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from scenarios import SCENARIOS
from testbed.command_line.terminal import progress_bar, user_input
from testbed.compare.runs.recording import record
from testbed.compare.runs.replay import replay
from testbed.files import make_directory, write_atomic
from testbed.log.text import markdown_table
from testbed.studies.contours.classes import SURE, ClassProbe, Story, calibration, confusion_table, delay_table
from testbed.studies.contours.drive import KINDS, Passing, Seen, drive
from testbed.studies.contours.figure import draw
from testbed.studies.page import NOTES, notes_of

TRACKER, PLAIN = "pmht-spline-adaptive", "pmht-spline"
MOMENTS = (1.0, 5.0, 30.0)  # [s]; before the first, hardly anything is learned
RADAR = "surround"
Drives = Mapping[tuple[str, str], Sequence[Seen]]  # by class and tracker, one a seed


def looks_at(seen: Seen, moment: float) -> slice:
    """The looks of the second before a moment [s]."""
    last = min(int(np.searchsorted(seen.time, moment - 1e-9)), len(seen.time) - 1)
    return slice(max(last - 14, 0), last + 1)


def drive_table(drives: Drives) -> str:
    """One row a class and tracker, means over the seeds and the second before each moment."""
    rows = []
    for (kind, tracker), runs in drives.items():
        cells = [kind, tracker]
        for moment in MOMENTS:
            parts = [(s, looks_at(s, moment)) for s in runs]
            for values in (
                [s.iou[k] for s, k in parts],
                [np.abs(s.length_error[k]) for s, k in parts],
                [s.position_error[k] for s, k in parts],
            ):
                flat = np.concatenate(values)
                cells.append(f"{np.nanmean(flat):.2f}" if np.isfinite(flat).any() else "–")
        rows.append(tuple(cells))
    head = [f"{what}, {moment:g} s" for moment in MOMENTS for what in ("IoU", "length error [m]", "place error [m]")]
    return markdown_table(("vehicle", "tracker", *head), rows)


PAGE = """# Contours and classes learned on the way

Written by `{command}` on {date}; do not edit it by hand but for the notes at its end.

`{tracker}` is `{plain}` with a class and a contour of its own for every track. The rule, in
`trackers/pmht/adaptive.py` and `trackers/pmht/learner.py`:

- Each track keeps its last looks. When they span half a second and hold 25 detections, or the window of 32 looks is
  full, its turn may come.
- In its turn an unscented RTS smoother over the window takes the motion out of the detections. They join a pool of at
  most 40 for each of 8 directions that the track was seen from.
- With the next look the pool is compared with the classes. Where one has a probability above {sure:g}, its contour is
  the one to start from, the track takes the place and the size of the fit, and the size is drawn to what is usual for
  the class.
- With 150 new detections since the last time, six looks follow with one iteration of regularised expectation
  maximisation each, and a seventh in which the filter takes the contour over, unless it crosses itself.
- Looks at a part of a vehicle (less than three quarters of it, cut off by a field of view or hidden by others)
  teach nothing: half a car looks like a motorcycle.
- One track at most has a turn in one look: first the one that has begun, then the one that has waited longest.

Rays from the sensor of each detection weigh the ellipses, the known noise of each detection is taken out, and vehicles
are taken for symmetric: what is seen of one side is known of the other. The frame moves only where its offset can be
told, see [partial-view.md](partial-view.md).

Every change is an event in the review log, `classified` or `adapted`, and is drawn for a second where the track was:
the contour before in grey, the one after in the colour of the tracker.

## Contours while one watches

The ego comes from {ahead:g} m behind, passes each vehicle in the next lane in {duration:g} s, and is {ahead:g} m ahead
at the end. The tracker finds the vehicle by itself. Grey: truth; blue: the contour of the track.

![Contours after 1, 5 and 30 s](pictures/contours.png)

Means over {seeds} seeds and the second before each moment. The IoU is of the shapes, each in its own frame, so an error
of the place does not count in it; lengths are magnitudes of errors of the box, places are distances of the centres.

{drives}

## Classes

`Estimate.class_probability` holds the probabilities of the classes `filter.classes`: {classes}. For
each the contour of a catalogue (`python -m testbed.learn.classes`, learned from our radar on lone vehicles of that
class) is placed so that the end which was seen lies where the track has it, and fitted to the detections: place, length
and width, each tied to what is usual. The probabilities are those of the fits, with the shares of the classes in
traffic before them. A detection counts for {counts:g} of one, because those of one body are not independent.

The radar `{radar}` in {scenarios} scenarios, first {length:g} s, {class_seeds} seed(s), {tracks} tracks on vehicles
that count. Right: the true class is the most probable one; the age is that of the track.

{delays}

At the end of each track:

{confusion}

{sure_share:.0%} of the looks have a class with a probability above {sure:g}; {sure_right:.0%} of these are right.

{mark}{notes}"""


def page(
    command: str, drives: Drives, stories: Sequence[Story], probe: ClassProbe, counts: Mapping[str, float], notes: str
) -> str:
    """The whole page with its notes; `counts` has numbers of seeds, scenarios and seconds."""
    from trackers import find

    share, right = calibration(stories, probe.classes)
    passing = Passing("car")
    return PAGE.format(
        command=command,
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        tracker=TRACKER,
        plain=PLAIN,
        sure=SURE,
        ahead=passing.ahead,
        duration=passing.duration,
        drives=drive_table(drives),
        classes=", ".join(probe.classes),
        counts=find(TRACKER).learner.catalogue.counts,  # type: ignore[attr-defined]
        radar=RADAR,
        tracks=len(stories),
        delays=delay_table(stories, probe.classes),
        confusion=confusion_table(stories, probe.classes),
        sure_share=share,
        sure_right=right,
        mark=NOTES,
        notes=notes,
        **counts,
    )


def main(
    docs: Annotated[Path, typer.Option(help="Directory for the page; its picture goes to pictures/ in it.")] = Path(
        "runs/contours"
    ),
    seeds: Annotated[int, typer.Option(min=1, help="Drives by each vehicle.")] = 4,
    scenario: Annotated[list[str] | None, typer.Option(help="For the classes; repeat; all without it.")] = None,
    class_seeds: Annotated[int, typer.Option(min=1, help="Drives of each of these.")] = 2,
    length: Annotated[float, typer.Option(min=1.0, help="Of each of these [s].")] = 12.0,
) -> None:
    """Drive by vehicles of some classes and through the scenarios, and write contours.md with its picture.

    Example: python -m testbed.studies.contours.page --seeds 1 --scenario slow-tractor --class-seeds 1
    """
    with user_input():
        make_directory(docs / "pictures")
    chosen = scenario or sorted(SCENARIOS)
    drives: dict[tuple[str, str], list[Seen]] = {}
    stories: list[Story] = []
    probe = ClassProbe(TRACKER)
    with progress_bar("{task.completed:.0f} of {task.total:.0f} drives") as bar:
        task = bar.add_task("", total=2 * len(KINDS) * seeds + len(chosen) * class_seeds)
        for kind in KINDS:
            for tracker in (PLAIN, TRACKER):
                for seed in range(seeds):
                    bar.update(task, description=f"{kind}, {tracker}")
                    drives.setdefault((kind, tracker), []).append(drive(Passing(kind, seed=seed), tracker))
                    bar.advance(task)
        for name in chosen:
            for seed in range(class_seeds):
                bar.update(task, description=f"{name}, seed {seed}")
                probe = ClassProbe(TRACKER)
                replay(record(name, seed, RADAR, length), [TRACKER], [probe])
                stories += probe.stories
                bar.advance(task)
    command = shlex.join(["python", "-m", "testbed.studies.contours.page", *sys.argv[1:]])
    path = docs / "contours.md"
    counts = {"seeds": seeds, "scenarios": len(chosen), "class_seeds": class_seeds, "length": length}
    write_atomic(path, page(command, drives, stories, probe, counts, notes_of(path)))
    draw({kind: drives[kind, TRACKER][0] for kind in KINDS}, MOMENTS, docs / "pictures" / "contours.png")
    Console().print(f"page     {path}", soft_wrap=True)


if __name__ == "__main__":
    typer.run(main)

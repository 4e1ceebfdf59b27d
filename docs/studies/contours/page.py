"""What `pmht-spline-adaptive` learns of contours and classes: the page docs/contours.md, its picture and its tables."""

from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
import typer

from scenarios import SCENARIOS
from studies.contours.classes import SURE, ClassHistory, ClassProbe, calibration, confusion_table, delay_table
from studies.contours.figure import draw
from studies.contours.passing import KINDS, PassedTrack, Passing, follow
from studies.page import DOCS, Docs, Page, fill
from studies.runs import calculate
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import user_input
from testbed.experiments.engine import Engine
from testbed.log.text import markdown_table
from testbed.replay.recording import record
from testbed.replay.rescan import replay

TRACKER, PLAIN = "pmht-spline-adaptive", "pmht-spline"
MOMENTS = (1.0, 5.0, 30.0)  # [s]; before the first, hardly anything is learned
RADAR = "surround"
Passed = Mapping[tuple[str, str], Sequence[PassedTrack]]  # by class and tracker, one a seed


def second_before(track: PassedTrack, moment: float) -> slice:
    """The frames of the second before a moment [s]."""
    last = min(int(np.searchsorted(track.time, moment - 1e-9)), len(track.time) - 1)
    return slice(max(last - 14, 0), last + 1)


def passing_table(passed: Passed) -> str:
    """One row a class and tracker, means over the seeds and the second before each moment."""
    rows = []
    for (kind, tracker), runs in passed.items():
        cells = [kind, tracker]
        for moment in MOMENTS:
            parts = [(track, second_before(track, moment)) for track in runs]
            for values in (
                [track.iou[k] for track, k in parts],
                [np.abs(track.length_error[k]) for track, k in parts],
                [track.position_error[k] for track, k in parts],
            ):
                flat = np.concatenate(values)
                cells.append(f"{np.nanmean(flat):.2f}" if np.isfinite(flat).any() else "–")
        rows.append(tuple(cells))
    head = [f"{what}, {moment:g} s" for moment in MOMENTS for what in ("IoU", "length error [m]", "place error [m]")]
    return markdown_table(("vehicle", "tracker", *head), rows)


def render(
    passed: Passed, histories: Sequence[ClassHistory], classes: Sequence[str], counts: Mapping[str, float]
) -> str:
    """What the page says; `counts` has numbers of seeds, scenarios and seconds."""
    share, right = calibration(histories, classes)
    passing = Passing("car")
    return fill(
        "contours/page.md.j2",
        tracker=TRACKER,
        plain=PLAIN,
        sure=SURE,
        ahead=passing.ahead,
        duration=passing.duration,
        passed=passing_table(passed),
        classes=", ".join(classes),
        radar=RADAR,
        tracks=len(histories),
        delays=delay_table(histories, classes),
        confusion=confusion_table(histories, classes),
        sure_share=share,
        sure_right=right,
        **counts,
    )


def class_histories(scenario: str, seed: int, length: float) -> list[ClassHistory]:
    """The class probabilities of the tracks of one drive."""
    probe = ClassProbe(TRACKER)
    replay(record(scenario, seed, RADAR, length), [TRACKER], [probe])
    return probe.histories


def main(
    docs: Docs = DOCS,
    seeds: Annotated[int, typer.Option(min=1, help="Runs past each vehicle.")] = 4,
    scenario: Annotated[list[str] | None, typer.Option(help="For the classes; repeat; all without it.")] = None,
    class_seeds: Annotated[int, typer.Option(min=1, help="Runs of each of these.")] = 2,
    length: Annotated[float, typer.Option(min=1.0, help="Of each of these [s].")] = 12.0,
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Pass vehicles of some classes, run the scenarios, and write contours.md with its picture.

    Example: PYTHONPATH=docs python -m studies contours --seeds 1 --scenario slow-tractor --class-seeds 1
    """
    with user_input():
        page = Page("contours", docs)
    chosen = scenario or sorted(SCENARIOS)
    engine = Engine(jobs, dask)
    passings = [
        (Passing(kind, seed=k), tracker) for kind in KINDS for tracker in (PLAIN, TRACKER) for k in range(seeds)
    ]
    passed: dict[tuple[str, str], list[PassedTrack]] = {}
    for (passing, tracker), track in zip(passings, calculate(follow, passings, engine, "vehicles"), strict=True):
        passed.setdefault((passing.kind, tracker), []).append(track)
    drives = [(name, seed, length) for name in chosen for seed in range(class_seeds)]
    histories = [h for found in calculate(class_histories, drives, engine, "scenarios") for h in found]
    counts = {"seeds": seeds, "scenarios": len(chosen), "class_seeds": class_seeds, "length": length}
    draw({kind: passed[kind, TRACKER][0] for kind in KINDS}, MOMENTS, page.picture("contours"))
    page.write(render(passed, histories, ClassProbe(TRACKER).classes, counts))

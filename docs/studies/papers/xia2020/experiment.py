"""Reproductions of xia2020 (slides: online truncation bounds) and xia2020-learned (paper: learned model).

The nuScenes data of the paper are not used: the experiments are on generators of detections, and on the papers' courses
before our ray-cast radar. Figures in brackets are those of an independent implementation.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

import sensors
from studies.papers.report import HERE, PaperReport, Progress, carry_out, silent
from studies.papers.xia2020 import claims
from studies.papers.xia2020.generators import COURSES, FOLLOWING, GENERATORS
from studies.papers.xia2020.methods import LEARNED_N, MAP, RIG, full_methods, partial_methods
from studies.papers.xia2020.radar import SCENARIOS, radar_methods, radar_trial
from studies.papers.xia2020.results import COLUMNS, LEGEND, TrialRuns
from studies.papers.xia2020.trials import NamedFilter, Trial, full_view, partial_view, track
from testbed.experiments.command import calculated
from testbed.experiments.engine import Engine

PAPER, LEARNED_PAPER = "xia2020", "xia2020-learned"
RATES = (2.0, 13.0)  # [Hz] of the partial view
RADAR_RUNS = 20  # at most: the traffic simulation of an episode takes seconds
ROUGH_START = np.array([1.0, 1.0, 0.1, 1.0, 0.1])  # error of the first state: x, y [m], heading, speed, yaw rate


@dataclass(frozen=True)
class PlannedTrial:
    """A trial that will be drawn, and the filters that will be run on it."""

    draw: Callable[[], Trial]
    methods: Sequence[NamedFilter]


def full_cases(runs: int, seed: int) -> Iterator[PlannedTrial]:
    """Full view: three generators, all methods, and the learned ones with tables of the other generators."""
    for generator, child in zip(GENERATORS, np.random.SeedSequence(seed).spawn(len(GENERATORS)), strict=True):
        draw = partial(full_view, generator, runs, np.random.default_rng(child))
        yield PlannedTrial(draw, (*full_methods(generator), *foreign(generator)))


def foreign(generator: str) -> Iterator[NamedFilter]:
    """Learned methods with the tables of the other generators."""
    for other in GENERATORS:
        if other != generator:
            for method in full_methods(generator, other):
                if method.name in (LEARNED_N, MAP):
                    yield replace(method, name=claims.foreign_name(method.name, other))


def partial_cases(runs: int, seed: int, rates: tuple[float, ...] = RATES) -> Iterator[PlannedTrial]:
    """Partial view: three courses at each rate [Hz], sparse detections, a rough start; each has its own random numbers.

    The streams do not depend on `rates`.
    """
    seeds = np.random.SeedSequence([seed, 1]).spawn(3 * len(RATES) + 1)
    streams = [np.random.default_rng(s) for s in seeds]
    todo = [(course, rate) for rate in RATES for course in COURSES]
    trials: list[Callable[[], Trial]] = [
        partial(partial_view, course, rate, runs, rng)
        for (course, rate), rng in zip(todo, streams, strict=False)
        if rate in rates
    ]
    few, same = streams[-1], np.random.default_rng(seeds[0])  # the rough start has the detections of the first trial
    trials.append(lambda: partial_view(FOLLOWING, 2.0, runs, few, rate=2.0)._replace(name=claims.SPARSE))
    trials.append(lambda: partial_view(FOLLOWING, 2.0, runs, same, start_std=ROUGH_START)._replace(name=claims.ROUGH))
    for draw in trials:
        yield PlannedTrial(draw, partial_methods())


def radar_cases(runs: int, seed: int) -> Iterator[PlannedTrial]:
    """The papers' courses before our ray-cast radar."""
    for name in SCENARIOS:
        yield PlannedTrial(partial(radar_trial, name, sensors.find(RIG), runs, seed), radar_methods())


def drawn(planned: PlannedTrial) -> Trial:
    """The trial."""
    return planned.draw()


def experiment(
    planned: Sequence[PlannedTrial], results: TrialRuns, progress: Progress = silent, engine: Engine = HERE
) -> None:
    """Run all trials into `results`, which then hold what is finished when a Stopped comes through."""
    trials: list[Trial] = []
    with closing(calculated(drawn, [(each,) for each in planned], engine)) as found:
        for _ in planned:
            progress(len(trials), len(planned), "detections")
            trials.append(next(found))
    work = [(method, trial) for trial, each in zip(trials, planned, strict=True) for method in each.methods]
    with closing(calculated(track, work, engine)) as estimates:
        for done, (method, trial) in enumerate(work):
            progress(done, len(work), f"{trial.name}: {method.name}")
            results.add(trial, method, next(estimates))


def run(
    runs: int = 100,
    out: Path | None = None,
    progress: Progress = silent,
    seed: int = 0,
    learned: bool = False,
    engine: Engine = HERE,
) -> PaperReport:
    """The whole reproduction of the slides, or of the paper with `learned`; see `carry_out`."""
    planned = [*full_cases(runs, seed), *partial_cases(runs, seed, RATES if learned else RATES[:1])]
    if learned:
        planned += radar_cases(min(runs, RADAR_RUNS), seed)
    paper, results = LEARNED_PAPER if learned else PAPER, TrialRuns()

    def draw(folder: Path) -> tuple[Path, ...]:
        from studies.papers.xia2020 import figures  # with matplotlib, which takes long to import

        return figures.draw(results, folder, paper)

    blank = PaperReport(
        paper=paper,
        title="Extended object tracking with automotive radar, "
        + ("learned structural measurement model" if learned else "hierarchical truncation with online bounds"),
        settings={"runs": runs, "radar runs": min(runs, RADAR_RUNS) if learned else 0, "seed": seed, "rig": RIG},
        columns=COLUMNS,
        legend=LEGEND,
    )
    return carry_out(
        blank,
        lambda: experiment(planned, results, progress, engine),
        rows=lambda: results.rows,
        answers=lambda: claims.paper(results) if learned else claims.slides(results),
        draw=draw,
        out=out,
        progress=progress,
    )

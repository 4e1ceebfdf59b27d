"""Reproductions of xia2020 (slides: online truncation bounds) and xia2020-learned (paper: learned model).

The nuScenes data of the paper are not used: the experiments are on generators of detections, and on the papers' courses
before our ray-cast radar. Figures in brackets are those of an independent implementation.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import sensors
from studies.papers.report import PaperReport, Progress, carry_out, silent
from studies.papers.xia2020 import claims
from studies.papers.xia2020.generators import COURSES, FOLLOWING, GENERATORS
from studies.papers.xia2020.methods import LEARNED_N, MAP, RIG, full_methods, partial_methods
from studies.papers.xia2020.radar import SCENARIOS, radar_methods, radar_trial
from studies.papers.xia2020.reference import full_reference, partial_reference
from studies.papers.xia2020.results import COLUMNS, LEGEND, TrialRuns
from studies.papers.xia2020.trials import DURATION, FULL_STEPS, NamedFilter, Trial, full_view, partial_view

PAPER, LEARNED_PAPER = "xia2020", "xia2020-learned"
RATES = (2.0, 13.0)  # [Hz] of the partial view
RADAR_RUNS = 20  # at most: the traffic simulation of an episode takes seconds
ROUGH_START = np.array([1.0, 1.0, 0.1, 1.0, 0.1])  # error of the first state: x, y [m], heading, speed, yaw rate
Tick = Callable[[int], None]


@dataclass(frozen=True)
class PlannedTrial:
    """A trial that will be drawn, and the filters that will be run on it."""

    steps: int  # of the trial: what it costs
    draw: Callable[[Tick], Trial]
    methods: Sequence[NamedFilter]
    reference: Callable[[str, str], Mapping[str, float]] = lambda case, method: {}


def full_cases(runs: int, seed: int) -> Iterator[PlannedTrial]:
    """Full view: three generators, all methods, and the learned ones with tables of the other generators."""
    for generator, child in zip(GENERATORS, np.random.SeedSequence(seed).spawn(len(GENERATORS)), strict=True):
        methods = (*full_methods(generator), *foreign(generator))
        rng = np.random.default_rng(child)
        yield PlannedTrial(
            FULL_STEPS,
            lambda tick, g=generator, rng=rng: full_view(g, runs, rng),  # type: ignore[misc]
            methods,
            lambda case, name, g=generator: full_reference(g, name),  # type: ignore[misc]
        )


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
    trials = [
        (rate, lambda tick, c=course, hz=rate, rng=rng: partial_view(c, hz, runs, rng))
        for (course, rate), rng in zip(todo, streams, strict=False)
        if rate in rates
    ]
    few, same = streams[-1], np.random.default_rng(seeds[0])  # the rough start has the detections of the first trial
    sparse = lambda tick: partial_view(FOLLOWING, 2.0, runs, few, rate=2.0)._replace(name=claims.SPARSE)  # noqa: E731
    rough = lambda tick: partial_view(FOLLOWING, 2.0, runs, same, start_std=ROUGH_START)._replace(name=claims.ROUGH)  # noqa: E731
    for rate, draw in (*trials, (2.0, sparse), (2.0, rough)):
        yield PlannedTrial(round(DURATION * rate), draw, partial_methods(), partial_reference)


def radar_cases(runs: int, seed: int) -> Iterator[PlannedTrial]:
    """The papers' courses before our ray-cast radar."""
    radar = sensors.find(RIG)
    for name in SCENARIOS:
        yield PlannedTrial(100, lambda tick, name=name: radar_trial(name, radar, runs, seed, tick), radar_methods())  # type: ignore[misc]


def experiment(planned: Sequence[PlannedTrial], results: TrialRuns, progress: Progress = silent) -> None:
    """Run all trials into `results`, which then hold what is finished when a Stopped comes through."""
    total, done = sum(trial.steps for trial in planned), 0.0
    for case in planned:
        trial = case.draw(lambda ride: progress(done, total, f"driving, ride {ride + 1}"))  # noqa: B023
        for method in case.methods:
            share = case.steps / len(case.methods)

            def tick(step: int) -> None:
                progress(done + share * step / len(trial.pose), total, f"{trial.name}: {method.name}")  # noqa: B023

            results.add(trial, method, case.reference(trial.name, method.name), tick)
            done += share


def run(
    runs: int = 100,
    out: Path | None = None,
    progress: Progress = silent,
    seed: int = 0,
    learned: bool = False,
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
        lambda: experiment(planned, results, progress),
        rows=lambda: results.rows,
        verdicts=lambda: claims.paper(results) if learned else claims.slides(results),
        draw=draw,
        out=out,
        progress=progress,
    )

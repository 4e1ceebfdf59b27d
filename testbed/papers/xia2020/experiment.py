"""Reproductions of xia2020 (slides: online truncation bounds) and xia2020-learned (paper: learned model).

The nuScenes data of the paper are not used: the experiments are those of card htg_rm, section 8, on generators of
detections, and the papers' courses before our ray-cast radar. Figures in brackets are the card's.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import sensors
from testbed.papers.verdict import Progress, Report, Stopped, Verdict
from testbed.papers.xia2020 import claims
from testbed.papers.xia2020.generators import COURSES, FOLLOWING, GENERATORS
from testbed.papers.xia2020.methods import LEARNED_N, MAP, RIG, full_methods, partial_methods
from testbed.papers.xia2020.radar import SCENARIOS, radar_methods, radar_trial
from testbed.papers.xia2020.reference import full_reference, partial_reference
from testbed.papers.xia2020.results import COLUMNS, LEGEND, Results
from testbed.papers.xia2020.trials import DURATION, FULL_STEPS, Method, Trial, full_view, partial_view

PAPER, LEARNED_PAPER = "xia2020", "xia2020-learned"
RATES = (2.0, 13.0)  # [Hz] of the partial view
RADAR_RUNS = 20  # at most: the traffic simulation of an episode takes seconds
ROUGH_START = np.array([1.0, 1.0, 0.1, 1.0, 0.1])  # error of the first state: x, y [m], heading, speed, yaw rate
Tick = Callable[[int], None]


@dataclass(frozen=True)
class Case:
    """A trial to come and what is run on it."""

    steps: int  # of the trial: what it costs
    draw: Callable[[Tick], Trial]
    methods: Sequence[Method]
    reference: Callable[[str, str], Mapping[str, float]] = lambda case, method: {}


def full_cases(runs: int, seed: int) -> Iterator[Case]:
    """Section 8.1: three generators, all methods, and the learned ones with tables of the other generators."""
    for generator, child in zip(GENERATORS, np.random.SeedSequence(seed).spawn(len(GENERATORS)), strict=True):
        methods = (*full_methods(generator), *foreign(generator))
        rng = np.random.default_rng(child)
        yield Case(
            FULL_STEPS,
            lambda tick, g=generator, rng=rng: full_view(g, runs, rng),  # type: ignore[misc]
            methods,
            lambda case, name, g=generator: full_reference(g, name),  # type: ignore[misc]
        )


def foreign(generator: str) -> Iterator[Method]:
    """Learned methods with the tables of the other generators."""
    for other in GENERATORS:
        if other != generator:
            for method in full_methods(generator, other):
                if method.name in (LEARNED_N, MAP):
                    yield replace(method, name=claims.foreign_name(method.name, other))


def partial_cases(runs: int, seed: int, rates: tuple[float, ...] = RATES) -> Iterator[Case]:
    """Section 8.2: three courses at each rate [Hz], sparse detections, a rough start; each has its own random numbers.

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
        yield Case(round(DURATION * rate), draw, partial_methods(), partial_reference)


def radar_cases(runs: int, seed: int) -> Iterator[Case]:
    """The papers' courses before our ray-cast radar."""
    radar = sensors.find(RIG)
    for name in SCENARIOS:
        yield Case(100, lambda tick, name=name: radar_trial(name, radar, runs, seed, tick), radar_methods())  # type: ignore[misc]


def experiment(cases: Sequence[Case], progress: Progress | None = None, results: Results | None = None) -> Results:
    """Run all cases; into `results`, which then holds what is finished when a Stopped comes through."""
    results = Results() if results is None else results
    total, done = sum(case.steps for case in cases), 0.0
    for case in cases:
        trial = case.draw(lambda ride: tell(progress, done, total, f"driving, ride {ride + 1}"))  # noqa: B023
        for method in case.methods:
            share = case.steps / len(case.methods)

            def tick(step: int) -> None:
                tell(progress, done + share * step / len(trial.pose), total, f"{trial.name}: {method.name}")  # noqa: B023

            results.add(trial, method, case.reference(trial.name, method.name), tick)
            done += share
    return results


def run(
    runs: int = 100,
    out: Path | None = None,
    progress: Progress | None = None,
    seed: int = 0,
    learned: bool = False,
) -> Report:
    """The whole reproduction of the slides, or of the paper with `learned`; with `out`, its figures and JSON too.

    A Stopped from `progress` ends it early: the report then holds the rows that are finished.
    """
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")
    cases = [*full_cases(runs, seed), *partial_cases(runs, seed, RATES if learned else RATES[:1])]
    if learned:
        cases += radar_cases(min(runs, RADAR_RUNS), seed)
    paper = LEARNED_PAPER if learned else PAPER
    results, finished = Results(), False
    verdicts: tuple[Verdict, ...] = ()
    figures: tuple[Path, ...] = ()
    with suppress(Stopped):
        experiment(cases, progress, results)
        tell(progress, 1, 1, "claims")
        verdicts = claims.paper(results) if learned else claims.slides(results)
        if out is not None:
            from testbed.papers.xia2020.figures import draw

            tell(progress, 1, 1, "figures")
            figures = draw(results, out, paper)
        finished = True
    report = Report(
        paper=paper,
        title="Extended object tracking with automotive radar, "
        + ("learned structural measurement model" if learned else "hierarchical truncation with online bounds"),
        settings={"runs": runs, "radar runs": min(runs, RADAR_RUNS) if learned else 0, "seed": seed, "rig": RIG},
        columns=COLUMNS,
        legend=LEGEND,
        rows=tuple(results.rows),
        verdicts=verdicts,
        figures=figures,
        interrupted=not finished,
    )
    if out is not None:
        report.write(out)
    return report


def tell(progress: Progress | None, done: float, total: float, what: str) -> None:
    """Call progress where there is one."""
    if progress is not None:
        progress(done, total, what)

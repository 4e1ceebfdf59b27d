"""Reproductions of xia2020 (slides: online truncation bounds) and xia2020-learned (paper: learned model).

The nuScenes data of the paper are not used: the experiments are those of card htg_rm, section 8, on generators of
detections, and the papers' courses before our ray-cast radar. Figures in brackets are the card's.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import sensors
from testbed.papers import xia2020_claims as claims
from testbed.papers.verdict import Progress, Report
from testbed.papers.xia2020_card import full_reference, partial_reference
from testbed.papers.xia2020_generators import COURSES, FOLLOWING, GENERATORS
from testbed.papers.xia2020_methods import LEARNED_N, MAP, full_methods, partial_methods
from testbed.papers.xia2020_radar import ON_OTHER, ON_RIG, RIG, SCENARIOS, radar_methods, radar_trial
from testbed.papers.xia2020_results import COLUMNS, Results
from testbed.papers.xia2020_trials import Method, Trial, full_view, partial_view

PAPER, LEARNED_PAPER = "xia2020", "xia2020-learned"
RATES = (2.0, 13.0)  # [Hz] of the partial view
RADAR_RUNS = 20  # at most: the traffic simulation of an episode takes seconds
ROUGH_START = np.array([1.0, 1.0, 0.1, 1.0, 0.1])  # error of the first state: x, y [m], heading, speed, yaw rate


def run_full_view(runs: int = 100, out: Path | None = None, progress: Progress | None = None, seed: int = 0) -> Results:
    """Section 8.1: three generators, all methods, and tables of the other generators; with `out`, also its figures."""
    _check(runs)
    results = Results()
    for generator, child in zip(GENERATORS, np.random.SeedSequence(seed).spawn(len(GENERATORS)), strict=True):
        _tell(progress, f"full view, {generator}: learning")
        methods = full_methods(generator)
        trial = full_view(generator, runs, np.random.default_rng(child))
        results.run(trial, methods, lambda case, name, g=generator: full_reference(g, name), progress)  # type: ignore[misc]
        results.run(trial, tuple(foreign(generator)), progress=progress)
    if out is not None:
        from testbed.papers.figures_xia2020 import draw_full_view

        results.figures += draw_full_view(results, out)
    return results


def foreign(generator: str) -> Iterator[Method]:
    """Learned methods with the tables of the other generators."""
    for other in GENERATORS:
        if other != generator:
            for method in full_methods(other):
                if method.name in (LEARNED_N, MAP):
                    yield replace(method, name=claims.foreign_name(method.name, other))


def run_partial_view(
    runs: int = 100,
    out: Path | None = None,
    progress: Progress | None = None,
    seed: int = 0,
    rates: tuple[float, ...] = RATES,
) -> Results:
    """Section 8.2: three courses at each rate [Hz], sparse detections, a rough start; with `out`, also its figures."""
    _check(runs)
    _tell(progress, "partial view: learning")
    methods, results = partial_methods(), Results()
    for trial in partial_trials(runs, seed, rates):
        results.run(trial, methods, partial_reference, progress)
    if out is not None:
        from testbed.papers.figures_xia2020 import draw_partial_view

        results.figures += draw_partial_view(results, out)
    return results


def partial_trials(runs: int, seed: int, rates: tuple[float, ...] = RATES) -> Iterator[Trial]:
    """The trials of section 8.2 and two more on the following course, each with its own random numbers."""
    streams = iter(np.random.SeedSequence([seed, 1]).spawn(3 * len(RATES) + 2))
    for rate in RATES:
        for course in COURSES:
            rng = np.random.default_rng(next(streams))
            if rate in rates:
                yield partial_view(course, rate, runs, rng)
    sparse = partial_view(FOLLOWING, 2.0, runs, np.random.default_rng(next(streams)), rate=2.0)
    yield sparse._replace(name=claims.SPARSE)
    rough = partial_view(FOLLOWING, 2.0, runs, np.random.default_rng(next(streams)), start_std=ROUGH_START)
    yield rough._replace(name=claims.ROUGH)


def run_radar(
    runs: int = RADAR_RUNS, out: Path | None = None, progress: Progress | None = None, seed: int = 0
) -> Results:
    """The papers' courses before our ray-cast radar; with `out`, also its figures."""
    _check(runs)
    radar, results = sensors.find(RIG), Results()
    _tell(progress, "our radar: learning")
    methods = radar_methods()
    for scenario in SCENARIOS:
        _tell(progress, f"{scenario}: driving")
        results.run(radar_trial(scenario, radar, runs, seed), methods, progress=progress)
    if out is not None:
        from testbed.papers.figures_xia2020 import draw_radar

        results.figures += draw_radar(results, out)
    return results


def run(
    runs: int = 100,
    out: Path | None = None,
    progress: Progress | None = None,
    seed: int = 0,
    learned: bool = False,
) -> Report:
    """The whole reproduction of the slides, or of the paper with `learned`; with `out`, its figures and JSON too."""
    _check(runs)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    full = run_full_view(runs, None if learned else out, progress, seed)
    partial = run_partial_view(runs, out, progress, seed, RATES if learned else RATES[:1])
    parts = [full, partial]
    if learned:
        parts.append(run_radar(min(runs, RADAR_RUNS), out, progress, seed))
    results = join(parts)
    cases = tuple(case for case in results.trials if case.startswith(SCENARIOS))
    _tell(progress, "claims")
    verdicts = claims.paper(results, cases, ON_RIG, ON_OTHER) if learned else claims.slides(results)
    report = Report(
        paper=LEARNED_PAPER if learned else PAPER,
        title="Extended object tracking with automotive radar, "
        + ("learned structural measurement model" if learned else "hierarchical truncation with online bounds"),
        settings={"runs": runs, "radar runs": min(runs, RADAR_RUNS) if learned else 0, "seed": seed, "rig": RIG},
        columns=COLUMNS,
        rows=tuple(results.rows),
        verdicts=verdicts,
        figures=tuple(results.figures),
    )
    if out is not None:
        report.write(out)
    return report


def join(parts: list[Results]) -> Results:
    """All parts as one; their cases differ."""
    whole = Results()
    for part in parts:
        whole.trials |= part.trials
        whole.traces |= part.traces
        whole.errors |= part.errors
        whole.used |= part.used
        whole.rows += part.rows
        whole.figures += part.figures
    return whole


def _check(runs: int) -> None:
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")


def _tell(progress: Progress | None, what: str) -> None:
    if progress is not None:
        progress(0, 1, what)

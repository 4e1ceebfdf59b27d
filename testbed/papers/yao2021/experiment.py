"""Reproduction of yao2021: UKF-PMHT on chained ellipses, the RTS smoother, and the contour adapted on the way.

The paper prints neither turn rates nor contours nor numbers; card bspline_pmht, section 11, says what is used instead.
Method A is the paper's with the card's corrections, "A, 4 Sigma" the same with the covariance that the paper prints in
the association, and B the card's: joint update, the frame moved to the middle of the contour, two passes.
"""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.intervals import student_interval
from testbed.papers.verdict import Progress, Report, Row, Stopped
from testbed.papers.yao2021.claims import verdicts
from testbed.papers.yao2021.reference import COLUMNS, REFERENCE
from testbed.papers.yao2021.trials import (
    ADAPT_AT,
    CONTOURS,
    DETECTIONS,
    A,
    B,
    Errors,
    Outcome,
    drive,
    overlap,
    play,
)  # fmt: skip
from trackers.pmht.model import find

PAPER = "yao2021"
MODEL = "yao2021"  # the over-smoothed model learned offline
METHODS = (A, replace(A, name="A, 4 Sigma", widened=4.0), B)
MEASURES = dict(zip(COLUMNS, (3, 4, 4, 4, 4, 1), strict=True)) | {"offset m": 3, "IoU": 3, "lost": 0}
LEGEND = (
    "root mean square errors over runs and steps; NEES of x, y, speed, heading, 4 is ideal; offset: mean error along "
    "the heading; IoU of the curve with the contour shrunk by 0.1 m; lost: runs off by more than 2 m, left out"
)
Outcomes = dict[tuple[str, str], Outcome]  # contour, method


def squares(e: Errors, kept: NDArray) -> dict[str, NDArray]:
    """Mean squared errors (R,) of the runs that were kept, by the name of the column; NEES as it is."""
    values = ((e.position**2).sum(-1), e.speed**2, e.heading**2, e.length**2, e.width**2, e.nees)
    return {name: v[:, kept].mean(0) for name, v in zip(COLUMNS, values, strict=True)}


def measure(outcome: Outcome, stage: str, outline: NDArray) -> dict[str, float]:
    """Figures of one stage, and half the widths of their 95 % intervals over the runs, by Student's t."""
    e, kept = outcome.stages[stage], outcome.kept
    out: dict[str, float] = {}
    for name, v in squares(e, kept).items():
        value, error = map(float, student_interval(v))
        root = name != "NEES"
        out[name] = float(np.sqrt(value)) if root else value
        out[f"{name} 95 %"] = error / (2 * max(out[name], 1e-12)) if root else error
    out["offset m"] = float(e.position[:, kept, 0].mean())
    out["lost"] = float(outcome.lost[stage].sum()) if stage in outcome.lost else float("nan")
    if stage == "adapted":
        out["IoU"] = float(overlap(outcome.adapted.contour, outline)[kept].mean())
    return out


def experiment(runs: int, seed: int, progress: Progress | None, outcomes: Outcomes) -> None:
    """Run all contours and methods into `outcomes`, which holds what is finished when a Stopped comes through."""
    model = find(MODEL)
    work = [(name, method) for name in CONTOURS for method in METHODS]
    for done, (name, method) in enumerate(work):

        def tell(part: float, done: int = done, what: str = f"{name}: {method.name}") -> None:
            if progress is not None:
                progress(done + part, len(work), what)

        tell(0.0)
        seen = drive(CONTOURS[name], runs, np.random.default_rng(np.random.SeedSequence([seed, len(name)])))
        outcomes[name, method.name] = play(method, model, seen, tell)
    if progress is not None:
        progress(len(work), len(work), "done")


def rows(outcomes: Outcomes) -> tuple[Row, ...]:
    """All figures."""
    return tuple(
        Row(
            name,
            f"{method} {stage}",
            measure(outcome, stage, CONTOURS[name]),
            REFERENCE.get((name, f"{method} {stage}"), {}),
        )
        for (name, method), outcome in outcomes.items()
        for stage in outcome.stages
    )


def run(runs: int = 100, out: Path | None = None, progress: Progress | None = None, seed: int = 0) -> Report:
    """The whole experiment; with `out`, also its figures and JSON in that folder.

    A Stopped from `progress` ends it early: the report then holds the rows that are finished.
    """
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")
    outcomes: Outcomes = {}
    finished = False
    with suppress(Stopped):
        experiment(runs, seed, progress, outcomes)
        finished = True
    report = Report(
        paper=PAPER,
        title="Extended object tracking with spatial model adaptation using automotive radar (Yao et al., 2021)",
        settings={"runs": runs, "seed": seed, "detections a scan": DETECTIONS, "adapted after scan": ADAPT_AT},
        columns=MEASURES,
        legend=LEGEND,
        rows=rows(outcomes),
        verdicts=verdicts({key: (squares_of(o)) for key, o in outcomes.items()}) if finished else (),
        interrupted=not finished,
    )
    if out is None:
        return report
    if finished:
        from testbed.papers.yao2021.figures import draw

        out.mkdir(parents=True, exist_ok=True)
        report = replace(report, figures=draw(outcomes, out))
    report.write(out)
    return report


def squares_of(outcome: Outcome) -> dict[str, dict[str, NDArray]]:
    """Mean squared errors of the runs that were kept, by stage and column."""
    return {stage: squares(e, outcome.kept) for stage, e in outcome.stages.items()}

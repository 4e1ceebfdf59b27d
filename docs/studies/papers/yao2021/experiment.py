"""Reproduction of yao2021: UKF-PMHT on chained ellipses, the RTS smoother, and the contour adapted on the way.

The paper prints neither turn rates nor contours nor numbers; docs/reproductions.md says what is used instead. Method A
is the paper's with the corrections of docs/methods/spline-pmht.md, "A, 4 Sigma" the same with the covariance that the
paper prints in the association, and B ours: joint update, the frame moved to the middle of the contour, two passes.
"""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.papers.reference import figures
from studies.papers.report import HERE, MethodRow, PaperReport, Progress, carry_out, silent
from studies.papers.yao2021.claims import answers
from studies.papers.yao2021.simulation import (
    ADAPT_AT,
    CONTOURS,
    DETECTIONS,
    A,
    AdaptationMethod,
    AdaptationRuns,
    B,
    StageErrors,
    overlap,
    run_stages,
    simulate,
)
from testbed.evaluation.intervals import student_interval
from testbed.experiments.command import calculated
from testbed.experiments.engine import Engine
from trackers.pmht.model import find

PAPER = "yao2021"
REFERENCE = figures(PAPER)
MODEL = "yao2021"  # the over-smoothed model learned offline
COLUMNS = ("position m", "speed m/s", "heading rad", "length m", "width m", "NEES")
METHODS = (A, replace(A, name="A, 4 Sigma", widened=4.0), B)
MEASURES = dict(zip(COLUMNS, (3, 4, 4, 4, 4, 1), strict=True)) | {"offset m": 3, "IoU": 3, "lost": 0}
LEGEND = (
    "root mean square errors over runs and steps; NEES of x, y, speed, heading, 4 is ideal; offset: mean error along "
    "the heading; IoU of the curve with the contour shrunk by 0.1 m; lost: runs off by more than 2 m, left out"
)
AllRuns = dict[tuple[str, str], AdaptationRuns]  # contour, method


def squares(e: StageErrors, kept: NDArray) -> dict[str, NDArray]:
    """Mean squared errors (R,) of the runs that were kept, by the name of the column; NEES as it is."""
    values = ((e.position**2).sum(-1), e.speed**2, e.heading**2, e.length**2, e.width**2, e.nees)
    return {name: v[:, kept].mean(0) for name, v in zip(COLUMNS, values, strict=True)}


def measure(runs: AdaptationRuns, stage: str, outline: NDArray) -> dict[str, float]:
    """Figures of one stage, and half the widths of their 95 % intervals over the runs, by Student's t."""
    e, kept = runs.stages[stage], runs.kept
    out: dict[str, float] = {}
    for name, v in squares(e, kept).items():
        value, error = map(float, student_interval(v))
        root = name != "NEES"
        out[name] = float(np.sqrt(value)) if root else value
        out[f"{name} 95 %"] = error / (2 * max(out[name], 1e-12)) if root else error
    out["offset m"] = float(e.position[:, kept, 0].mean())
    out["lost"] = float(runs.lost[stage].sum()) if stage in runs.lost else float("nan")
    if stage == "adapted":
        out["IoU"] = float(overlap(runs.adapted.contour, outline)[kept].mean())
    return out


def adapted(name: str, method: AdaptationMethod, runs: int, seed: int) -> AdaptationRuns:
    """All runs of a method on a contour; every method has the same detections."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, len(name)]))
    return run_stages(method, find(MODEL), simulate(CONTOURS[name], runs, rng))


def experiment(runs: int, seed: int, found: AllRuns, progress: Progress = silent, engine: Engine = HERE) -> None:
    """Run all contours and methods into `found`, which holds what is finished when a Stopped comes through."""
    work = [(name, method) for name in CONTOURS for method in METHODS]
    with closing(calculated(adapted, [(*each, runs, seed) for each in work], engine)) as results:
        for done, (name, method) in enumerate(work):
            progress(done, len(work), f"{name}: {method.name}")
            found[name, method.name] = next(results)


def rows(found: AllRuns) -> list[MethodRow]:
    """All figures."""
    return [
        MethodRow(
            name,
            f"{method} {stage}",
            measure(runs, stage, CONTOURS[name]),
            REFERENCE.get((name, f"{method} {stage}"), {}),
        )
        for (name, method), runs in found.items()
        for stage in runs.stages
    ]


def all_squares(found: AllRuns) -> dict[tuple[str, str], dict[str, dict[str, NDArray]]]:
    """Mean squared errors (R,) of the runs that were kept, by contour and method, then stage, then column."""
    return {key: {stage: squares(e, runs.kept) for stage, e in runs.stages.items()} for key, runs in found.items()}


def run(
    runs: int = 100, out: Path | None = None, progress: Progress = silent, seed: int = 0, engine: Engine = HERE
) -> PaperReport:
    """The whole experiment; see `carry_out`."""
    found: AllRuns = {}

    def draw(folder: Path) -> tuple[Path, ...]:
        from studies.papers.yao2021 import figures  # with matplotlib, which takes long to import

        return figures.draw(found, folder)

    blank = PaperReport(
        paper=PAPER,
        title="Extended object tracking with spatial model adaptation using automotive radar (Yao et al., 2021)",
        settings={"runs": runs, "seed": seed, "detections a scan": DETECTIONS, "adapted after scan": ADAPT_AT},
        columns=MEASURES,
        legend=LEGEND,
    )
    return carry_out(
        blank,
        lambda: experiment(runs, seed, found, progress, engine),
        rows=lambda: rows(found),
        answers=lambda: answers(all_squares(found)),
        draw=draw,
        out=out,
        progress=progress,
    )

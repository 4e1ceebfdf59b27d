"""Reproduction of hoher2022: Koch's random matrix with the virtual measurement model, on a U-turn before a lidar.

The text we have is a project report on Hoher et al. (2022), so the claims are the report's. "Printed" means its
equations as printed, "corrected" those of docs/methods/random-matrices.md and docs/methods/virtual-measurements.md. The
report prints pictures only: the courses, the shapes and the settings are ours.
"""

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from sensors import RADARS, Radar
from studies.papers.hoher2022.claims import answers
from studies.papers.hoher2022.direct_fit import DirectFit
from studies.papers.hoher2022.printed import PrintedKoch
from studies.papers.hoher2022.rules import Bayes, Lms
from studies.papers.hoher2022.runs import (
    LEGEND,
    MEASURES,
    SETTLED,
    ContourErrors,
    ContourMethod,
    ContourTrack,
    errors,
    measure,
    track,
)
from studies.papers.hoher2022.uturn import FIRST, SECOND, Truth, UTurn, lidar_scans, radar_scans, truth
from studies.papers.hoher2022.variants import ReportVariant, ShapeLms
from studies.papers.reference import figures
from studies.papers.report import HERE, MethodRow, PaperReport, Progress, carry_out, silent
from testbed.experiments.command import calculated
from testbed.experiments.engine import Engine
from trackers import Scan
from trackers.random_matrix.koch import Koch
from trackers.random_matrix.virtual_measurements import VirtualMeasurements

PAPER = "hoher2022"
REFERENCE = figures(PAPER)
FINE = float(np.radians(0.1))  # [rad] grid of virtual rays in the report
SIGMAS = (0.0, 0.1, 0.5)  # [m]
DRIFT = float(np.radians(20.0))  # [rad] heading minus course of the drifting target
RADAR_RUNS = 20  # at most: our radar draws each scan by itself
RADAR_BLUR = 0.3  # [m] sensor noise that the random matrix of the radar case starts from


def methods(sigma: float) -> dict[str, ContourMethod]:
    """Every algorithm at a sensor noise sigma [m], by its name in the tables."""
    printed = PrintedKoch(sigma=0.5 if sigma == 0 else sigma)
    report = ReportVariant(printed, Lms(), sigma=sigma, moments="eigenvalues", pitch=FINE)
    B = replace(report, koch=Koch())
    C = replace(B, moments="body")
    G = ReportVariant(sigma=sigma)
    table = [
        ContourMethod("RM printed, 1 sigma", printed),
        ContourMethod("RM corrected, 1 sigma", Koch()),
        ContourMethod("RM printed, 2 sigma", printed, sigmas=2.0),
        ContourMethod("RM corrected, 2 sigma", Koch(), sigmas=2.0),
    ]
    for letter, f in (("P", report), ("B", B), ("C", C)):
        table += [ContourMethod(f"{letter} I={n}", replace(f, rule=Lms(iterations=n))) for n in (1, 2, 5, 10)]
    table += [
        ContourMethod("C33 I=2", replace(C, pitch=0.0)),
        ContourMethod("G I=1", G),
        ContourMethod("G offset", replace(G, feedback_from=10)),
        ContourMethod("C offset", replace(C, feedback_from=10)),
        ContourMethod("C naive", C, naive=True),
        ContourMethod("direct I=2", replace(G, direct=DirectFit())),
        ContourMethod("B without sigma^2", replace(B, blur=False)),
    ]
    for name, tilt, gain, n in (
        ("square root I=2", "square-root", 1.0, 2),
        ("square root I=10", "square-root", 1.0, 10),
        ("abc I=10", "abc", 1.0, 10),
        ("abc gain 10 I=10", "abc", 10.0, 10),
    ):
        table.append(ContourMethod(name, replace(C, tilt=tilt, rule=ShapeLms(iterations=n, shape_gain=gain))))
    ours = VirtualMeasurements(rule=Bayes(), body="box", surface=0.9, unbiased=True, sigma=sigma)
    table.append(ContourMethod("box, Bayes (ours)", ours))
    return {m.name: m for m in table}


ALL = tuple(methods(0.1))[:23]  # of the rectangle on the first path
SOME = (
    "RM corrected, 1 sigma",
    "RM corrected, 2 sigma",
    "P I=2",
    "B I=2",
    "C I=2",
    "C I=10",
    "C33 I=2",
    "G I=1",
    "direct I=2",
)
MORE = (*SOME, "G offset", "C naive", "B without sigma^2")
TILTS = ("C I=10", "square root I=2", "square root I=10", "abc I=10", "abc gain 10 I=10")
RADAR = ("RM corrected, 2 sigma", "C33 I=2", "G I=1", "G offset", "direct I=2", "box, Bayes (ours)")


@dataclass(frozen=True)
class Case:
    """One object on one course under one noise."""

    name: str
    course: UTurn
    shape: str
    sigma: float  # [m]
    methods: tuple[str, ...]
    drift: float = 0.0  # [rad]
    radar: Radar | None = None  # instead of the lidar

    def runs(self, runs: int) -> int:
        """How many of `runs` are done: one without noise, where all are equal; fewer with the radar, which is slow."""
        if self.radar is not None:
            return min(runs, RADAR_RUNS)
        return runs if self.sigma else 1

    def scans(self, truth: Truth, runs: int, rng: np.random.Generator) -> list[Scan]:
        """Detections of every step, with the leading axis of the runs."""
        if self.radar is not None:
            return radar_scans(truth, self.radar, self.runs(runs), rng)
        return lidar_scans(truth, self.sigma, self.runs(runs), rng)


def half_plane(radar: Radar) -> Radar:
    """The first sensor of a rig at the origin, which covers the half plane of positive y, where the first path lies."""
    return Radar(radar.name, radar.note, (replace(radar.sensors[0], mount=(0.0, 0.0, np.pi / 2), fov_deg=180.0),))


def cases() -> Iterator[Case]:
    """All cases: four shapes on the first path, two on the second, a drifting target, our radars."""
    for shape in ("rectangle", "ellipse", "tractor", "L"):
        for sigma in SIGMAS:
            yield Case(f"{shape}, sigma {sigma}", FIRST, shape, sigma, ALL if shape == "rectangle" else SOME)
    for shape in ("rectangle", "ellipse"):
        for sigma in SIGMAS:
            yield Case(f"second path, {shape}, sigma {sigma}", SECOND, shape, sigma, MORE)
    for shape in ("ellipse", "rectangle"):
        for sigma in SIGMAS:
            yield Case(f"drift, {shape}, sigma {sigma}", FIRST, shape, sigma, TILTS, DRIFT)
    for name in ("lidar-1deg", "imaging"):
        yield Case(
            f"our radar {name}, rectangle", FIRST, "rectangle", RADAR_BLUR, RADAR, radar=half_plane(RADARS[name])
        )


CASES = tuple(cases())


class UTurnRuns:
    """Tracks and errors of every method in every case, as far as they were run."""

    def __init__(self) -> None:
        self.rows: list[MethodRow] = []
        self.errors: dict[tuple[str, str], ContourErrors] = {}
        self.tracks: dict[tuple[str, str], ContourTrack] = {}
        self.scans: dict[str, tuple[Truth, list[Scan]]] = {}  # by case

    def add(self, case: Case, method: str, track: ContourTrack, truth: Truth, scans: list[Scan]) -> None:
        """Measure a track and keep it."""
        key = (case.name, method)
        self.scans[case.name] = truth, scans
        self.tracks[key], self.errors[key] = track, errors(track, truth)
        self.rows.append(MethodRow(*key, measure(self.errors[key]), REFERENCE.get(key, {})))


@lru_cache(maxsize=1)
def scanned(number: int, runs: int, seed: int) -> tuple[Truth, list[Scan]]:
    """Truth and detections of a case of `CASES`; every case has its own random numbers."""
    case, child = CASES[number], np.random.SeedSequence(seed).spawn(len(CASES))[number]
    body = truth(case.course, case.shape, case.drift)
    return body, case.scans(body, runs, np.random.default_rng(child))


def tracked(number: int, method: str, runs: int, seed: int) -> ContourTrack:
    """What a method makes of a case."""
    return track(methods(CASES[number].sigma)[method], scanned(number, runs, seed)[1])


def experiment(
    runs: int,
    seed: int,
    found: UTurnRuns,
    progress: Progress = silent,
    wanted: Callable[[Case, str], bool] = lambda case, method: True,
    engine: Engine = HERE,
) -> None:
    """Run all cases, or the (case, method) that are wanted, into `found`.

    `found` holds what is finished when a Stopped comes through.
    """
    work = [(k, name) for k, case in enumerate(CASES) for name in case.methods if wanted(case, name)]
    with closing(calculated(tracked, [(*each, runs, seed) for each in work], engine)) as tracks:
        for done, (k, name) in enumerate(work):
            progress(done, len(work), f"{CASES[k].name}: {name}")
            found.add(CASES[k], name, next(tracks), *scanned(k, runs, seed))


def run(
    runs: int = 100, out: Path | None = None, progress: Progress = silent, seed: int = 0, engine: Engine = HERE
) -> PaperReport:
    """The whole experiment, about 20 minutes for 100 runs; see `carry_out`."""
    found = UTurnRuns()

    def draw(folder: Path) -> tuple[Path, ...]:
        from studies.papers.hoher2022 import figures  # with matplotlib, which takes long to import

        return figures.draw(found.errors, found.tracks, found.scans, folder)

    blank = PaperReport(
        paper=PAPER,
        title="Extended target tracking with random matrices and a virtual measurement model (Hoher et al., 2022)",
        settings={"runs": runs, "seed": seed, "steps before the errors count": SETTLED, "report": "project report"},
        columns=MEASURES,
        legend=LEGEND,
    )
    return carry_out(
        blank,
        lambda: experiment(runs, seed, found, progress, engine=engine),
        rows=lambda: found.rows,
        answers=lambda: answers(found.errors),
        draw=draw,
        out=out,
        progress=progress,
    )

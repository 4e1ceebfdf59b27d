"""Reproduction of hoher2022: Koch's random matrix with the virtual measurement model, on a U-turn before a lidar.

The text we have is a project report on Hoher et al. (2022), so the claims are the report's. "Printed" means its
equations as printed, "corrected" those of card rm_vmm, section 3. Rows, settings and tolerances are the card's.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sensors import RADARS, Radar
from testbed.papers.hoher2022.claims import verdicts
from testbed.papers.hoher2022.direct_fit import DirectFit
from testbed.papers.hoher2022.printed import PrintedKoch
from testbed.papers.hoher2022.reference import REFERENCE
from testbed.papers.hoher2022.runs import LEGEND, MEASURES, SETTLED, Errors, Method, Trace, errors, measure, track
from testbed.papers.hoher2022.uturn import FIRST, SECOND, Truth, UTurn, lidar_scans, radar_scans, truth
from testbed.papers.hoher2022.variants import ReportVariant, ShapeLms
from testbed.papers.verdict import Progress, Report, Row, Stopped
from trackers import Scan
from trackers.random_matrix.adaptation import Bayes, Lms
from trackers.random_matrix.koch import Koch
from trackers.random_matrix.virtual_measurements import VirtualMeasurements

PAPER = "hoher2022"
FINE = float(np.radians(0.1))  # [rad] grid of virtual rays in the report
SIGMAS = (0.0, 0.1, 0.5)  # [m]
DRIFT = float(np.radians(20.0))  # [rad] heading minus course of the drifting target
RADAR_RUNS = 20  # at most: our radar draws each scan by itself
RADAR_BLUR = 0.3  # [m] sensor noise that the random matrix of the radar case starts from


def methods(sigma: float) -> dict[str, Method]:
    """Every algorithm of the card at a sensor noise sigma [m], by its name in the tables."""
    printed = PrintedKoch(sigma=0.5 if sigma == 0 else sigma)
    report = ReportVariant(printed, Lms(), sigma=sigma, moments="eigenvalues", pitch=FINE)
    B = replace(report, koch=Koch())
    C = replace(B, moments="body")
    G = ReportVariant(sigma=sigma)
    table = [
        Method("RM printed, 1 sigma", printed),
        Method("RM corrected, 1 sigma", Koch()),
        Method("RM printed, 2 sigma", printed, sigmas=2.0),
        Method("RM corrected, 2 sigma", Koch(), sigmas=2.0),
    ]
    for letter, f in (("P", report), ("B", B), ("C", C)):
        table += [Method(f"{letter} I={n}", replace(f, rule=Lms(iterations=n))) for n in (1, 2, 5, 10)]
    table += [
        Method("C33 I=2", replace(C, pitch=0.0)),
        Method("G I=1", G),
        Method("G offset", replace(G, feedback_from=10)),
        Method("C offset", replace(C, feedback_from=10)),
        Method("C naive", C, naive=True),
        Method("direct I=2", replace(G, direct=DirectFit())),
        Method("B without sigma^2", replace(B, blur=False)),
    ]
    for name, tilt, gain, n in (
        ("square root I=2", "square-root", 1.0, 2),
        ("square root I=10", "square-root", 1.0, 10),
        ("abc I=10", "abc", 1.0, 10),
        ("abc gain 10 I=10", "abc", 10.0, 10),
    ):
        table.append(Method(name, replace(C, tilt=tilt, rule=ShapeLms(iterations=n, shape_gain=gain))))
    ours = VirtualMeasurements(rule=Bayes(), body="box", surface=0.9, unbiased=True, sigma=sigma)
    table.append(Method("box, Bayes (ours)", ours))
    return {m.name: m for m in table}


ALL = tuple(methods(0.1))[:23]  # what the first path's rectangle is asked
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
        """Without noise all runs are the same; the radar is slower."""
        if self.radar is not None:
            return min(runs, RADAR_RUNS)
        return runs if self.sigma else 1

    def scans(self, truth: Truth, runs: int, rng: np.random.Generator) -> list[Scan]:
        """Detections of every step, with the leading axis of the runs."""
        if self.radar is not None:
            return radar_scans(truth, self.radar, self.runs(runs), rng)
        return lidar_scans(truth, self.sigma, self.runs(runs), rng)


def half_plane(radar: Radar) -> Radar:
    """The first sensor of a rig at the origin, looking along +y over half the plane, where the first path lies."""
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


class Outcome:
    """Traces and errors of every method in every case, as far as they were run."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.errors: dict[tuple[str, str], Errors] = {}
        self.traces: dict[tuple[str, str], Trace] = {}
        self.looks: dict[str, tuple[Truth, list[Scan]]] = {}

    def add(self, case: Case, method: Method, trace: Trace, truth: Truth) -> None:
        """Measure a trace and keep it."""
        key = (case.name, method.name)
        e = errors(trace, truth)
        self.traces[key], self.errors[key] = trace, e
        self.rows.append(Row(case.name, method.name, measure(e), REFERENCE.get(key, {})))


def experiment(
    runs: int,
    seed: int,
    progress: Progress | None = None,
    wanted: Callable[[Case, str], bool] | None = None,
    outcome: Outcome | None = None,
) -> Outcome:
    """Run all cases, or the (case, method) that are wanted; every case has its own stream of random numbers.

    It runs into `outcome`, which then holds what is finished when a Stopped comes through.
    """
    chosen = [(c, [m for m in c.methods if wanted is None or wanted(c, m)]) for c in CASES]
    total = sum(len(names) for _, names in chosen)
    outcome, done = Outcome() if outcome is None else outcome, 0
    for (case, names), child in zip(chosen, np.random.SeedSequence(seed).spawn(len(CASES)), strict=True):
        if not names:
            continue
        body = truth(case.course, case.shape, case.drift)
        scans = case.scans(body, runs, np.random.default_rng(child))
        outcome.looks[case.name] = body, scans
        table = methods(case.sigma)
        for name in names:
            if progress is not None:
                progress(done, total, f"{case.name}: {name}")
            outcome.add(case, table[name], track(table[name], scans), body)
            done += 1
    if progress is not None:
        progress(done, total, "done")
    return outcome


def run(runs: int = 100, out: Path | None = None, progress: Progress | None = None, seed: int = 0) -> Report:
    """The whole experiment; with `out`, also its figures and JSON in that folder. About 20 minutes for 100 runs.

    A Stopped from `progress` ends it early: the report then holds the rows that are finished.
    """
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")
    outcome, finished = Outcome(), False
    with suppress(Stopped):
        experiment(runs, seed, progress, outcome=outcome)
        finished = True
    report = Report(
        paper=PAPER,
        title="Extended target tracking with random matrices and a virtual measurement model (Hoher et al., 2022)",
        settings={"runs": runs, "seed": seed, "steps before the errors count": SETTLED, "report": "project report"},
        columns=MEASURES,
        legend=LEGEND,
        rows=tuple(outcome.rows),
        verdicts=verdicts(outcome.errors) if finished else (),
        interrupted=not finished,
    )
    if out is None:
        return report
    if finished:
        from testbed.papers.hoher2022.figures import draw

        out.mkdir(parents=True, exist_ok=True)
        report = replace(report, figures=draw(outcome.errors, outcome.traces, outcome.looks, out))
    report.write(out)
    return report

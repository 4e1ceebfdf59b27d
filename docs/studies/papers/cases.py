"""One small case of each paper, repeated in seconds: what `studies refresh` holds against committed digits."""

from collections.abc import Callable, Mapping

import numpy as np

from studies.papers.hoher2022 import experiment as hoher2022
from studies.papers.report import MethodRow
from studies.papers.xia2020 import experiment as xia2020
from studies.papers.xia2020.results import TrialRuns
from studies.papers.xu2023 import experiment as xu2023
from studies.papers.xu2023.cases import SWEEPS
from studies.papers.yao2021 import experiment as yao2021
from studies.papers.yao2021.simulation import CONTOURS, run_stages, simulate
from trackers.pmht.model import find

RUNS, SEED = 2, 0


def hoher() -> list[MethodRow]:
    """The rectangle with noise on the first path, four methods."""
    found = hoher2022.UTurnRuns()
    chosen = ("RM printed, 1 sigma", "P I=2", "C33 I=2", "direct I=2")
    hoher2022.experiment(
        RUNS, SEED, found, wanted=lambda case, method: case.name == "rectangle, sigma 0.1" and method in chosen
    )
    return found.rows


def xia() -> list[MethodRow]:
    """The first generator in full view, all methods."""
    found = TrialRuns()
    xia2020.experiment([next(xia2020.full_cases(RUNS, SEED))], found)
    return found.rows


def xia_learned() -> list[MethodRow]:
    """One ride before the ray-cast radar, all methods."""
    found = TrialRuns()
    xia2020.experiment([next(xia2020.radar_cases(1, SEED))], found)
    return found.rows


def xu() -> list[MethodRow]:
    """The paper's filter with interacting models, and ours."""
    found = xu2023.ManeuverRuns()
    chosen = [s for s in SWEEPS if s.variants[0].name in ("EDRA-IMM, S", "recommended")][:2]
    xu2023.experiment(RUNS, SEED, found, sweeps=tuple(chosen))
    return found.rows


def yao() -> list[MethodRow]:
    """The first contour with our method."""
    name, method = next(iter(CONTOURS)), yao2021.METHODS[-1]
    scans = simulate(CONTOURS[name], RUNS, np.random.default_rng(SEED))
    return yao2021.rows({(name, method.name): run_stages(method, find(yao2021.MODEL), scans)})


CASES: Mapping[str, Callable[[], list[MethodRow]]] = {
    hoher2022.PAPER: hoher,
    xia2020.PAPER: xia,
    xia2020.LEARNED_PAPER: xia_learned,
    xu2023.PAPER: xu,
    yao2021.PAPER: yao,
}

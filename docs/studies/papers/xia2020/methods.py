"""The rows of the tables of xia2020: baselines, the papers' filters, and ours, with the tables they have learned.

Parameters: docs/methods/hierarchical-truncated-gaussians.md. The tables are learned from data of the same generator,
drawn apart from those that are tracked.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from studies.papers.xia2020.calibration import calibrate, single
from studies.papers.xia2020.generators import GENERATORS, NOISE, Training, draw_training
from studies.papers.xia2020.trials import SIZE, NamedFilter
from trackers.htg.bins import HTGTable, metric_ends
from trackers.htg.learned import HTGLearned, HTGMoment
from trackers.htg.learning import FitOptions, fit, fit_table
from trackers.htg.map import HTGMap
from trackers.htg.online import HTGOnline
from trackers.random_matrix.feldmann import RandomMatrix

MATCHED = {"htg": 0.446, "band": 0.547, "vrm": 0.658}  # rho from the second moment of the detections, full view
MATCHED_PARTIAL = 0.554
FULL_MASS, LOOSE_MASS, PARTIAL_MASS = 0.1, 0.1, 0.25  # least c_D of the tables for pseudo-measurements
SEED = 2020  # of the training data
POINTS = 20000

RM, RM_MATCHED = "RM, rho 1/4", "RM, matched rho"
ONLINE, ONLINE_N = "online bounds", "online bounds, n-count"
LEARNED, LEARNED_LOOSE, LEARNED_N = "learned", "learned, c_D from .1", "learned, n-count"
MM, MAP, MAP_SEED = "HTG-MM", "HTG-MAP", "HTG-MAP, the paper's bins"
MAP_HALF, BEST = "HTG-MAP, alpha .5", "HTG-MAP, calibrated"
RIG, OTHER_RIG, REAL = "surround", "imaging", "astyx"  # radars of the shipped tables; the last is a real one
ON_RIG, ON_OTHER, ON_REAL = (f"HTG-MAP of {source}" for source in (RIG, OTHER_RIG, REAL))


@lru_cache
def full_table(generator: str, mass: float = 0.0) -> HTGTable:
    """The density of a full-view generator, one bin."""
    u = GENERATORS[generator](np.random.default_rng(SEED), (POINTS,), SIZE)
    return single(fit(u, options=FitOptions(mass_min=mass)).p, u.mean(0), np.cov(u.T))


@lru_cache
def training() -> Training:
    """The detections that the partial-view tables are learned from."""
    return draw_training(np.random.default_rng(SEED))


@lru_cache
def paper_table(mass: float) -> HTGTable:
    """Densities of the partial view in the paper's eight bins, for pseudo-measurements: c_D is at least `mass`."""
    data = training()
    return fit_table(data.u, data.aspect, bins=8, centred=False, options=FitOptions(mass_min=mass)).table


@lru_cache
def partial_table(bins: int = 8, centred: bool = True, theta: float | None = None) -> HTGTable:
    """Densities of the partial view for likelihoods and moments; theta [rad] is held, or free for None."""
    data = training()
    return fit_table(data.u, data.aspect, bins=bins, centred=centred, options=FitOptions(theta=theta)).table


def upright_table() -> HTGTable:
    """Narrow bins with boxes along the axes of the vehicle: where calibration starts."""
    return partial_table(16, theta=0.0)


@lru_cache
def calibrated_table() -> HTGTable:
    """`upright_table` with metric near ends and unbiased scores: ours."""
    data = training()
    length, width = data.size.mean(0)
    table = metric_ends(replace(upright_table(), size=(length, width)))
    return calibrate(table, data.u * data.size / 2, data.size, data.aspect)


def full_methods(generator: str, learned_on: str | None = None) -> tuple[NamedFilter, ...]:
    """Rows of the full view for a generator; with `learned_on`, their tables are those of another one."""
    source = generator if learned_on is None else learned_on
    return (
        NamedFilter(RM, RandomMatrix),
        NamedFilter(RM_MATCHED, lambda: RandomMatrix(rho=MATCHED[generator])),
        NamedFilter(
            ONLINE, lambda: HTGOnline(RandomMatrix(rho=0.30), iterations=5, n_count=False, full_view=True, cap=2.5)
        ),
        NamedFilter(LEARNED, lambda: HTGLearned(full_table(source, FULL_MASS))),
        NamedFilter(LEARNED_N, lambda: HTGLearned(full_table(source, FULL_MASS), iterations=20, n_count=True)),
        NamedFilter(MM, lambda: HTGMoment(full_table(source))),
        NamedFilter(
            MAP, lambda: HTGMap(full_table(source), sigma=0.0, size_walk=0.02, alpha=0.5, metric=False), size_std=0.2
        ),
    )


def partial_methods() -> tuple[NamedFilter, ...]:
    """Rows of the partial view."""
    slow = RandomMatrix(tau=10.0)
    rm = RandomMatrix(tau=10.0, rho=0.35)
    return (
        NamedFilter(RM, lambda: slow),
        NamedFilter(RM_MATCHED, lambda: RandomMatrix(tau=10.0, rho=MATCHED_PARTIAL)),
        NamedFilter(ONLINE, lambda: HTGOnline(rm, iterations=5, n_count=False)),
        NamedFilter(ONLINE_N, lambda: HTGOnline(rm)),
        NamedFilter(LEARNED, lambda: HTGLearned(paper_table(PARTIAL_MASS), slow)),
        NamedFilter(LEARNED_LOOSE, lambda: HTGLearned(paper_table(LOOSE_MASS), slow)),
        NamedFilter(LEARNED_N, lambda: HTGLearned(paper_table(PARTIAL_MASS), slow, iterations=20, n_count=True)),
        NamedFilter(MM, lambda: HTGMoment(upright_table(), slow)),
        NamedFilter(MAP_SEED, lambda: HTGMap(partial_table(centred=False), sigma=0.0, metric=False), size_std=0.1),
        NamedFilter(MAP, lambda: HTGMap(partial_table(), sigma=0.0, metric=False), size_std=0.1),
        NamedFilter(MAP_HALF, lambda: HTGMap(partial_table(), sigma=0.0, alpha=0.5, metric=False), size_std=0.1),
        NamedFilter(BEST, lambda: HTGMap(calibrated_table(), sigma=0.0, alpha=0.6), size_std=0.1),
        NamedFilter(ON_RIG, lambda: HTGMap(f"{RIG}-car", sigma=NOISE), size_std=0.1),
    )

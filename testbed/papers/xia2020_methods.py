"""The rows of the tables of xia2020: baselines, the papers' filters, and ours, with the tables they have learned.

Settings: card htg_rm, sections 5 and 8. The tables are learned from data of the same generator, drawn apart from those
that are tracked.
"""

from functools import lru_cache

import numpy as np

from testbed.papers.xia2020_generators import GENERATORS, Training, draw_training
from testbed.papers.xia2020_trials import SIZE, Method
from trackers.htg.bins import HTGTable, single
from trackers.htg.learned import HTGLearned
from trackers.htg.learning import FitOptions, fit, fit_table
from trackers.htg.map import HTGMap
from trackers.htg.moment import HTGMoment
from trackers.htg.online import HTGOnline
from trackers.random_matrix import RandomMatrix

MATCHED = {"htg": 0.446, "band": 0.547, "vrm": 0.658}  # rho from the second moment of the detections, section 8.1
MATCHED_PARTIAL = 0.554
FREE = FitOptions()  # what HTG-MAP wants
FULL_MASS, PARTIAL_MASS = 0.1, 0.25  # least c_D of the tables for pseudo-measurements
SEED = 2020  # of the training data
POINTS = 20000

RM, RM_MATCHED = "RM, rho 1/4", "RM, matched rho"
ONLINE, ONLINE_N = "online bounds", "online bounds, n-count"
LEARNED, LEARNED_LOOSE, LEARNED_N = "learned", "learned, c_D from .1", "learned, n-count"
MM, MAP, MAP_SEED = "HTG-MM", "HTG-MAP", "HTG-MAP, the paper's bins"
MAP_HALF = "HTG-MAP, alpha .5"


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
def partial_table(bins: int = 8, centred: bool = True, mass: float = 0.0) -> HTGTable:
    """The densities of the partial view by aspect."""
    data = training()
    return fit_table(data.u, data.aspect, bins=bins, centred=centred, options=FitOptions(mass_min=mass)).table


def full_methods(generator: str) -> tuple[Method, ...]:
    """Rows of section 8.1 for a generator."""
    held, free = full_table(generator, FULL_MASS), full_table(generator)
    return (
        Method(RM, RandomMatrix()),
        Method(RM_MATCHED, RandomMatrix(rho=MATCHED[generator])),
        Method(ONLINE, HTGOnline(RandomMatrix(rho=0.30), iterations=5, n_count=False, full_view=True, cap=2.5)),
        Method(LEARNED, HTGLearned(held)),
        Method(LEARNED_N, HTGLearned(held, iterations=20, n_count=True)),
        Method(MM, HTGMoment(free)),
        Method(MAP, HTGMap(free, sigma=0.0, size_walk=0.02, alpha=0.5), size_std=0.2),
    )


def partial_methods() -> tuple[Method, ...]:
    """Rows of section 8.2."""
    slow = RandomMatrix(tau=10.0)
    rm = RandomMatrix(tau=10.0, rho=0.35)
    seed, centred = partial_table(8, False, PARTIAL_MASS), partial_table()
    return (
        Method(RM, slow),
        Method(RM_MATCHED, RandomMatrix(tau=10.0, rho=MATCHED_PARTIAL)),
        Method(ONLINE, HTGOnline(rm, iterations=5, n_count=False)),
        Method(ONLINE_N, HTGOnline(rm)),
        Method(LEARNED, HTGLearned(seed, slow)),
        Method(LEARNED_LOOSE, HTGLearned(partial_table(8, False, 0.1), slow)),
        Method(LEARNED_N, HTGLearned(seed, slow, iterations=20, n_count=True)),
        Method(MM, HTGMoment(partial_table(16), slow)),
        Method(MAP_SEED, HTGMap(partial_table(8, False), sigma=0.0), size_std=0.1),
        Method(MAP, HTGMap(centred, sigma=0.0), size_std=0.1),
        Method(MAP_HALF, HTGMap(centred, sigma=0.0, alpha=0.5), size_std=0.1),
    )

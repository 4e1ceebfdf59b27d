"""Values of whole suites made of seeded random numbers."""

import numpy as np

from testbed.experiments.tolerated import TOLERANCES

SCENARIOS = tuple(f"scenario-{k}" for k in range(24))
COUNTS = ("lost", "switches")


def make(seed, trackers=("a", "b"), scenarios=SCENARIOS):
    """Values by seed of each measure, two seeds."""
    rng = np.random.default_rng(seed)
    return {(t, c): {m: _draw(m, rng) for m in TOLERANCES} for t in trackers for c in scenarios}


def _draw(measure, rng):
    if measure in COUNTS:
        return rng.poisson(1.0, 2).astype(float)
    return 2 + rng.gamma(2.0, 1.0, 2) + 20 * (measure == "nees_position")  # far from its ideal, which noise only leaves


def shaken(values, seed, size):
    """The same after jitter of this many tolerances; counts stay integers."""
    rng = np.random.default_rng(seed)
    return {key: {m: x + jitter(m, x, rng, size) for m, x in cell.items()} for key, cell in values.items()}


def jitter(measure, x, rng, size):
    t = TOLERANCES[measure]
    e = rng.normal(0, size * (t.scenario + t.relative * x.mean()), x.shape)
    return np.round(e) if measure in COUNTS else e


def changed(values, key, measure, to):
    """The same with other values in one place."""
    return {**values, key: {**values[key], measure: np.asarray(to, float)}}

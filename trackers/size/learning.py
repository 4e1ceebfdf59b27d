"""The depth profile of a sensor, learned from detections of vehicles whose boxes are known.

Maximum likelihood of the density of the association at the true size. Equations:
docs/methods/size-from-both-ends.md, section 8.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, logit, ndtr

from trackers.scan import DepthProfile, SensorModel
from trackers.size.hits import LEAST_SLOPE
from trackers.size.profile import Profiles
from trackers.size.spatial import density

OUTLIERS = 0.01  # share of the detections that are spread evenly over AREA
AREA = 48.0  # [m^2]
LIMITS = {  # of what is learned
    "inside": (0.0, 1.0),
    "inside_depth": (0.1, 20.0),
    "depth": (0.0, 1.0),
    "depth_std": (0.005, 1.0),
    "grazing": (0.0, 1.0),
    "surface_std": (0.02, 0.6),
}
EVEN_ABOVE = 10.0  # [m] an inside depth beyond this is even


class Known(NamedTuple):
    """G detections of vehicles whose boxes are known."""

    xy: NDArray  # (G, 2) [m] in the axes of the box
    sight: NDArray  # (G, 2) unit line of sight in these axes
    size: NDArray  # (G, 2) [m]
    var: NDArray  # (G, 2) [m^2] noise along the axes


def log_density(profile: DepthProfile, z: Known) -> NDArray:
    """Log densities (G,) [1/m^2] at the true size, for sensors far away."""
    p = Profiles.of((SensorModel(profile=profile),)).at(np.zeros(len(z.xy), int))
    shown = np.abs(z.sight) ** (1 - profile.grazing) * z.size[:, ::-1]
    share = shown / shown.sum(-1, keepdims=True)
    behind = z.size / 2 + np.sign(z.sight) * z.xy
    var = z.var + profile.surface_std**2
    sigma, inner, spread = np.sqrt(var), *p.rounding.transpose(2, 0, 1)
    even = (ndtr(behind / sigma) - ndtr((behind - z.size + inner) / np.hypot(sigma, spread))) / (z.size - inner)
    deep = p.inside_depth[:, None] * np.maximum(np.abs(z.sight), LEAST_SLOPE)
    found = density((1 - profile.inside) * share, profile.inside * share, p, behind, z.size, var, even, deep)
    return np.log((1 - OUTLIERS) * found + OUTLIERS / AREA)


def fit(z: Known, start: DepthProfile, rounds: int = 3) -> tuple[DepthProfile, float]:
    """The profile of greatest likelihood, everything but `LIMITS` as in `start`, and its mean log density [nat]."""
    low, high = np.array(list(LIMITS.values())).T

    def profile(q: NDArray) -> DepthProfile:
        values = (low + (high - low) * expit(q)).tolist()
        return replace(start, **dict(zip(LIMITS, values, strict=True)))

    def loss(q: NDArray) -> float:
        return -float(log_density(profile(q), z).mean())

    first = np.array([min(getattr(start, name), EVEN_ABOVE) for name in LIMITS])
    q = logit(np.clip((first - low) / (high - low), 0.01, 0.99))
    for _ in range(rounds):  # a simplex that has shrunk is begun anew
        found = minimize(loss, q, method="Nelder-Mead", options={"maxfev": 1000, "adaptive": True})
        q = found.x
    best = profile(q)
    if best.inside_depth > EVEN_ABOVE:
        best = replace(best, inside_depth=np.inf)
    return best, -float(found.fun)

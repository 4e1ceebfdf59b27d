"""Existence of a track: survival, and what detections or their absence say; card multi_object steps 4 and 8."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Existence:
    """One Bernoulli probability a track."""

    life_visible: float = 60.0  # [s]
    life_hidden: float = 8.0  # [s] inside a field of view, behind something
    life_outside: float = 1.5  # [s] outside every field of view
    dispersion: float = 2.0  # k of the negative binomial count: measured counts vary more than Poisson
    miss_floor: float = 0.2  # one empty scan never says more than this
    pair_cap: float = 4.0  # log likelihood ratio of one detection
    missing: float = 0.3  # per expected detection
    bounds: tuple[float, float] = (-1.0, 8.0)  # of the log ratio of a scan
    most: float = 0.9999

    def survive(self, q: NDArray, visible: NDArray, in_view: NDArray, dt: float) -> NDArray:
        """Existence (T,) after dt [s]; visible, in_view (T,) bool."""
        life = np.where(visible, self.life_visible, np.where(in_view, self.life_hidden, self.life_outside))
        return q * np.exp(-dt / life)

    def log_ratio(self, n: NDArray, Gam: NDArray, evidence: NDArray) -> NDArray:
        """Log likelihood ratio (T,) of a scan.

        n (T,) detections owned, Gam (T,) expected, evidence (T,) sum of the capped log gains of the owned ones.
        """
        k = self.dispersion
        miss = np.maximum((1 + Gam / k) ** -k, self.miss_floor)
        seen = np.clip(evidence - self.missing * np.minimum(Gam, 6.0), *self.bounds)
        return np.where(n > 0, seen, np.log(miss))

    def update(self, q: NDArray, log_ratio: NDArray) -> NDArray:
        """Posterior existence (T,)."""
        L = np.exp(log_ratio)
        return np.minimum(q * L / (1 - q + q * L), self.most)

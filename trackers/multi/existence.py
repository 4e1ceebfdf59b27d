"""Existence of a track: survival, and the likelihood ratio of its detections or of their absence.

Equations: docs/methods/multi-object-tracking.md, sections 4 and 6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers


@dataclass(frozen=True)
class Existence:
    """One existence probability a track."""

    life_visible: float = 60.0  # [s]
    life_hidden: float = 4.0  # [s] inside a field of view, behind something
    life_silent: float = 8.0  # [s] where only radars that are out would see it
    life_outside: float = 1.5  # [s] outside every field of view
    dispersion: float = 2.0  # k of the negative binomial count: measured counts vary more than Poisson
    miss_floor: float = 0.2  # least likelihood ratio of an empty scan
    pair_cap: float = 4.0  # greatest log likelihood ratio of one detection
    missing: float = 0.3  # taken off the log ratio for each expected detection
    bounds: tuple[float, float] = (-1.0, 8.0)  # of the log ratio of a scan with detections
    most: float = 0.9999  # greatest existence probability

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=("life_visible", "life_hidden", "life_silent", "life_outside", "dispersion", "miss_floor"),
            signed=("bounds",),
        )

    def survive(self, q: NDArray, visible: NDArray, in_view: NDArray, hidden: NDArray, dt: float) -> NDArray:
        """Existence (T,) after dt [s]; visible to a radar that works, in_view and hidden (T,) bool."""
        unseen = np.where(hidden, self.life_hidden, self.life_silent)
        life = np.where(visible, self.life_visible, np.where(in_view, unseen, self.life_outside))
        return q * np.exp(-dt / life)  # (MOT.13)

    def log_ratio(self, n: NDArray, Gam: NDArray, evidence: NDArray) -> NDArray:
        """Log likelihood ratio (T,) of one scan, existing against not existing.

        n (T,) detections owned, Gam (T,) expected, evidence (T,) sum of the capped log gains of the owned ones.
        """
        k = self.dispersion
        miss = np.maximum((1 + Gam / k) ** -k, self.miss_floor)  # (MOT.23)
        seen = np.clip(evidence - self.missing * np.minimum(Gam, 6.0), *self.bounds)  # (MOT.24)
        return np.where(n > 0, seen, np.log(miss))

    def update(self, q: NDArray, log_ratio: NDArray) -> NDArray:
        """Posterior existence (T,)."""
        L = np.exp(log_ratio)
        return np.minimum(q * L / (1 - q + q * L), self.most)  # (MOT.25)

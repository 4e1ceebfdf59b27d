"""Radars that deliver nothing: their empty scans are no evidence that nothing is there.

Equations: docs/methods/life-cycle-of-tracks.md, section 4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from trackers.multi.visibility import Visibility


@dataclass(frozen=True)
class Silence:
    """Whether a sensor without a detection is out, where the scan does not say it."""

    prior: float = 1e-4  # probability of an outage in a scan
    dispersion: float = 2.0  # k of the negative binomial count
    clutter_share: float = 0.8  # of the data sheet's false alarms that are sure to come

    def probability(self, heard: NDArray, expected: NDArray, existence: NDArray, clutter: NDArray) -> NDArray:
        """Probability (S,) that each sensor is out, 0 for those heard (S,) bool.

        expected (S, T) detections of T tracks with existence (T,), clutter (S,) expected false alarms a scan.
        """
        none = (1 + expected / self.dispersion) ** -self.dispersion
        quiet = np.log1p(existence * (none - 1)).sum(1) - self.clutter_share * clutter  # (LIFE.18)
        if not heard.any():
            quiet = np.full(len(quiet), quiet.sum())  # (LIFE.19)
        return np.where(heard, 0.0, expit(np.log(self.prior) - quiet))  # (LIFE.20)


def without(view: Visibility, out: NDArray) -> Visibility:
    """What working sensors should see; out (S,) is the probability that each sensor delivers nothing."""
    share = np.where(out[:, None] > 0.5, 0.0, view.share)
    return view._replace(expected=view.expected * (1 - out[:, None]), share=share)  # (LIFE.21)

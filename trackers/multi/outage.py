"""Radars that deliver nothing: their empty scans are no evidence that nothing is there.

Equations: docs/methods/life-cycle-of-tracks.md, section 4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from trackers.multi.visibility import Visibility
from trackers.parameters import check_numbers


@dataclass(frozen=True)
class SensorOutage:
    """Whether a sensor without a detection is out, where the scan does not say it."""

    begins: float = 1e-4  # probability that an outage begins with a scan
    lasts: float = 0.9  # probability that it goes on
    dispersion: float = 2.0  # k of the negative binomial count
    clutter_share: float = 0.8  # of the data sheet's false alarms that are sure to come

    def __post_init__(self) -> None:
        check_numbers(self, positive=("dispersion",))

    def probability(
        self, before: NDArray, heard: NDArray, expected: NDArray, existence: NDArray, clutter: NDArray
    ) -> NDArray:
        """Probability (S,) that each sensor is out, 0 for those heard (S,) bool.

        before (S,) is that of the scan before, expected (S, T) the detections of T tracks with existence (T,), clutter
        (S,) the false alarms expected in a scan.
        """
        none = (1 + expected / self.dispersion) ** -self.dispersion
        quiet = np.log1p(existence * (none - 1)).sum(1) - self.clutter_share * clutter  # (LIFE.19)
        if not heard.any():
            quiet = np.full(len(quiet), quiet.sum())  # (LIFE.20)
        prior = self.begins + (self.lasts - self.begins) * before  # (LIFE.21)
        return np.where(heard, 0.0, expit(logit(prior) - quiet))  # (LIFE.22)


def without(view: Visibility, out: NDArray) -> Visibility:
    """What working sensors should see; out (S,) is the probability that each sensor delivers nothing."""
    share = np.where(out[:, None] > 0.5, 0.0, view.share)
    return view._replace(expected=view.expected * (1 - out[:, None]), share=share)  # (LIFE.23)

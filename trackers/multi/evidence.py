"""Evidence: what a cell of unexplained detections is worth, as a vehicle against clutter.

Equations: docs/methods/life-cycle-of-tracks.md, section 2.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from trackers.multi.window import Unexplained
from trackers.parameters import check_numbers


class Cells(NamedTuple):
    """C cells of detections, and what they are worth."""

    log_odds: NDArray  # (C,) of a vehicle against clutter, -inf where nothing is born
    standing: NDArray  # (C,) bool
    detections: NDArray  # (C,) int
    scans: NDArray  # (C,) int, that they come from


@dataclass(frozen=True)
class Evidence:
    """When a cell is a vehicle."""

    least: int = 3  # detections of a cell in the window, at least one of them of the present scan
    intensity: float = 2e-9  # [1/(m^2 m/s)] new vehicles a scan
    intensity_first: float = 1e-6  # [1/(m^2 m/s)] the same in the first scan
    first_decay: float = 0.3  # [s] in which that fades
    off_lane: float = 0.1  # share of these intensities off the lanes of a map
    clutter_factor: float = 2.0  # of the cells of a scan, as an estimate of its clutter
    pair_cap: float = 5.0  # greatest log likelihood ratio of one detection
    born_above: float = 0.03  # least existence at birth
    rate_span: float = 120.0  # [m/s] over which the range rates of new vehicles lie, where they are not measured
    standing_rate: float = 1.0  # [m/s] a cell stands if the mean magnitude of its ground range rates is below
    static_existence: tuple[float, float] = (0.05, 0.4)  # of a standing cell: by one scan, over time
    static_least: int = 3  # detections of a standing cell in one scan
    static_scans: int = 5  # of the window, in which a standing cell has a detection, where it has few in one
    static_time: float = 0.6  # [s] between the first and the last of them
    static_drift: float = 3.0  # [m/s] greatest speed of its place

    def __post_init__(self) -> None:
        check_numbers(
            self, positive=("least", "intensity", "intensity_first", "first_decay", "off_lane", "clutter_factor")
        )

    def clutter(self, points: Unexplained, label: NDArray, false_alarms: NDArray, crowded: bool = False) -> NDArray:
        """Clutter intensity (P,) [1/(m^2 m/s)], measured by the number of cells of each sensor in the present scan.

        label (P,) are the cells, false_alarms (S,) those expected of each sensor a scan. In a crowded scan cells that
        have the detections of a vehicle are not counted: most of it may be vehicles.
        """
        S = len(false_alarms)
        counted = points.now & (np.bincount(label[points.now])[label] < self.least) if crowded else points.now
        pairs = np.unique((label * S + points.sensor)[counted])
        cells = np.bincount(pairs % S, minlength=S)
        factor = np.maximum(1.0, self.clutter_factor * cells / np.maximum(false_alarms, 1.0))  # (LIFE.4)
        return points.clutter * factor[points.sensor]  # (LIFE.4)

    def newcomers(self, time: float) -> float:
        """Intensity of new vehicles [1/(m^2 m/s)] a scan, time [s] after the first scan."""
        fade = float(np.exp(-time / self.first_decay))
        return self.intensity + fade * (self.intensity_first - self.intensity)  # (LIFE.7)

    def judge(self, points: Unexplained, label: NDArray, clutter: NDArray, chance: NDArray, newcomers: float) -> Cells:
        """What the cells with labels (P,) are worth.

        clutter (P,) is that intensity, [1/m^2] without range rate, chance (P,) the number of false alarms expected to
        be linked to each detection.
        """
        C = label.max(initial=-1) + 1
        n, n_now = np.bincount(label, minlength=C), np.bincount(label[points.now], minlength=C)
        worth = np.minimum(-np.log(np.minimum(chance, 0.9)), self.pair_cap)  # (LIFE.5)
        most, least = np.full(C, -np.inf), np.full(C, np.inf)
        np.maximum.at(most, label, worth)
        np.minimum.at(least, label, np.where(points.measured, clutter, clutter / self.rate_span))
        off_lane = np.bincount(label, points.off_lane, C) > n / 2
        rho = newcomers * np.where(off_lane, self.off_lane, 1.0)
        log_odds = np.log(rho / least) + np.bincount(label, worth, C) - most  # (LIFE.6)
        born = (n >= self.least) & (n_now > 0) & (expit(log_odds) > self.born_above)
        scans = scan_counts(points, label, C)
        standing = np.bincount(label, np.abs(points.rate), C) / n < self.standing_rate
        over_time = (scans >= self.static_scans) & (n_now > 0) & self._stays(points, label, n)
        at_once = n_now >= self.static_least
        q = np.where(over_time, self.static_existence[1], np.where(at_once, self.static_existence[0], 0.0))
        with np.errstate(divide="ignore"):  # the logit of 0
            return Cells(np.where(standing, logit(q), np.where(born, log_odds, -np.inf)), standing, n, scans)

    def _stays(self, points: Unexplained, label: NDArray, n: NDArray) -> NDArray:
        """Which of C cells with n (C,) detections have been seen for long enough and have not moved."""
        mean = lambda a: np.bincount(label, a, len(n)) / n  # noqa: E731
        oldest, t = np.zeros(len(n)), points.age - mean(points.age)[label]
        np.maximum.at(oldest, label, points.age)
        slope = np.hypot(mean(t * points.xy[:, 0]), mean(t * points.xy[:, 1])) / np.maximum(
            mean(t**2), 1e-9
        )  # (LIFE.8)
        return (oldest > self.static_time) & (slope < self.static_drift)


def scan_counts(points: Unexplained, label: NDArray, cells: int) -> NDArray:
    """Number (C,) of scans that the detections of cells with labels (P,) come from."""
    _, scan = np.unique(points.age, return_inverse=True)
    scans = scan.max(initial=0) + 1
    return np.bincount(np.unique(label * scans + scan) // scans, minlength=cells)

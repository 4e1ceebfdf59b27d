"""What stands still in scans, by the ego motion that explains most range rates, and statistics of it.

Of simulated scans the ego motion is known; the real ones have none that could be used, theirs is fitted.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.standing.scans import RadarScan
from trackers.geometry import unit

TRIALS, INLIER, ROUNDS = 100, 0.2, 10  # pairs tried for a first guess; [m/s] that fits; refinements
STILL = 0.5  # [m/s] of range rate left over, up to which a detection counts as standing
RANGES = tuple(float(r) for r in range(0, 90, 10))  # [m]
AZIMUTHS = (0.0, 10.0, 20.0, 30.0, 40.0, 55.0)  # [deg] off the axis
ACROSS = ((0.0, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0))  # [m/s] of ego speed across the line of sight
TAILS = (0.1, 0.2, 0.3)  # [m/s]
LANE = 1.8  # [m] half width of the strip ahead
NEAR = 30.0  # [m] up to which the strip ahead is the own lane also where the road bends
STANDS = 1.0  # [m/s] below which the ego stands


class Judged(NamedTuple):
    """One scan, the velocity of its radar and the one that its range rates say."""

    scan: RadarScan
    fitted: NDArray  # (2,) [m/s]

    @property
    def velocity(self) -> NDArray:
        """Velocity (2,) [m/s] of the radar: the known one, or else the fitted one."""
        return self.fitted if self.scan.velocity is None else self.scan.velocity

    @property
    def rest(self) -> NDArray:
        """Range rates (M,) [m/s] less those of standing things."""
        return self.scan.polar[:, 2] + unit(self.scan.polar[:, 1]) @ self.velocity

    @property
    def still(self) -> NDArray:
        """Which detections (M,) stand."""
        return np.abs(self.rest) < STILL

    @property
    def speed(self) -> float:
        """Of the radar [m/s]."""
        return float(np.hypot(*self.velocity))


def fit_motion(polar: NDArray, seed: int = 0) -> NDArray:
    """Velocity (2,) [m/s] of the radar under which most range rates of polar (M, 3) are those of standing things.

    Random pairs give first guesses, least squares over what fits the result: Kellner et al. (2013), "Instantaneous
    ego-motion estimation using Doppler radar", Proc. ITSC. Raises ValueError for fewer than two detections.
    """
    if len(polar) < 2:
        raise ValueError(f"polar must have two detections or more, got {len(polar)}; leave such scans out")
    H, rate = -unit(polar[:, 1]), polar[:, 2]
    pair = np.argsort(np.random.default_rng(seed).random((TRIALS, len(rate))), -1)[:, :2]
    guess = np.linalg.pinv(H[pair]) @ rate[pair][..., None]  # (TRIALS, 2, 1)
    fits = np.abs(rate - (H @ guess)[..., 0]) < INLIER
    v = guess[fits.sum(-1).argmax(), :, 0]
    for _ in range(ROUNDS):
        inside = np.abs(rate - H @ v) < INLIER
        v = np.linalg.lstsq(H[inside], rate[inside], rcond=None)[0]
    return v


def judge(scan: RadarScan) -> Judged:
    """A scan with the ego motion that its range rates say."""
    return Judged(scan, fit_motion(scan.polar))


def runs(judged: Sequence[Judged]) -> dict[str, list[Judged]]:
    """The scans of each drive."""
    names = dict.fromkeys(one.scan.run for one in judged)
    return {name: [one for one in judged if one.scan.run == name] for name in names}


def spread(rest: NDArray) -> float:
    """Standard deviation of the middle of a distribution: 1.4826 times the median of its absolute values."""
    return 1.4826 * float(np.median(np.abs(rest))) if len(rest) else np.nan


def columns(judged: Sequence[Judged]) -> dict[str, NDArray]:
    """Standing detections (M,) of all scans: range [m], azimuth [rad], x, y [m], rest [m/s], ego speed [m/s]."""
    polar = np.concatenate([one.scan.polar[one.still] for one in judged])
    xy = np.concatenate([one.scan.xy[one.still] for one in judged])
    rest = np.concatenate([one.rest[one.still] for one in judged])
    speed = np.concatenate([np.full(int(one.still.sum()), one.speed) for one in judged])
    return {"range": polar[:, 0], "azimuth": polar[:, 1], "x": xy[:, 0], "y": xy[:, 1], "rest": rest, "speed": speed}


def statistics(judged: Sequence[Judged]) -> dict[str, float]:
    """Numbers of the tables, by label: detections a scan, where they stand, what ego motion leaves of their rates."""
    c, n = columns(judged), len(judged)
    total = sum(len(one.rest) for one in judged)
    r, off, across = c["range"], np.degrees(np.abs(c["azimuth"])), c["speed"] * np.abs(np.sin(c["azimuth"]))
    found = {
        "scans": float(n),
        "ego speed [m/s]": float(np.mean([one.speed for one in judged])),
        "detections a scan": total / n,
        "standing a scan": len(r) / n,
        "standing, share": len(r) / total,
    }
    for low, high in pairwise(RANGES):
        found[f"{low:.0f} to {high:.0f} m"] = ((r >= low) & (r < high)).sum() / n
    for low, high in pairwise(AZIMUTHS):
        found[f"{low:.0f} to {high:.0f} deg"] = ((off >= low) & (off < high)).sum() / n
    ahead = (np.abs(c["y"]) < LANE) & (r > 2)
    found[f"own lane, up to {NEAR:.0f} m"] = (ahead & (r < NEAR)).sum() / n
    found["strip ahead, all ranges"] = ahead.sum() / n
    found["rest, middle [m/s]"] = spread(c["rest"])
    for low, high in ACROSS:
        chosen = (across >= low) & (across < high)
        found[f"rest where {low:.0f} to {high:.0f} m/s across"] = spread(c["rest"][chosen])
    for tail in TAILS:
        found[f"rest beyond {tail:g} m/s, share"] = float((np.abs(c["rest"]) > tail).mean())
    apart = [np.hypot(*(one.fitted - one.velocity)) < STILL for one in judged if one.scan.velocity is not None]
    found["ego motion found, share of scans"] = float(np.mean(apart)) if apart else np.nan
    return found

"""The futures of the others: who drives beside the path stays in its lane, or changes onto the path.

How likely a change is follows from the place in the lane and the speed across it, and from how well both are known.
Equations: docs/methods/planners.md.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from testbed.planners.prediction import FADE, FOLLOWS, LanePath, Others, Relation, along_course, on_path
from trackers.geometry import perpendicular, unit

LOG_ODDS = np.array(
    [-6.0, 3.3, 5.8]
)  # of a change within 3 s, 1 and by offset [m], speed across [m/s]; docs/results/lane_changes.json
NEXT = (2.0, 5.5)  # [m] distances between the middle of the path and that of the lane beside it
UNLIKELY = 0.02  # changes less likely are left out


class Futures(NamedTuple):
    """F futures of N others: first all N, those beside the path without motion across; then the changes."""

    others: Others  # F
    of: NDArray  # (F,) row of the one whose future it is
    chance: NDArray  # (F,) probability, 1 for the first N

    def beyond(self, doubt: float) -> NDArray:
        """How much each of them counts (F,): changes up to a probability are no reason to brake."""
        return np.maximum(self.chance - doubt, 0.0) / (1 - doubt)  # (PLAN.17)


def change_probability(lean: NDArray, cov: NDArray, side: NDArray) -> NDArray:
    """Probability (...) of a lane change within 3 s to a side (...), 1 or -1, from offset and speed across.

    What is not known makes an unlikely change more likely, and a likely one not less.

    Args:
        lean: (..., 2) offset from the middle of the lane [m], speed across it [m/s].
        cov: (..., 2, 2) of the same.
        side: the sign of the offset of the lane that is changed to.
    """
    b = LOG_ODDS[1:]
    z = LOG_ODDS[0] + side * (lean @ b)  # (PLAN.9)
    variance = np.maximum((cov @ b) @ b, 0.0)
    return expit(np.maximum(z, z / np.sqrt(1 + np.pi / 8 * variance)))  # (PLAN.10)


def coming(path: LanePath, others: Others, now: Relation, length: float, width: float) -> tuple[NDArray, NDArray]:
    """Probabilities (N,) of a change onto the path, 0 for those that are not beside it, and who is beside (N,) bool.

    Beside are those that drive the same way in the next lane, ahead of the front bumper of an ego of a length and a
    width [m], and not yet on its path.
    """
    nearest = np.linalg.norm(others.position[:, None] - path.points, axis=-1).argmin(-1)
    centre = now.across - others.lean[:, 0]  # of their lane; NaN, and so not beside, for those that cross it
    beside = (np.abs(centre) > NEXT[0]) & (np.abs(centre) < NEXT[1]) & ~on_path(now, width)
    beside &= np.cos(others.course - path.heading[nearest]) > FOLLOWS
    beside &= (now.along - now.half[:, 0] > length / 2) & (now.speed > 0)
    lean = np.where(beside[:, None], others.lean, 0.0)
    return np.where(beside, change_probability(lean, others.lean_cov, -np.sign(now.across)), 0.0), beside


def futures(path: LanePath, others: Others, now: Relation, length: float, width: float) -> Futures:
    """The futures of others, as they are related to the path now, for an ego of a length and a width [m]."""
    chance, beside = coming(path, others, now, length, width)
    straight = along_course(others.velocity, others.course)
    staying = others._replace(velocity=np.where(beside[:, None], straight, others.velocity))
    rows = np.flatnonzero(chance >= UNLIKELY)
    changing = others.rows(rows)
    # a motion across that fades out in the middle of the path
    speed = -now.across[rows] / FADE  # (PLAN.11)
    changing = changing._replace(velocity=straight[rows] + speed[:, None] * perpendicular(unit(changing.course)))
    both = Others(*map(np.concatenate, zip(staying, changing, strict=True)))
    n = len(chance)
    return Futures(both, np.concatenate([np.arange(n), rows]), np.concatenate([np.ones(n), chance[rows]]))

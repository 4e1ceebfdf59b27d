"""The ellipses of objects in the plane, and detections from inside the body.

Equations: docs/methods/spline-pmht.md.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.linalg import I2
from trackers.motion.turn import PHI
from trackers.pmht.association import RelativeDetections, log_density
from trackers.pmht.state import LENGTH
from trackers.pmht.symmetric import columns, congruence

BOX = I2 / 12  # covariance of points even over the unit box
BOX_COLUMN = columns(BOX[None])  # (3, 1)


class UnitEllipses(NamedTuple):
    """The ellipses of objects in the unit frame, and a box that detections come from anywhere in."""

    mu: NDArray  # (..., 2, L) centres of the ellipses
    Sigma: NDArray  # (..., 3, L + 1) their covariances, and that of the box


class PlacedEllipses(NamedTuple):
    """The same in the plane, relative to some point."""

    c: NDArray  # (..., 2, L) [m]
    E: NDArray  # (..., 3, L) [m^2]
    centre: NDArray  # (..., 2, 1) [m]
    box: NDArray  # (..., 3, 1) [m^2]


def unit_ellipses(N: NDArray, p: NDArray, Sigma: NDArray) -> UnitEllipses:
    """The ellipses of control points p (..., n_c, 2) and covariances Sigma (..., L, 2, 2), (PMHT.3).

    N (L, n_c) are the weights of the control points.
    """
    box = np.broadcast_to(BOX_COLUMN, (*Sigma.shape[:-3], 3, 1))
    return UnitEllipses((N @ p).mT, np.concatenate([columns(Sigma), box], -1))


def place(ellipses: UnitEllipses, m: NDArray, origin: NDArray) -> PlacedEllipses:
    """The ellipses at the states m (..., 7), relative to origin (..., 2) [m]."""
    A = rotation(m[..., PHI]) * m[..., None, LENGTH:]  # (PMHT.3)
    centre = (m[..., :2] - origin)[..., None]
    E = congruence(A) @ ellipses.Sigma  # (PMHT.8)
    return PlacedEllipses(A @ ellipses.mu + centre, E[..., :-1], centre, E[..., -1:])  # (PMHT.8)


def interior_density(placed: PlacedEllipses, detections: RelativeDetections, share: float) -> NDArray:
    """Density f (..., M, 1) [1/m^2] of detections from anywhere inside, a `share` of them, beside the ellipses'."""
    if not share:
        return np.zeros((1, 1))
    return share / (1 - share) * np.exp(log_density(detections, placed.centre, placed.box))  # (PMHT.9)

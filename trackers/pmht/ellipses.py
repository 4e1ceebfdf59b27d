"""The ellipses of objects in the plane, and what comes from inside them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.linalg import I2
from trackers.motion import PHI
from trackers.pmht.association import Seen, log_density
from trackers.pmht.state import LENGTH, SplineState
from trackers.pmht.symmetric import columns, congruence

BOX = I2 / 12  # covariance of points even over the unit box
BOX_COLUMN = columns(BOX[None])  # (3, 1)


class Shape(NamedTuple):
    """The contour of objects in the unit frame."""

    mu: NDArray  # (..., 2, L) centres of the ellipses
    Sigma: NDArray  # (..., 3, L + 1) their covariances, and that of the box


class Placed(NamedTuple):
    """The ellipses of an object in the plane, relative to some point; the box as one more ellipse."""

    c: NDArray  # (..., 2, L) [m]
    E: NDArray  # (..., 3, L) [m^2]
    centre: NDArray  # (..., 2, 1) [m]
    box: NDArray  # (..., 3, 1) [m^2]


def shape_of(N: NDArray, state: SplineState) -> Shape:
    """The shapes of states; N (L, n_c) are the weights of the control points."""
    lead = state.Sigma.shape[:-3]
    box = np.broadcast_to(BOX_COLUMN, (*lead, 3, 1))
    return Shape((N @ state.p).mT, np.concatenate([columns(state.Sigma), box], -1))


def place(shape: Shape, m: NDArray, origin: NDArray) -> Placed:
    """The ellipses of the states m (..., 7), relative to origin (..., 2) [m]."""
    A = rotation(m[..., PHI]) * m[..., None, LENGTH:]
    centre = (m[..., :2] - origin)[..., None]
    E = congruence(A) @ shape.Sigma
    return Placed(A @ shape.mu + centre, E[..., :-1], centre, E[..., -1:])


def inside(placed: Placed, seen: Seen, share: float) -> NDArray:
    """Density (..., M, 1) [1/m^2] of the share of detections from anywhere inside, over that of the others."""
    if not share:
        return np.zeros((1, 1))
    return share / (1 - share) * np.exp(log_density(seen, placed.centre, placed.box))

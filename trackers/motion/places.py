"""What one spatial update says of the motion modes: its likelihood as a Gaussian, and each mode's share of it.

Equations: docs/methods/motion-modes.md, section 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.filter import Gaussian
from trackers.geometry import wrap_angle
from trackers.linalg import symmetrize
from trackers.motion.turn import PHI
from trackers.unscented import root

LOST = -0.1  # share of the information of the prediction that an update took away, from which on it was no update


class Likelihood(NamedTuple):
    """exp(s' (x - m) - (x - m)' Lam (x - m) / 2) of the places of detections, about the mean m of the prediction."""

    m: NDArray  # (..., 7)
    s: NDArray  # (..., 7) score
    Lam: NDArray  # (..., 7, 7) information, at least 0
    lost: NDArray  # (...) bool, the filter looked for the object elsewhere: no Gaussian likelihood leads there


def likelihood(before: Gaussian, after: Gaussian) -> Likelihood:
    """The likelihood that takes a filter from the Gaussian before to the one after."""
    T = root(before.P)
    inverse = np.linalg.inv(T)
    value, U = np.linalg.eigh(symmetrize(T.mT @ np.linalg.inv(after.P) @ T) - np.eye(7))  # (MODE.11)
    V = inverse.mT @ U
    Lam = symmetrize((V * np.maximum(value, 0.0)[..., None, :]) @ V.mT)  # (MODE.11)
    shift = after.m - before.m
    s = ((Lam + inverse.mT @ inverse) @ shift[..., None])[..., 0]  # (MODE.10)
    return Likelihood(before.m, s, Lam, value[..., 0] < LOST)


def corrected(m: NDArray, P: NDArray, places: Likelihood, after: Gaussian) -> tuple[NDArray, NDArray, NDArray]:
    """Means (..., K, 7) and covariances of the modes after the places, and log likelihoods (..., K).

    Where the object was lost, all modes take the Gaussian after the update, and none is likelier.
    """
    s, Lam = places.s[..., None, :], places.Lam[..., None, :, :]
    delta = m - places.m[..., None, :]
    delta[..., PHI] = wrap_angle(delta[..., PHI])
    A = np.eye(7) + P @ Lam
    P_new = symmetrize(np.linalg.solve(A, P))  # (MODE.12)
    pull = (Lam @ delta[..., None])[..., 0]
    rest = s - pull
    step = (P_new @ rest[..., None])[..., 0]
    log_l = (s * delta).sum(-1) - 0.5 * (delta * pull).sum(-1) + 0.5 * (rest * step).sum(-1)  # (MODE.13)
    log_l -= 0.5 * np.linalg.slogdet(A)[1]  # (MODE.13)
    lost = places.lost[..., None]
    m_new = np.where(lost[..., None], after.m[..., None, :], m + step)  # (MODE.12)
    P_new = np.where(lost[..., None, None], after.P[..., None, :, :], P_new)
    return m_new, P_new, np.where(lost, 0.0, log_l)

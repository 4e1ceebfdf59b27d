"""Moment matching after every detection: the mixture over its region becomes one Gaussian; card dra_imm, section 10.

Linear in the number of detections.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.dra.looks import Looks
from trackers.dra.matrix3 import inverse_and_log_det
from trackers.dra.measurement import Pieces, Residuals, log_constant, of_detection
from trackers.dra.posterior import Posterior, softmax
from trackers.dra.state import SEEN

ROWS = 15  # three numbers in each of five regions


def sequential(pieces: Pieces, seen: Residuals, looks: Looks) -> Posterior:
    """Posterior after all detections, in the order of the looks."""
    B, K = seen.nu.shape[:2]
    u, C, loglik = np.zeros((B, K, SEEN)), np.zeros((B, K, SEEN, SEEN)) + np.eye(SEEN), np.zeros((B, K))
    constant = np.broadcast_to(log_constant(looks), seen.log_prior.shape[:-1])
    D, noise = of_detection(pieces.D, looks), of_detection(pieces.B, looks)
    for r in range(seen.nu.shape[3]):
        count = int(np.searchsorted(-looks.n, -r, side="left"))  # objects with more than r detections come first
        own = r if D.shape[2] > 1 else 0
        du, dC, log_p = _absorb(
            u[:count], C[:count], D[:count, :, own], noise[:count, :, own], seen.nu[:count, :, :, r],
            seen.log_prior[:count, :, r],
        )  # fmt: skip
        u[:count] += du
        C[:count] -= dC
        loglik[:count] += log_p - constant[:count, :, r]
    return Posterior(u, (C + C.mT) / 2, loglik, np.zeros(B, bool))


def _absorb(
    u: NDArray, C: NDArray, D: NDArray, noise: NDArray, nu: NDArray, log_prior: NDArray
) -> tuple[NDArray, NDArray, NDArray]:
    """Step of the mean and loss of covariance by one detection, and its log likelihood but for a constant.

    D (b, K, 5, 3, 9), noise (b, K, 5, 3, 3), nu (b, K, 5, 3), log_prior (b, K, 5). The mean moves by
    sum_i w_i K_i e_i, and C loses sum_i w_i (K_i D_i C - du_i du_i^T) + dbar dbar^T, here as (D C)^T M (D C).
    """
    lead = u.shape[:-1]
    D = D.reshape(*lead, ROWS, SEEN)
    DC = D @ C
    G = (DC @ D.mT).reshape(*lead, 5, 3, 5, 3)
    S = np.moveaxis(np.diagonal(G, axis1=-4, axis2=-2), -1, -3) + noise
    S_inv, log_det = inverse_and_log_det(S)
    e = nu - (D @ u[..., None]).reshape(*lead, 5, 3)
    a = (S_inv @ e[..., None])[..., 0]
    w, log_p = softmax(log_prior - 0.5 * ((a * e).sum(-1) + log_det))
    wa = w[..., None] * a
    M = np.zeros((*lead, 5, 3, 5, 3))
    np.einsum("...iaib->...iab", M)[...] = w[..., None, None] * S_inv - wa[..., :, None] * a[..., None, :]
    abar = wa.reshape(*lead, ROWS)
    M = M.reshape(*lead, ROWS, ROWS)
    M += abar[..., :, None] * abar[..., None, :]
    return (abar[..., None, :] @ DC)[..., 0, :], DC.mT @ M @ DC, log_p

"""Soft weights: all detections at once, each divided among the regions, in a few passes; card dra_imm, section 10.

The cheapest form, good for 20 detections and more.
"""

import numpy as np

from trackers.dra.joint import terms
from trackers.dra.looks import Looks
from trackers.dra.measurement import Pieces, Residuals, marginal
from trackers.dra.posterior import Posterior, softmax
from trackers.dra.state import SEEN


def soft(pieces: Pieces, seen: Residuals, looks: Looks, passes: int) -> Posterior:
    """Posterior of information matrices weighted by the probabilities of the regions."""
    t = terms(pieces, seen, looks)
    B, K, _, M = seen.nu.shape[:4]
    real = (np.arange(M) < looks.n[:, None])[:, None, None]
    one = t.A.shape[2] == 1
    A_flat, g_flat = t.A.reshape(B, K, -1, SEEN * SEEN), t.g.reshape(B, K, -1, SEEN)
    constant = np.ascontiguousarray(t.constant.mT)  # weights are (B, K, 5, M): sums over regions run along M
    w, _ = softmax(np.ascontiguousarray(marginal(pieces, seen, looks).mT), axis=-2)
    for k in range(passes):
        w = np.where(real, w, 0.0)
        load = w.sum(-1) if one else w.mT.reshape(B, K, -1)
        A = np.eye(SEEN) + (load[..., None, :] @ A_flat).reshape(B, K, SEEN, SEEN)
        C = np.linalg.inv(A)
        g = (w.reshape(B, K, 1, -1) @ g_flat)[..., 0, :]
        u = (C @ g[..., None])[..., 0]
        second = (A_flat @ (C + u[..., :, None] * u[..., None, :]).reshape(B, K, -1, 1)).reshape(B, K, -1, 5).mT
        log_w = constant + (g_flat @ u[..., None]).reshape(B, K, 5, M) - 0.5 * second  # expected residuals
        if k < passes - 1:
            w, _ = softmax(log_w, axis=-2)
    weighted = w[..., None] * t.g
    gm = weighted.sum(2)
    spread = weighted.reshape(B, K, -1, SEEN).mT @ g_flat - gm.mT @ gm
    _, each = softmax(log_w, axis=-2)
    # bound of the evidence: expected likelihood less the distance of the posterior from the prior
    away = np.trace(C, axis1=-2, axis2=-1) + (u * u).sum(-1) - SEEN - np.linalg.slogdet(C)[1]
    log_c1 = np.where(real[:, 0], each, 0.0).sum(-1) - away / 2
    C = C + C @ spread @ C
    return Posterior(u, (C + C.mT) / 2, log_c1, np.zeros(B, bool))

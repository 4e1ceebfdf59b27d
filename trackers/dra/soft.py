"""Soft weights: all detections at once, each divided among the regions, in a few passes.

Equations: docs/methods/data-regions.md. The cheapest form, good for 20 detections and more.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.flat_scan import FlatScan
from trackers.dra.matrix3 import inverse_and_log_det
from trackers.dra.measurement import (
    LinearisedRegions,
    RegionResiduals,
    log_constant,
    marginal,
    of_detection,
    transform,
)
from trackers.dra.posterior import RegionPosterior, softmax
from trackers.dra.state import OBSERVED


class InformationTerms(NamedTuple):
    """What one detection in one region adds to information and score of u, and to the log likelihood."""

    A: NDArray  # (B, K, M or 1, 5, 9, 9)
    g: NDArray  # (B, K, 5, M, 9)
    constant: NDArray  # (B, K, M, 5)


def information_terms(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> InformationTerms:
    """Terms of every detection in every region; 0 for padding."""
    B_inv, log_det = inverse_and_log_det(regions.B)
    A = regions.D.mT @ (B_inv @ regions.D)  # (DRA.23)
    b = transform(residuals.nu, B_inv, flat)
    q = np.einsum("...a,...a->...", b, residuals.nu).mT + of_detection(log_det, flat)
    real = (np.arange(residuals.nu.shape[3]) < flat.n[:, None])[:, None, :]
    g = transform(b * real[:, :, None, :, None], regions.D, flat)  # (DRA.23)
    constant = residuals.log_prior - 0.5 * q - log_constant(flat)[..., None]  # (DRA.23)
    return InformationTerms(of_detection(A, flat), g, np.where(real[..., None], constant, 0.0))


def soft(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan, passes: int) -> RegionPosterior:
    """Posterior of information matrices weighted by the probabilities of the regions."""
    t = information_terms(regions, residuals, flat)
    B, K, _, M = residuals.nu.shape[:4]
    real = (np.arange(M) < flat.n[:, None])[:, None, None]
    one = t.A.shape[2] == 1
    A_flat, g_flat = t.A.reshape(B, K, -1, OBSERVED * OBSERVED), t.g.reshape(B, K, -1, OBSERVED)
    constant = np.ascontiguousarray(t.constant.mT)  # weights are (B, K, 5, M): sums over regions run along M
    w, _ = softmax(np.ascontiguousarray(marginal(regions, residuals, flat).mT), axis=-2)
    for k in range(passes):
        w = np.where(real, w, 0.0)
        load = w.sum(-1) if one else w.mT.reshape(B, K, -1)
        A = np.eye(OBSERVED) + (load[..., None, :] @ A_flat).reshape(B, K, OBSERVED, OBSERVED)  # (DRA.24a)
        C = np.linalg.inv(A)  # (DRA.24a)
        g = (w.reshape(B, K, 1, -1) @ g_flat)[..., 0, :]
        u = (C @ g[..., None])[..., 0]  # (DRA.24a)
        second = (A_flat @ (C + u[..., :, None] * u[..., None, :]).reshape(B, K, -1, 1)).reshape(B, K, -1, 5).mT
        log_w = constant + (g_flat @ u[..., None]).reshape(B, K, 5, M) - 0.5 * second  # (DRA.24b)
        if k < passes - 1:
            w, _ = softmax(log_w, axis=-2)
    weighted = w[..., None] * t.g
    gm = weighted.sum(2)
    spread = weighted.reshape(B, K, -1, OBSERVED).mT @ g_flat - gm.mT @ gm  # (DRA.25), G
    _, each = softmax(log_w, axis=-2)
    away = np.trace(C, axis1=-2, axis2=-1) + (u * u).sum(-1) - OBSERVED - np.linalg.slogdet(C)[1]
    log_c1 = np.where(real[:, 0], each, 0.0).sum(-1) - away / 2  # (DRA.26)
    C = C + C @ spread @ C  # (DRA.25)
    return RegionPosterior(u, (C + C.mT) / 2, log_c1)

"""From states and scans to the arrays of `trackers.compiled.spline`, and back."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.compiled import kernels, rows
from trackers.pmht.ellipses import UnitEllipses
from trackers.pmht.info import SplineInfo
from trackers.pmht.state import SplineState
from trackers.scan import Scan


def compiled_update(
    f: Any, state: SplineState, ellipses: UnitEllipses, scan: Scan
) -> tuple[NDArray, NDArray, SplineInfo] | None:
    """Moments and information of `SplinePmht` f after the places of a scan, or None: to be done in numpy."""
    spline = kernels("spline") if isinstance(f.form, str) else None
    if spline is None:
        return None
    lead, M, L, A = state.m.shape[:-1], scan.mask.shape[-1], *ellipses.mu.shape[-1:], state.visible.shape[-2]
    rules = spline.Rules(
        f.iterations, float(f.sigma), float(f.widened), float(f.eps), float(f.unseen), float(f.lost_below),
        float(f.interior), f.visibility == "rays",
    )  # fmt: skip
    m, P, eps, S, share, good = spline.update_all(
        rows(state.m, lead, 7), rows(state.P, lead, 7, 7), rows(ellipses.mu, lead, 2, L),
        rows(ellipses.Sigma, lead, 3, L + 1), rows(state.visible, lead, A, L), rows(scan.polar, lead, M, 3),
        rows(scan.pose, lead, M, 3), rows(scan.noise, lead, M, 3), rows(scan.mask, lead, M), rules,
    )  # fmt: skip
    if not good:
        return None
    n, none = scan.mask.sum(-1), np.zeros(lead, bool)
    info = SplineInfo(n, eps.reshape(*lead, 2), S.reshape(*lead, 2, 2), share.reshape(lead), none)
    return m.reshape(state.m.shape), P.reshape(state.P.shape), info

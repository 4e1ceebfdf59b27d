"""Expected information of a detection under the density.

The score of one detection in the state (px, py, phi, log l, log w) is linear in six functions of u = (x, y) and of the
gradient s of the log density,

    f = [s_x, s_y, s_x y, s_y x, s_x x + 1, s_y y + 1],

so the expected information is L F L^T with F = E[f f^T], (HTG.34). F depends on the density and the noise only and is
tabulated. Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers.htg.bins import HTGTable
from trackers.htg.density import HTG, evaluate, lift, prepare

LEVELS = np.array([0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0])  # noise variances in unit coordinates, along one axis
SWITCH = np.sqrt(np.maximum(LEVELS[:-1], 1e-3) * LEVELS[1:])  # between neighbours; the geometric mean
SPAN, STEP, MOST = 4.5, 0.7, 160  # grid: half width and spacing in standard deviations, points along an axis


def score_moments(p: HTG) -> NDArray:
    """F (6, 6) of one density p (), by a rectangle rule fine enough for its sharpest edge."""
    half = SPAN * np.sqrt(p.rho + p.r)
    edge = STEP * np.sqrt(p.rho * p.r / (p.rho + p.r))
    count = np.minimum(np.ceil(2 * half / edge), MOST).astype(int)
    zx, zy = (np.linspace(-h, h, n) for h, n in zip(half, count, strict=True))
    zx, zy = (a.ravel() for a in np.meshgrid(zx, zy, indexing="ij"))
    x, y = np.cos(p.theta) * zx - np.sin(p.theta) * zy, np.sin(p.theta) * zx + np.cos(p.theta) * zy
    log_p, (gx, gy) = evaluate(np.stack([x, y]), prepare(lift(p, 1)))
    f = np.stack([gx, gy, gx * y, gy * x, gx * x + 1, gy * y + 1])  # (HTG.34)
    weight = np.exp(log_p)
    return (f * (weight / weight.sum())) @ f.T  # (HTG.34)


@lru_cache(maxsize=64)
def information_table(table: HTGTable) -> NDArray:
    """F (B, levels, levels, 6, 6) of every bin with additional noise along the two turned axes."""
    B, K = len(table), len(LEVELS)
    F = np.empty((B, K, K, 6, 6))
    for b, i, j in np.ndindex(B, K, K):
        p = table.of(np.array(b))
        F[b, i, j] = score_moments(p._replace(r=p.r + LEVELS[[i, j]]))
    return F


def information(table: HTGTable, index: NDArray, noise: NDArray) -> NDArray:
    """F (..., 6, 6) for bins index (...) and additional noise variances (..., 2), at the nearest tabulated level."""
    level = np.searchsorted(SWITCH, noise)
    return information_table(table)[index, level[..., 0], level[..., 1]]

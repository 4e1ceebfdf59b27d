"""htg-mm: the random matrix with the learned mean and covariance of each aspect bin.

No hole and no pseudo-measurements: z ~ (c + A mu_b, A C_b A^T) with the moments of the training data, (HTG.26). Cheap,
and the mean of the detections is no longer taken for the centre.
Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers import held_gaussian
from trackers.batch import select
from trackers.estimate import Estimate
from trackers.filter import UpdateInfo
from trackers.htg.bins import HTGTable, resolve
from trackers.htg.pseudo import body_axes, inverse_axes, length, mean_extent, sample_of
from trackers.htg.spatial import log_spatial
from trackers.linalg import inverse, inverse_sqrtm, outer, sqrtm, symmetrize
from trackers.motion.turn import PHI
from trackers.parameters import check_numbers
from trackers.random_matrix.feldmann import RandomMatrix, RMState
from trackers.scan import Scan
from trackers.validation import guarded_update


@dataclass(frozen=True)
class HTGMoment:
    """Moment-matched update in aspect bins; the noise of the detections is the one that the table was learned with."""

    table: str | HTGTable = "surround-car+surround-truck"  # see `bins.resolve`
    rm: RandomMatrix = field(default_factory=RandomMatrix)  # motion, forgetting, range rates
    sigma: float = 0.2  # [m] noise, in the association, of detections whose scan does not state it
    iterations: int = 2

    angles = RandomMatrix.angles
    gaussian, with_gaussian, shift = held_gaussian.gaussian, held_gaussian.with_gaussian, held_gaussian.shift
    extent, with_extent = RandomMatrix.extent, RandomMatrix.with_extent

    def __post_init__(self) -> None:
        check_numbers(self, positive=("iterations",))

    def model(self) -> HTGTable:
        """The table."""
        return resolve(self.table)

    def init(self, estimate: Estimate) -> RMState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        return self.rm.init(estimate)

    def predict(self, state: RMState, dt: float) -> RMState:
        """Time update over dt [s] >= 0, coordinated turn."""
        return self.rm.predict(state, dt)

    @guarded_update
    def update(self, state: RMState, scan: Scan) -> tuple[RMState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        table, s = self.model(), sample_of(scan, self.sigma)
        m, P, nu, V = state
        count = np.maximum(s.n, 1)[..., None, None]
        root, new = sqrtm(mean_extent(state)), state
        for _ in range(self.iterations):
            A = body_axes(mean_extent(new), new.m[..., PHI])  # (HTG.16)
            b = table.bin_at(new.m[..., :2], new.m[..., PHI], length(A), s.sensor)
            S = P[..., :2, :2] + A @ table.cov[b] @ A.mT / count  # (HTG.27)
            eps = s.mean - (A @ table.mean[b][..., None])[..., 0] - m[..., :2]  # (HTG.27)
            K = P[..., :2] @ inverse(S)
            W = A @ whitening(table)[b] @ inverse_axes(A)  # (HTG.27)
            B = root @ inverse_sqrtm(S)
            new = RMState(
                m=m + (K @ eps[..., None])[..., 0],  # (HTG.28)
                P=symmetrize(P - K @ P[..., :2, :]),  # (HTG.28)
                nu=nu + s.n,  # (HTG.28)
                V=symmetrize(V + B @ outer(eps) @ B.mT + W @ s.spread @ W.mT),  # (HTG.28)
            )
        m, P = self.rm.rates.correct(new.m, new.P, scan, scan.xy)  # (RR.4)
        return select(s.n > 0, new._replace(m=m, P=P), state), UpdateInfo(s.n, eps, S)

    def estimate(self, state: RMState) -> Estimate:
        """Box along the heading."""
        return self.rm.estimate(state)

    def resize(self, state: RMState, size: NDArray, size_std: NDArray) -> RMState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return self.rm.resize(state, size, size_std)

    def log_spatial(self, state: RMState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        return log_spatial(self.model(), self.estimate(state), scan, track, detection, self.sigma)


@lru_cache(maxsize=64)
def whitening(table: HTGTable) -> NDArray:
    """C_b^-1/2 (B, 2, 2) of the bins."""
    return inverse_sqrtm(table.cov)

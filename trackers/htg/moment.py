"""htg-mm: the random matrix with the learned mean and covariance of each aspect bin; card section 7, last part.

No hole and no pseudo-measurements: z ~ (c + A mu_b, A C_b A^T) with the moments of the training data. Cheap, and the
mean of what a sensor sees is no longer taken for the centre.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.htg.bins import HTGTable, resolve
from trackers.htg.pseudo import frame, inverse_frame, length, mean_extent, sample_of
from trackers.htg.spatial import log_spatial
from trackers.linalg import inverse, inverse_sqrtm, outer, sqrtm, symmetrize
from trackers.motion import PHI
from trackers.protocols import UpdateInfo
from trackers.random_matrix.feldmann import RandomMatrix, RMState
from trackers.scan import Scan, check_scan


@dataclass(frozen=True)
class HTGMoment:
    """Moment-matched update in aspect bins; the noise of the detections is the one that the table was learned with."""

    table: str | HTGTable = "surround-car+surround-truck"  # as `bins.resolve` takes it
    rm: RandomMatrix = field(default_factory=RandomMatrix)  # motion, memory, range rates
    sigma: float = 0.2  # [m] noise in the association of detections that do not tell theirs
    iterations: int = 2

    def model(self) -> HTGTable:
        """The table."""
        return resolve(self.table)

    def init(self, estimate: Estimate) -> RMState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        return self.rm.init(estimate)

    def predict(self, state: RMState, dt: float) -> RMState:
        """Time update over dt [s] >= 0, coordinated turn."""
        return self.rm.predict(state, dt)

    def update(self, state: RMState, scan: Scan) -> tuple[RMState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        check_scan(scan)
        table, s = self.model(), sample_of(scan, self.sigma)
        m, P, nu, V = state
        count = np.maximum(s.n, 1)[..., None, None]
        root, new = sqrtm(mean_extent(state)), state
        for _ in range(self.iterations):
            A = frame(mean_extent(new), new.m[..., PHI])
            b = table.bin_at(new.m[..., :2], new.m[..., PHI], length(A), s.sensor)
            S = P[..., :2, :2] + A @ table.cov[b] @ A.mT / count
            eps = s.mean - (A @ table.mean[b][..., None])[..., 0] - m[..., :2]
            K = P[..., :2] @ inverse(S)
            W = A @ whitening(table)[b] @ inverse_frame(A)
            B = root @ inverse_sqrtm(S)
            new = RMState(
                m=m + (K @ eps[..., None])[..., 0],
                P=symmetrize(P - K @ P[..., :2, :]),
                nu=nu + s.n,
                V=symmetrize(V + B @ outer(eps) @ B.mT + W @ s.spread @ W.mT),
            )
        m, P = self.rm.range_rates(new.m, new.P, scan, scan.xy)
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

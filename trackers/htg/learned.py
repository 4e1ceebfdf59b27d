"""htg-rm-learned: the random matrix with learned holes, Xia et al. (2020), sections III and IV; card section 4b."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.htg.bins import HTGTable, resolve
from trackers.htg.density import complement, log_mass, noise_matrix
from trackers.htg.pseudo import Hole, correct, fill, frame, length, mean_extent, recount, sample_of, scale_of
from trackers.htg.spatial import log_spatial
from trackers.motion import PHI
from trackers.protocols import UpdateInfo
from trackers.random_matrix import RandomMatrix, RMState
from trackers.scan import Scan, check_scan

LEAST_SHARE = 1e-3  # of the Gaussian outside the hole: N = n / c_D must stay finite


@dataclass(frozen=True)
class HTGLearned:
    """Iterated pseudo-measurement update; `n_count` repairs its confidence and wants about 20 iterations."""

    table: str | HTGTable = "surround-car-cd25+surround-truck-cd25"  # as `bins.resolve` takes it; c_D not too small
    rm: RandomMatrix = field(default_factory=RandomMatrix)  # motion, memory, range rates
    sigma: float = 0.0  # [m] noise beside the table's of detections that do not tell theirs
    iterations: int = 5
    n_count: bool = False  # information of the n true detections only, the card's repair; else the paper's update

    def model(self) -> HTGTable:
        """The table; raises ValueError for one in other unit coordinates than the paper's."""
        table = resolve(self.table)
        if not table.plain:
            raise ValueError(f"table {table.name!r} has a frame of its own; this filter needs one without calibration")
        return table

    def init(self, estimate: Estimate) -> RMState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        return self.rm.init(estimate)

    def predict(self, state: RMState, dt: float) -> RMState:
        """Time update over dt [s] >= 0, coordinated turn."""
        return self.rm.predict(state, dt)

    def update(self, state: RMState, scan: Scan) -> tuple[RMState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        check_scan(scan)
        s = sample_of(scan, self.sigma)
        some = s._replace(n=np.maximum(s.n, 1))  # rows without a detection must stay regular
        table, X_hat, new = self.model(), mean_extent(state), state
        for _ in range(self.iterations):
            A = frame(mean_extent(new), new.m[..., PHI])
            p = table.of(table.bin_at(new.m[..., :2], new.m[..., PHI], length(A), s.sensor))
            hole = Hole(np.maximum(np.exp(log_mass(p)), LEAST_SHARE), *complement(p))
            count, mean, spread = fill(some, hole, new.m[..., :2], A, s.noise)
            # R of the density is in unit coordinates, so it grows with the iterate; the scale stays the prediction's.
            Y = p.rho[..., None, None] * X_hat + A @ noise_matrix(p) @ A.mT + s.noise
            scale = scale_of(state, Y)
            new, eps, S = correct(state, scale, count, mean, spread)
        if self.n_count:
            new = recount(state, new, scale, some.n)
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

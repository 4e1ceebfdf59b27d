"""htg-rm-learned and htg-mm: random matrices with learned densities by aspect.

The first is that of Xia et al. (2020), sections III and IV, with learned holes; the second, ours, has the learned mean
and covariance of each aspect bin. Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers import held_gaussian
from trackers.batch import select
from trackers.estimate import Estimate
from trackers.filter import UpdateInfo
from trackers.htg import pseudo
from trackers.htg.bins import HTGTable, log_spatial, resolve
from trackers.htg.density import complement, log_mass, noise_matrix
from trackers.linalg import inverse, inverse_sqrtm, outer, sqrtm, symmetrize
from trackers.motion.turn import PHI
from trackers.parameters import check_numbers
from trackers.random_matrix.feldmann import RandomMatrix, RMState
from trackers.scan import Scan
from trackers.validation import guarded_update

LEAST_SHARE = 1e-3  # of the Gaussian outside the hole: N = n / c_D must stay finite


@dataclass(frozen=True)
class LearnedRandomMatrix:
    """What both filters share: the motion and the extent of a random matrix, and a table of learned densities."""

    table: str | HTGTable = "surround-car+surround-truck"  # see `bins.resolve`
    rm: RandomMatrix = field(default_factory=RandomMatrix)  # motion, forgetting, range rates
    sigma: float = 0.2  # [m] noise of detections whose scan does not state it
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

    def estimate(self, state: RMState) -> Estimate:
        """Box along the heading."""
        return self.rm.estimate(state)

    def resize(self, state: RMState, size: NDArray, size_std: NDArray) -> RMState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return self.rm.resize(state, size, size_std)

    def log_spatial(self, state: RMState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        return log_spatial(self.model(), self.estimate(state), scan, track, detection, self.sigma)


@dataclass(frozen=True)
class HTGLearned(LearnedRandomMatrix):
    """Iterated pseudo-measurement update; `n_count` repairs its confidence and needs about 20 iterations."""

    table: str | HTGTable = "surround-car-cd25+surround-truck-cd25"  # c_D not too small
    sigma: float = 0.0  # [m] beside the noise of the table
    iterations: int = 5
    n_count: bool = False  # information of the n detections alone, (HTG.20); else of all N as in the paper

    def model(self) -> HTGTable:
        """The table; raises ValueError for one that is not in the unit coordinates of the paper, (HTG.1)."""
        table = super().model()
        if not table.plain:
            raise ValueError(
                f"table {table.name!r} has unit coordinates of its own; this filter needs a table without calibration"
            )
        return table

    @guarded_update
    def update(self, state: RMState, scan: Scan) -> tuple[RMState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        s = pseudo.sample_of(scan, self.sigma)
        some = s._replace(n=np.maximum(s.n, 1))  # rows without a detection must stay regular
        table, X_hat = self.model(), pseudo.mean_extent(state)
        models, root, m, X = bin_models(table), sqrtm(X_hat), state.m, X_hat
        for _ in range(self.iterations):
            A = pseudo.body_axes(X, m[..., PHI])  # (HTG.16)
            index = table.bin_at(m[..., :2], m[..., PHI], pseudo.length(A), s.sensor)
            model = BinModels(*(leaf[index] for leaf in models))
            hole = pseudo.Hole(model.share, model.mean, model.cov)
            count, mean, spread = pseudo.fill(some, hole, m[..., :2], A, s.noise)  # (HTG.17)
            # R of the density is in unit coordinates, so it grows with the iterate; the scale stays the prediction's.
            scale = pseudo.scale_of(root, model.rho * X_hat + A @ model.noise @ A.mT + s.noise)  # (HTG.18)
            last = pseudo.correct(state, scale, count, mean, spread)  # (HTG.19)
            m, X = last.m, last.X
        new = pseudo.posterior(state, last, scale, some.n if self.n_count else count)
        m, P = self.rm.rates.correct(new.m, new.P, scan, scan.xy)  # (RR.4)
        return select(s.n > 0, new._replace(m=m, P=P), state), UpdateInfo(s.n, last.eps, last.S)


class BinModels(NamedTuple):
    """Statistics of the densities of bins, in unit coordinates."""

    share: NDArray  # (...) c_D
    mean: NDArray  # (..., 2) of the part that the hole cuts out
    cov: NDArray  # (..., 2, 2) of that part, noise included
    rho: NDArray  # (..., 1, 1)
    noise: NDArray  # (..., 2, 2) R_UC


@lru_cache(maxsize=64)
def bin_models(table: HTGTable) -> BinModels:
    """Statistics of the bins (B,) of the table."""
    p = table.p
    share = np.maximum(np.exp(log_mass(p)), LEAST_SHARE)
    return BinModels(share, *complement(p), p.rho[:, None, None], noise_matrix(p))


@dataclass(frozen=True)
class HTGMoment(LearnedRandomMatrix):
    """Moment-matched update: z ~ (c + A mu_b, A C_b A^T) with the moments of the training data, (HTG.26).

    No hole and no pseudo-measurements: cheap, and the mean of the detections is no longer taken for the centre. The
    noise of the detections is the one that the table was learned with; `sigma` is for the association alone.
    """

    @guarded_update
    def update(self, state: RMState, scan: Scan) -> tuple[RMState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        table, s = self.model(), pseudo.sample_of(scan, self.sigma)
        m, P, nu, V = state
        count = np.maximum(s.n, 1)[..., None, None]
        root, new = sqrtm(pseudo.mean_extent(state)), state
        for _ in range(self.iterations):
            A = pseudo.body_axes(pseudo.mean_extent(new), new.m[..., PHI])  # (HTG.16)
            b = table.bin_at(new.m[..., :2], new.m[..., PHI], pseudo.length(A), s.sensor)
            S = P[..., :2, :2] + A @ table.cov[b] @ A.mT / count  # (HTG.27)
            eps = s.mean - (A @ table.mean[b][..., None])[..., 0] - m[..., :2]  # (HTG.27)
            K = P[..., :2] @ inverse(S)
            W = A @ whitening(table)[b] @ pseudo.inverse_axes(A)  # (HTG.27)
            B = root @ inverse_sqrtm(S)
            new = RMState(
                m=m + (K @ eps[..., None])[..., 0],  # (HTG.28)
                P=symmetrize(P - K @ P[..., :2, :]),  # (HTG.28)
                nu=nu + s.n,  # (HTG.28)
                V=symmetrize(V + B @ outer(eps) @ B.mT + W @ s.spread @ W.mT),  # (HTG.28)
            )
        m, P = self.rm.rates.correct(new.m, new.P, scan, scan.xy)  # (RR.4)
        return select(s.n > 0, new._replace(m=m, P=P), state), UpdateInfo(s.n, eps, S)


@lru_cache(maxsize=64)
def whitening(table: HTGTable) -> NDArray:
    """C_b^-1/2 (B, 2, 2) of the bins."""
    return inverse_sqrtm(table.cov)

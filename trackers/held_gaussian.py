"""Filters whose states hold N(m, P) in fields m and P, the centre first: methods that classes assign as theirs.

Where the state is that of `trackers.motion.turn`, x = [px, py, phi, v, omega], or has length and width, or their
logarithms, behind it: its moments from a prior, with another size, and as an estimate.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.filter import Gaussian
from trackers.geometry import unit, wrap_angle
from trackers.motion.turn import OMEGA, PHI, SPEED, cartesian_covariance, polar_moments

LENGTH, WIDTH = 5, 6


def gaussian(self: Any, state: Any) -> Gaussian:
    """Mean and covariance of the state."""
    return Gaussian(state.m, state.P)


def with_gaussian(self: Any, state: Any, gaussian: Gaussian) -> Any:
    """The state with another mean and covariance."""
    return state._replace(m=gaussian.m, P=gaussian.P)


def shift(self: Any, state: Any, d: NDArray) -> Any:
    """State with d (..., 2) [m] added to the centre."""
    m = state.m.copy()
    m[..., :2] += d
    return state._replace(m=m)


def prior_moments(estimate: Estimate, *size: NDArray) -> tuple[NDArray, NDArray]:
    """Mean (..., 5) and covariance (..., 5, 5) of a prior; with mean and std (..., 2) of s1 and s2, of 7 components."""
    v, P4 = polar_moments(estimate.velocity, estimate.cov, estimate.pose[..., 2], estimate.heading_std)
    m = np.concatenate([estimate.pose, v[..., None], estimate.yaw_rate[..., None], *size[:1]], -1)
    P = np.zeros((*m.shape, m.shape[-1]))
    P[..., :4, :4] = P4
    P[..., OMEGA, OMEGA] = estimate.yaw_rate_std**2
    if size:
        P[..., LENGTH, LENGTH], P[..., WIDTH, WIDTH] = size[1][..., 0] ** 2, size[1][..., 1] ** 2
    return m, P


def resized(m: NDArray, P: NDArray, size: NDArray, size_std: NDArray) -> tuple[NDArray, NDArray]:
    """Moments (..., 7), (..., 7, 7) with other s1 and s2 (..., 2) of standard deviation size_std (..., 2).

    Correlations of the size shrink with its standard deviation, as in a mean reversion, and never grow.
    """
    m, P = m.copy(), P.copy()
    m[..., LENGTH:] = size
    scale = np.ones(m.shape)
    scale[..., LENGTH:] = np.minimum(size_std / np.sqrt(P.diagonal(axis1=-2, axis2=-1)[..., LENGTH:]), 1.0)
    P *= scale[..., :, None] * scale[..., None, :]
    P[..., LENGTH, LENGTH], P[..., WIDTH, WIDTH] = size_std[..., 0] ** 2, size_std[..., 1] ** 2
    return m, P


def box_estimate(m: NDArray, P: NDArray, size: NDArray, size_std: NDArray) -> Estimate:
    """Box of size and size_std (..., 2) [m] along the heading of m (..., 5 or 7), with the motion of m and P."""
    variance = P.diagonal(axis1=-2, axis2=-1)
    return Estimate(
        pose=np.concatenate([m[..., :2], wrap_angle(m[..., PHI, None])], -1),
        velocity=m[..., SPEED, None] * unit(m[..., PHI]),
        yaw_rate=m[..., OMEGA].copy(),
        size=size,
        cov=cartesian_covariance(m[..., :LENGTH], P[..., :LENGTH, :LENGTH]),
        size_std=size_std,
        heading_std=np.sqrt(variance[..., PHI]),
        yaw_rate_std=np.sqrt(variance[..., OMEGA]),
    )

"""State of the filters on a spline: x = [px, py, phi, v, omega, l, w] and the contour of each object.

Equations: docs/methods/spline-pmht.md. Components in the order of `trackers.motion`; the paper has the speed before the
heading.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import to_world, unit, wrap_angle
from trackers.motion.turn import OMEGA, PHI, SPEED, cartesian_covariance, polar_moments
from trackers.unscented import root

LENGTH, WIDTH = 5, 6
N = 7
LEAST_SIZE = 0.3  # [m]


class SplineState(NamedTuple):
    """p(x) = N(x; m, P), and the contour in the unit frame."""

    m: NDArray  # (..., 7) px, py [m], phi [rad] unwrapped, v [m/s], omega [rad/s], l, w [m]
    P: NDArray  # (..., 7, 7)
    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)
    visible: NDArray  # (..., A, L) share of each ellipse in the lit outline from A directions, see `visibility.py`


def rotating_root(P: NDArray) -> NDArray:
    """Root T (..., 7, 7) of P = T T^T whose columns turn with the world.

    The position enters all models additively, so the order of x and y does not matter once they come last.
    """
    return root(P[..., ::-1, ::-1])[..., ::-1, :]  # (PMHT.7)


def moments_of(estimate: Estimate) -> tuple[NDArray, NDArray]:
    """Mean (..., 7) and covariance (..., 7, 7) of a prior."""
    heading = estimate.pose[..., 2]
    v, P4 = polar_moments(estimate.velocity, estimate.cov, heading, estimate.heading_std)
    m = np.concatenate([estimate.pose, v[..., None], estimate.yaw_rate[..., None], estimate.size], -1)
    P = np.zeros((*m.shape, N))
    P[..., :4, :4] = P4
    P[..., OMEGA, OMEGA] = estimate.yaw_rate_std**2
    P[..., LENGTH, LENGTH], P[..., WIDTH, WIDTH] = estimate.size_std[..., 0] ** 2, estimate.size_std[..., 1] ** 2
    return m, P


def estimate_of(m: NDArray, P: NDArray, outline: NDArray) -> Estimate:
    """Box along the heading from m (..., 7), P (..., 7, 7), with an outline (..., C, 2) in the unit frame."""
    pose = np.concatenate([m[..., :2], wrap_angle(m[..., PHI, None])], -1)
    size = m[..., LENGTH:].copy()
    variance = P.diagonal(axis1=-2, axis2=-1)
    return Estimate(
        pose=pose,
        velocity=m[..., SPEED, None] * unit(m[..., PHI]),
        yaw_rate=m[..., OMEGA].copy(),
        size=size,
        cov=cartesian_covariance(m[..., :LENGTH], P[..., :LENGTH, :LENGTH]),
        size_std=np.sqrt(variance[..., LENGTH:]),
        heading_std=np.sqrt(variance[..., PHI]),
        yaw_rate_std=np.sqrt(variance[..., OMEGA]),
        contour=to_world(pose, outline * size[..., None, :]),
    )


def resized(m: NDArray, P: NDArray, size: NDArray, size_std: NDArray) -> tuple[NDArray, NDArray]:
    """Moments with another size (..., 2) [m] of standard deviation size_std (..., 2) [m].

    Correlations of the size shrink with its standard deviation and never grow.
    """
    m, P = m.copy(), P.copy()
    m[..., LENGTH:] = size
    scale = np.ones(m.shape)
    scale[..., LENGTH:] = np.minimum(size_std / np.sqrt(P.diagonal(axis1=-2, axis2=-1)[..., LENGTH:]), 1.0)
    P *= scale[..., :, None] * scale[..., None, :]
    P[..., LENGTH, LENGTH], P[..., WIDTH, WIDTH] = size_std[..., 0] ** 2, size_std[..., 1] ** 2
    return m, P

"""The output of every tracker: pose, motion and size of objects; the same record is the prior that `init` takes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers.geometry import rotation


class Estimate(NamedTuple):
    """Estimates of objects with any leading axes; standard deviations are marginal."""

    pose: NDArray  # (..., 3) centre x, y [m], heading [rad]
    velocity: NDArray  # (..., 2) [m/s] of the centre
    yaw_rate: NDArray  # (...) [rad/s]
    size: NDArray  # (..., 2) length, width of the full box [m]
    cov: NDArray  # (..., 4, 4) of x, y, vx, vy
    size_std: NDArray  # (..., 2) [m]
    heading_std: NDArray  # (...) [rad]
    yaw_rate_std: NDArray  # (...) [rad/s]
    contour: NDArray | None = None  # (..., C, 2) [m] world frame; None where the method has no contour
    class_probability: NDArray | None = None  # (..., C) of the filter's `classes`; None where it has no catalogue
    edge_std: NDArray | None = None  # (..., 4) [m] of front, rear, left, right; None: centre and size are independent

    @property
    def speed(self) -> NDArray:
        """Speed (...) [m/s], negative when the object moves against its heading."""
        return self.velocity[..., 0] * np.cos(self.pose[..., 2]) + self.velocity[..., 1] * np.sin(self.pose[..., 2])

    @property
    def edges(self) -> NDArray:
        """Standard deviations (..., 4) [m] of front, rear, left and right edge, each across itself.

        A filter that states none has centre and size as independent: opposite edges are known alike.
        """
        if self.edge_std is not None:
            return self.edge_std
        M = rotation(self.pose[..., 2])
        centre = np.sum(M * (self.cov[..., :2, :2] @ M), -2)  # (..., 2) variances along the axes
        return np.sqrt(centre + self.size_std**2 / 4).repeat(2, -1)


def prior(
    pose: ArrayLike,
    velocity: ArrayLike = (0.0, 0.0),
    yaw_rate: ArrayLike = 0.0,
    size: ArrayLike = (4.6, 1.86),
    position_std: ArrayLike = 0.5,
    velocity_std: ArrayLike = 1.0,
    size_std: ArrayLike = (0.4, 0.1),
    heading_std: ArrayLike = 0.1,
    yaw_rate_std: ArrayLike = 0.1,
) -> Estimate:
    """An uncorrelated prior from a pose (..., 3); everything else broadcasts to its leading axes.

    >>> prior((10.0, 0.0, 0.0), velocity=(20.0, 0.0)).cov.shape
    (4, 4)
    """
    pose = np.asarray(pose, float)
    if pose.shape[-1:] != (3,):
        raise ValueError(f"pose must be (..., 3) x, y, heading, got {pose.shape}")
    lead = pose.shape[:-1]
    variance = np.concatenate(
        [np.broadcast_to(np.asarray(s, float)[..., None] ** 2, (*lead, 2)) for s in (position_std, velocity_std)],
        -1,
    )

    def spread(value: ArrayLike, *tail: int) -> NDArray:
        return np.broadcast_to(np.asarray(value, float), (*lead, *tail)).copy()

    return Estimate(
        pose=pose.copy(),
        velocity=spread(velocity, 2),
        yaw_rate=spread(yaw_rate),
        size=spread(size, 2),
        cov=variance[..., None] * np.eye(4),
        size_std=spread(size_std, 2),
        heading_std=spread(heading_std),
        yaw_rate_std=spread(yaw_rate_std),
    )


def check_estimate(estimate: Estimate) -> None:
    """Raise ValueError for a prior that no filter can start from."""
    for name in ("pose", "velocity", "yaw_rate", "size", "cov", "size_std", "heading_std", "yaw_rate_std"):
        if not np.isfinite(getattr(estimate, name)).all():
            raise ValueError(f"estimate.{name} must be finite, got {getattr(estimate, name)}")
    if (estimate.size <= 0).any():
        raise ValueError(
            f"estimate.size must be positive, got {estimate.size}; it is the full length and width in metres"
        )
    if (np.linalg.eigvalsh(estimate.cov) <= 0).any():
        raise ValueError(
            "estimate.cov must be positive definite; add a small variance to the state that is known exactly"
        )
    for name in ("size_std", "heading_std", "yaw_rate_std"):
        if (getattr(estimate, name) <= 0).any():
            raise ValueError(f"estimate.{name} must be positive, got {getattr(estimate, name)}")

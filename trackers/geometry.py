"""Planar geometry that every package stands on: angles, rotations, boxes and rigid motions.

Frames are right-handed in the mathematical sense: heading turns from x towards y. highway-env draws y downwards.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wrap_angle(angle: ArrayLike) -> NDArray:
    """Angle in [-pi, pi) [rad], any shape."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def vector(x: NDArray, y: NDArray) -> NDArray:
    """Plane vectors (..., 2) of their components (...); `np.stack` costs several times as much."""
    v = np.empty((*x.shape, 2))
    v[..., 0], v[..., 1] = x, y
    return v


def unit(angle: ArrayLike) -> NDArray:
    """Unit vectors (..., 2) along the angles (...) [rad]."""
    angle = np.asarray(angle, float)
    u = np.empty((*angle.shape, 2))
    u[..., 0], u[..., 1] = np.cos(angle), np.sin(angle)
    return u


def rotation(angle: ArrayLike) -> NDArray:
    """Counter-clockwise rotation matrices (..., 2, 2) of the angles (...) [rad]."""
    angle = np.asarray(angle, float)
    M = np.empty((*angle.shape, 2, 2))
    M[..., 0, 0] = M[..., 1, 1] = np.cos(angle)
    M[..., 1, 0] = np.sin(angle)
    M[..., 0, 1] = -M[..., 1, 0]
    return M


def perpendicular(v: NDArray) -> NDArray:
    """Vectors (..., 2) turned by +90 degrees."""
    turned = np.empty(v.shape)
    turned[..., 0], turned[..., 1] = -v[..., 1], v[..., 0]
    return turned


def dot(a: NDArray, b: NDArray) -> NDArray:
    """Scalar product (...) of plane vectors (..., 2); a sum over so short an axis costs several times as much."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def cross(a: NDArray, b: NDArray) -> NDArray:
    """The z component (...) of the cross product of plane vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def to_world(pose: NDArray, points: NDArray) -> NDArray:
    """Points (..., C, 2) [m] of the frame with pose (..., 3) x, y [m], heading [rad], in world coordinates."""
    return pose[..., None, :2] + points @ rotation(pose[..., 2]).mT


def to_frame(pose: NDArray, points: NDArray) -> NDArray:
    """World points (..., C, 2) [m] in the frame with pose (..., 3); the inverse of `to_world`."""
    return (points - pose[..., None, :2]) @ rotation(pose[..., 2])


def compose(world_from_a: NDArray, a_from_b: NDArray) -> NDArray:
    """Pose (..., 3) of frame b in the world, from the pose of a in the world and of b in a."""
    xy = world_from_a[..., :2] + (rotation(world_from_a[..., 2]) @ a_from_b[..., :2, None])[..., 0]
    return np.concatenate([xy, (world_from_a[..., 2] + a_from_b[..., 2])[..., None]], -1)


def point_velocity(velocity: NDArray, yaw_rate: NDArray, lever: NDArray) -> NDArray:
    """Velocity (..., 2) [m/s] of a point of a rigid body.

    velocity (..., 2) [m/s] of the reference point, yaw_rate (...) [rad/s], lever (..., 2) [m] from there to the point.
    """
    return velocity + np.asarray(yaw_rate)[..., None] * perpendicular(lever)


#        left
#    1 -------- 0
#    |  o-->    |  front     y to the left of the heading; corners counter-clockwise from front left
#    2 -------- 3
#        right
UNIT_BOX = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])


def box_corners(pose: NDArray, size: NDArray) -> NDArray:
    """Corners (..., 4, 2) [m] of boxes with pose (..., 3) and size (..., 2) length, width [m]."""
    return to_world(pose, UNIT_BOX * size[..., None, :])


def extent_matrix(heading: ArrayLike, size: NDArray) -> NDArray:
    """Extent matrices (..., 2, 2) [m^2] of boxes: M diag(l^2/4, w^2/4) M^T, docs/methods/random-matrices.md."""
    M = rotation(heading)
    return M @ ((size**2 / 4)[..., None] * M.mT)  # (RM.3)


def ellipse_points(centre: NDArray, X: NDArray, count: int = 25) -> NDArray:
    """Closed outlines (..., count, 2) of the ellipses (z - c)^T X^-1 (z - c) = 1; centre (..., 2), X (..., 2, 2)."""
    root = np.linalg.cholesky(X)
    return centre[..., None, :] + unit(np.linspace(0, 2 * np.pi, count)) @ root.mT

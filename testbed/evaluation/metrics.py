"""How far an estimate is from the truth: pure functions of arrays.

Definitions, equations and references: docs/methods/metrics.md. Published codes disagree on the Gaussian Wasserstein
distance: some print its square under the same name. Here `gaussian_wasserstein` and `gwd2` are squared [m^2], `gwd` is
rooted [m]. A box of length l and width w stands for the ellipse with extent matrix M diag(l^2/4, w^2/4) M^T, (MET.1).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv

from trackers.geometry import box_corners, extent_matrix
from trackers.linalg import quadratic, sqrtm

CUTOFF = 5.0  # [m] GOSPA's c, compared with the rooted distance


def gaussian_wasserstein(p: NDArray, X: NDArray, q: NDArray, Y: NDArray) -> NDArray:
    """Squared Gaussian Wasserstein distance (...) [m^2] of two ellipses, Xia et al. (2020), eq. (16).

    Centres p, q (..., 2) [m]; extents X, Y (..., 2, 2) [m^2], a box being diag(l^2/4, w^2/4). Metric of Givens and
    Shortt (1984).

    >>> float(gaussian_wasserstein(np.zeros(2), np.eye(2), np.array([3.0, 4.0]), 4 * np.eye(2)))
    27.0
    """
    root = sqrtm(X)
    cross_term = sqrtm(root @ Y @ root)
    rest = X + Y - 2 * cross_term
    shape = rest[..., 0, 0] + rest[..., 1, 1]  # the trace
    return ((p - q) ** 2).sum(-1) + np.maximum(shape, 0.0)  # (MET.2); of equal extents rounding may fall below zero


def gwd2(pose: NDArray, size: NDArray, other_pose: NDArray, other_size: NDArray) -> NDArray:
    """Squared Gaussian Wasserstein distance (...) [m^2] of boxes with pose (..., 3) and size (..., 2)."""
    X, Y = extent_matrix(pose[..., 2], size), extent_matrix(other_pose[..., 2], other_size)
    return gaussian_wasserstein(pose[..., :2], X, other_pose[..., :2], Y)


def gwd(pose: NDArray, size: NDArray, other_pose: NDArray, other_size: NDArray) -> NDArray:
    """Rooted Gaussian Wasserstein distance (...) [m] of boxes: the square root of `gwd2`."""
    return np.sqrt(gwd2(pose, size, other_pose, other_size))  # (MET.3)


def box_iou(pose: NDArray, size: NDArray, other_pose: NDArray, other_size: NDArray) -> NDArray:
    """Intersection over union (...) in [0, 1] of oriented boxes with pose (..., 3) and size (..., 2)."""
    return region_iou(box_areas(pose, size), box_areas(other_pose, other_size))


def contour_iou(outline: NDArray, other: NDArray) -> NDArray:
    """Intersection over union (...) in [0, 1] of the areas inside outlines (..., C, 2) and (..., D, 2) [m]."""
    return region_iou(areas(outline), areas(other))


def region_iou(a: NDArray, b: NDArray) -> NDArray:
    """Intersection over union (...) of arrays (...) of shapely polygons."""
    common = shapely.area(shapely.intersection(a, b))
    return common / (shapely.area(a) + shapely.area(b) - common)  # (MET.4)


def box_areas(pose: NDArray, size: NDArray) -> NDArray:
    """Shapely polygons (...) of oriented boxes with pose (..., 3) and size (..., 2) [m], which are always valid."""
    return np.asarray(shapely.polygons(_finite(box_corners(pose, size))))


def areas(outline: NDArray) -> NDArray:
    """Shapely polygons (...) of outlines (..., C, 2) [m]; one that crosses itself has its even-odd inside."""
    return _valid(np.asarray(shapely.polygons(_finite(outline))))


def ragged_areas(outlines: Sequence[NDArray]) -> NDArray:
    """The same (B,) of B outlines (C, 2) [m], each with its own C."""
    owner = np.repeat(np.arange(len(outlines)), [len(outline) for outline in outlines])
    return _valid(shapely.polygons(shapely.linearrings(np.concatenate(outlines), indices=owner)))


def _finite(outline: NDArray) -> NDArray:
    if not np.isfinite(outline).all():
        raise ValueError("outline must be finite to have an area; leave out estimates without a contour")
    return outline


def _valid(areas: NDArray) -> NDArray:
    valid = shapely.is_valid(areas)
    return areas if valid.all() else np.where(valid, areas, shapely.make_valid(areas))


class Gospa(NamedTuple):
    """GOSPA of one scan and its parts: total^2 = localisation + missed + false, (MET.7)."""

    total: float  # [m], rooted
    localisation: float  # [m^2] sum of d^2 over counted pairs
    missed: float  # [m^2] c^2/2 for each counted truth without a track
    false: float  # [m^2] c^2/2 for each track without an object
    pairs: NDArray  # (K, 2) int, row and column of every pair, those with uncounted truths included


def gospa(distance: NDArray, counted: NDArray | None = None, cutoff: float = CUTOFF) -> Gospa:
    """Generalized optimal sub-pattern assignment with p = 2, alpha = 2, Rahmathullah et al. (2017).

    distance (N, T) [m] of N truths and T tracks, ROOTED (`gwd`), as it is compared with the cut-off c. counted (N,)
    bool, all by default: a truth that is not counted takes part in the assignment, so that a track on it is not false,
    but neither that pair nor its lack costs anything.

    Raises:
        ValueError: distance is not (N, T), finite and at least 0, or counted is not (N,).

    >>> round(gospa(np.array([[3.0], [9.0]])).total, 3)    # a pair at 3 m and a missed truth: sqrt(9 + 12.5)
    4.637
    """
    distance = np.asarray(distance, float)
    if distance.ndim != 2:
        raise ValueError(f"distance must be (N, T), got {distance.shape}; one scan at a time")
    bad = int((~np.isfinite(distance) | (distance < 0)).sum())
    if bad:
        raise ValueError(f"distance must be finite and not negative, {bad} are not; is an estimate NaN?")
    from scipy.optimize import linear_sum_assignment  # not at the top: a third of the start of a run without metrics

    N, T = distance.shape
    counted = np.ones(N, bool) if counted is None else np.asarray(counted, bool)
    if counted.shape != (N,):
        raise ValueError(f"counted must be ({N},) like the rows of distance, got {counted.shape}")
    rows, columns = linear_sum_assignment(np.minimum(distance, cutoff) ** 2)  # (MET.6)
    close = distance[rows, columns] < cutoff  # a pair at the cut-off costs what two singles cost
    rows, columns = rows[close], columns[close]
    costs = counted[rows]
    localisation = float((distance[rows, columns][costs] ** 2).sum())  # (MET.7)
    missed = cutoff**2 / 2 * int(counted.sum() - costs.sum())  # (MET.7)
    false = cutoff**2 / 2 * (T - len(columns))  # (MET.7)
    total = float(np.sqrt(localisation + missed + false))  # (MET.5)
    return Gospa(total, localisation, missed, false, np.stack([rows, columns], -1))


def nees(error: NDArray, cov: NDArray) -> NDArray:
    """Normalised estimation error squared (...), Bar-Shalom, Li and Kirubarajan (2001), section 5.4.2.

    error (..., n), cov (..., n, n): chi-square with n degrees of freedom if the errors have that covariance. Raises
    ValueError for a cov that is not positive definite.
    """
    try:
        np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:
        raise ValueError("cov must be positive definite; give a small variance to what is known exactly") from None
    return quadratic(error, cov)  # (MET.11)


def nees_bounds(dof: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided chi-square bounds on the mean of `count` independent NEES values of `dof` degrees of freedom.

    Errors of one run are correlated in time: there the true interval is wider.
    """
    if count < 1:
        return np.nan, np.nan
    tails = np.array([(1 - level) / 2, (1 + level) / 2])
    low, high = 2 * gammaincinv(dof * count / 2, tails) / count  # (MET.12), the quantile function of chi-square
    return float(low), float(high)


def rmse(error: ArrayLike) -> float:
    """Root of the mean square of scalar errors (...) [their unit], NaN of none."""
    error = np.asarray(error, float)
    return float(np.sqrt(np.mean(error**2))) if error.size else np.nan  # (MET.10)


def mean(value: ArrayLike) -> float:
    """Arithmetic mean, NaN of none and without a warning."""
    value = np.asarray(value, float)
    return float(value.mean()) if value.size else np.nan

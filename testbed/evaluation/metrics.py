"""How far an estimate is from the truth: pure functions of arrays, each with its source.

Published codes disagree on the Gaussian Wasserstein distance: some print its square under the same name. Here
`gaussian_wasserstein` and `gwd2` are squared [m^2], `gwd` is rooted [m]. A box of length l and width w stands for the
ellipse with extent matrix M diag(l^2/4, w^2/4) M^T, card htg_rm section 6.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from trackers.geometry import box_corners, extent_matrix
from trackers.linalg import quadratic, sqrtm

CUTOFF = 5.0  # [m] GOSPA's c over the rooted distance, card multi_object section 7


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
    return ((p - q) ** 2).sum(-1) + np.maximum(shape, 0.0)  # equal extents: rounding may fall below zero


def gwd2(pose: NDArray, size: NDArray, other_pose: NDArray, other_size: NDArray) -> NDArray:
    """Squared Gaussian Wasserstein distance (...) [m^2] of boxes with pose (..., 3) and size (..., 2)."""
    X, Y = extent_matrix(pose[..., 2], size), extent_matrix(other_pose[..., 2], other_size)
    return gaussian_wasserstein(pose[..., :2], X, other_pose[..., :2], Y)


def gwd(pose: NDArray, size: NDArray, other_pose: NDArray, other_size: NDArray) -> NDArray:
    """Rooted Gaussian Wasserstein distance (...) [m] of boxes: the square root of `gwd2`."""
    return np.sqrt(gwd2(pose, size, other_pose, other_size))


def box_iou(pose: NDArray, size: NDArray, other_pose: NDArray, other_size: NDArray) -> NDArray:
    """Intersection over union (...) in [0, 1] of oriented boxes with pose (..., 3) and size (..., 2)."""
    return region_iou(box_areas(pose, size), box_areas(other_pose, other_size))


def contour_iou(outline: NDArray, other: NDArray) -> NDArray:
    """Intersection over union (...) in [0, 1] of the areas inside outlines (..., C, 2) and (..., D, 2) [m]."""
    return region_iou(areas(outline), areas(other))


def region_iou(a: NDArray, b: NDArray) -> NDArray:
    """Intersection over union (...) of arrays (...) of shapely areas."""
    common = shapely.area(shapely.intersection(a, b))
    return common / (shapely.area(a) + shapely.area(b) - common)


def box_areas(pose: NDArray, size: NDArray) -> NDArray:
    """Shapely areas (...) of oriented boxes with pose (..., 3) and size (..., 2) [m], which never cross themselves."""
    return np.asarray(shapely.polygons(_finite(box_corners(pose, size))))


def areas(outline: NDArray) -> NDArray:
    """Shapely areas (...) inside outlines (..., C, 2) [m]; one that crosses itself counts its even-odd inside."""
    return _valid(np.asarray(shapely.polygons(_finite(outline))))


def ragged_areas(outlines: Sequence[NDArray]) -> NDArray:
    """The same (B,) of B outlines (C, 2) [m] with a C of their own."""
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
    """GOSPA of one scan and the parts it is made of: total^2 = localisation + missed + false."""

    total: float  # [m], rooted
    localisation: float  # [m^2] sum of d^2 over counted pairs
    missed: float  # [m^2] c^2/2 for each counted truth without a track
    false: float  # [m^2] c^2/2 for each track without an object
    pairs: NDArray  # (K, 2) int, row and column of every pair, those with uncounted truths included


def gospa(distance: NDArray, counted: NDArray | None = None, cutoff: float = CUTOFF) -> Gospa:
    """Generalized optimal sub-pattern assignment with p = 2, alpha = 2, Rahmathullah et al. (2017).

    distance (N, T) [m] of N truths and T tracks, ROOTED (`gwd`), as it is compared with the cut-off c. counted (N,):
    false for a truth that nobody can be asked to see; it takes part in the assignment, so that a track on it is not
    false, and then neither the pair nor the lack of one costs anything (card multi_object section 7).

    >>> round(gospa(np.array([[3.0], [9.0]])).total, 3)    # a pair at 3 m and a missed truth: sqrt(9 + 12.5)
    4.637
    """
    distance = np.asarray(distance, float)
    if distance.ndim != 2:
        raise ValueError(f"distance must be (N, T), got {distance.shape}; one scan at a time")
    bad = int((~np.isfinite(distance) | (distance < 0)).sum())
    if bad:
        raise ValueError(f"distance must be finite and not negative, {bad} are not; is an estimate NaN?")
    N, T = distance.shape
    counted = np.ones(N, bool) if counted is None else np.asarray(counted, bool)
    if counted.shape != (N,):
        raise ValueError(f"counted must be ({N},) like the rows of distance, got {counted.shape}")
    rows, columns = linear_sum_assignment(np.minimum(distance, cutoff) ** 2)
    close = distance[rows, columns] < cutoff  # a pair at the cut-off costs what two singles cost
    rows, columns = rows[close], columns[close]
    cares = counted[rows]
    localisation = float((distance[rows, columns][cares] ** 2).sum())
    missed = cutoff**2 / 2 * int(counted.sum() - cares.sum())
    false = cutoff**2 / 2 * (T - len(columns))
    total = float(np.sqrt(localisation + missed + false))
    return Gospa(total, localisation, missed, false, np.stack([rows, columns], -1))


def nees(error: NDArray, cov: NDArray) -> NDArray:
    """Normalised estimation error squared (...), Bar-Shalom, Li and Kirubarajan (2001), section 5.4.2.

    error (..., n), cov (..., n, n): chi-square with n degrees of freedom when the covariance tells the truth.
    """
    try:
        np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:
        message = "cov must be positive definite; give a small variance to what is known exactly"
        raise ValueError(message) from None
    return quadratic(error, cov)


def nees_bounds(dof: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided chi-square bounds on the mean of `count` independent NEES values of `dof` degrees of freedom.

    Errors of one run are correlated in time: there the true interval is wider.
    """
    if count < 1:
        return np.nan, np.nan
    low, high = chi2.ppf([(1 - level) / 2, (1 + level) / 2], dof * count) / count
    return float(low), float(high)


def rmse(error: ArrayLike) -> float:
    """Root of the mean square of scalar errors (...) [their unit], NaN of none."""
    error = np.asarray(error, float)
    return float(np.sqrt(np.mean(error**2))) if error.size else np.nan


def mean(value: ArrayLike) -> float:
    """Arithmetic mean, NaN of none and without a warning."""
    value = np.asarray(value, float)
    return float(value.mean()) if value.size else np.nan

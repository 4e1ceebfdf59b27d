"""Unscented Rauch-Tung-Striebel smoother for every filter whose state holds a Gaussian: what was, given all that came.

Symbols and equations: card bspline_pmht, section 7, after Yao et al. (2021). The filters need nothing but their
`predict`: it gives the predicted moments, and its values at sigma points the cross covariance D.

Extents of random matrices are smoothed by a rule of ours. Their prediction forgets: it keeps a share of the
information, nu' - 6 = share (nu - 6), V' = share V. A filter that ran backwards would forget just so, and its
information would be added to the filter's: at each step the extent has seen every detection, past or future, with the
weight share^(steps away). So nu_s = nu + share (nu_s+ - nu'), V_s = V + share (V_s+ - V'), turned back. Where more than
the filter works on the size, such as a size prior between prediction and update, the extent stays the filter's: the
prior would have to be renewed on the way back, or biased detections outweigh it.

Sizes that are part of the Gaussian (htg-map, dra) are smoothed with it. The contour of rm-vmm keeps its size and moves
with its centre.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers import unscented
from trackers.batch import concatenate, stack, take
from trackers.geometry import rotation, wrap_angle
from trackers.imm import moments
from trackers.linalg import symmetrize
from trackers.protocols import Extent, Gaussian, Interacting, Smoothable, SmoothableExtent

T = TypeVar("T", bound=tuple)
Between = Callable[[Any, float], Any]  # predicted state, dt [s] -> what the update started from


class Predicted(NamedTuple):
    """Steps 1 to K - 1 as predicted from the ones before."""

    state: Any  # (K - 1, ...)
    start: Gaussian  # (K - 1, ...) of the steps before, as the prediction took them
    cov: NDArray  # (K - 1, ..., n, n) of what the prediction makes of them, without process noise
    D: NDArray  # (K - 1, ..., n, n) cross covariances of the two


def smooth(filter: Any, states: Sequence[T], dt: ArrayLike, between: Between | None = None) -> list[T]:
    """The states after each update given the detections of all updates; the last one is as it came.

    Args:
        filter: that made the states.
        states: after each update, in the order of time, with the same leading axes; a look without detections is a
            state that is as predicted, or one that is left out.
        dt: [s] between them, one number or one less than there are states.
        between: what was done to a prediction before its update, where something was.

    Raises:
        TypeError: the filter is not `Smoothable`.
        ValueError: there is no state, or times and states do not fit together.

    Interacting models come back as the moments of their mixture, the same in every model.
    """
    if len(states) == 0:
        raise ValueError("states must be at least one state, got none; smooth what was updated once or more")
    smoothed = smooth_stacked(filter, stack(states), dt, between)
    return [take(smoothed, np.asarray(k)) for k in range(len(states))]


def smooth_stacked(filter: Any, states: T, dt: ArrayLike, between: Between | None = None) -> T:
    """`smooth` for K states stacked along a new first axis."""
    if not isinstance(filter, Smoothable):
        raise TypeError(
            f"{type(filter).__name__} must have angles, gaussian and with_gaussian to be smoothed; "
            "see trackers.protocols.Smoothable"
        )
    m, P = filter.gaussian(states)
    if len(m) == 0:
        raise ValueError("states must be at least one state, got none; smooth what was updated once or more")
    steps = np.asarray(dt, float)
    if steps.shape not in ((), (len(m) - 1,)):
        raise ValueError(f"dt must be one number or {len(m) - 1} for {len(m)} states, got shape {steps.shape}")
    if len(m) == 1:
        return states
    predicted = predict_all(filter, states, np.broadcast_to(steps, len(m) - 1), between)
    start, (m_pred, P_pred) = predicted.start, filter.gaussian(predicted.state)
    updated = (np.concatenate([start.m, m[-1:]]), np.concatenate([start.P, P[-1:]]))
    # A covariance below that of the state itself, from a linearisation or from `between`, would pass too much back.
    consistent = P_pred + positive_part(predicted.cov - P_pred)
    D = predicted.D @ np.linalg.solve(consistent, P_pred)
    previous = [np.concatenate([a[:1], a]) for a in (m_pred, P_pred, D)]
    ms, Ps = smooth_moments(*updated, previous[0], previous[1], previous[2], filter.angles)
    smoothed = filter.with_gaussian(states, Gaussian(ms, Ps))
    if not isinstance(filter, SmoothableExtent) or between is not None:
        return smoothed
    return filter.with_extent(smoothed, smooth_extents(filter.extent(states), filter.extent(predicted.state)))


def smooth_moments(
    m: NDArray, P: NDArray, m_pred: NDArray, P_pred: NDArray, D: NDArray, angles: tuple[int, ...] = ()
) -> tuple[NDArray, NDArray]:
    """Means (K, ..., n) and covariances (K, ..., n, n) given all K steps, from the last step backwards.

    Args:
        m: (K, ..., n) means after the update of each step.
        P: (K, ..., n, n) their covariances.
        m_pred: (K, ..., n) means predicted for each step from the one before; the first is not used.
        P_pred: (K, ..., n, n) their covariances, process noise included.
        D: (K, ..., n, n) cross covariances between the step before (rows) and the step; the first is not used.
        angles: components [rad] that may be wrapped; without, they are taken as they are.

    """
    ms, Ps = m.copy(), P.copy()
    if len(m) > 1:
        G = np.linalg.solve(P_pred[1:], D[1:].mT).mT  # D P_pred^-1
    for k in range(len(m) - 2, -1, -1):
        d = ms[k + 1] - m_pred[k + 1]
        for a in angles:
            d[..., a] = wrap_angle(d[..., a])
        ms[k] = m[k] + (G[k] @ d[..., None])[..., 0]  # (12)
        Ps[k] = symmetrize(P[k] + G[k] @ (Ps[k + 1] - P_pred[k + 1]) @ G[k].mT)  # (13)
    return ms, Ps


def smooth_extents(extent: Extent, predicted: Extent) -> Extent:
    """Extents (K, ...) given all K steps, from those after each update and those predicted for steps 1 to K - 1.

    Where a step knows less than was predicted for it (a size that was set anew), nothing is passed back.
    """
    nu, V, least = extent.nu.copy(), extent.V.copy(), extent.least
    share = np.clip((predicted.nu - least) / (nu[:-1] - least), 0.0, 1.0)
    back = rotation(-(predicted.heading - extent.heading[:-1]))
    for k in range(len(nu) - 2, -1, -1):
        more = nu[k + 1] - predicted.nu[k]
        passed = np.where(more > 0, share[k], 0.0)
        nu[k] = nu[k] + passed * more
        V[k] = V[k] + passed[..., None, None] * back[k] @ positive_part(V[k + 1] - predicted.V[k]) @ back[k].mT
    return extent._replace(nu=nu, V=V)


def positive_part(A: NDArray) -> NDArray:
    """Symmetric A (..., n, n) without its negative eigenvalues."""
    value, vector = np.linalg.eigh(symmetrize(A))
    return (vector * np.maximum(value, 0.0)[..., None, :]) @ vector.mT


def predict_all(filter: Any, states: Any, dt: NDArray, between: Between | None) -> Predicted:
    """All K - 1 predictions of K states, together where dt (K - 1,) [s] is the same."""
    order, found = [], []
    for value in np.unique(dt):
        rows = np.flatnonzero(dt == value)
        order.append(rows)
        found.append(predict_some(filter, take(states, rows), float(value), between))
    rows = np.argsort(np.concatenate(order))
    return take(concatenate(found), rows)


def predict_some(filter: Any, state: Any, dt: float, between: Between | None) -> Predicted:
    """States (N, ...) predicted over dt [s], with what the smoother asks of them."""

    def predict(one: Any, old: Any) -> Any:
        new = one.predict(old, dt)
        return between(new, dt) if between is not None and type(new) is type(state) else new

    mixed = filter.mixed(state, dt) if isinstance(filter, Interacting) else None
    if mixed is not None:
        start, cov, D = mixture_pair(mixed, filter.angles, predict)
    else:
        moved = unscented_prediction(filter, partial(predict, filter), state)
        start, cov, D = filter.gaussian(state), moved.cov, moved.D
    return Predicted(predict(filter, state), start, cov, D)


def unscented_prediction(filter: Smoothable, predict: Callable[[Any], Any], state: Any) -> unscented.Transformed:
    """Moments of the predicted mean, without process noise, and its cross covariance (..., n, n) with the mean."""
    g = filter.gaussian(state)
    X = unscented.sigma_points(g.m, g.P)  # (..., S, n)
    first = np.moveaxis(X, -2, 0)
    many = stack([state] * len(first))
    many = filter.with_gaussian(many, Gaussian(first, np.broadcast_to(g.P, (len(first), *g.P.shape))))
    Y = np.moveaxis(filter.gaussian(predict(many)).m, 0, -2)
    return unscented.moments(X, Y, angles=filter.angles)


def mixture_pair(
    mixed: tuple[NDArray, list[tuple[Smoothable, Any]]],
    angles: tuple[int, ...],
    predict: Callable[[Any, Any], Any],
) -> tuple[Gaussian, NDArray, NDArray]:
    """Moments of mixtures as their prediction takes them, and what follows in `Predicted`.

    A state and the next one are a mixture over the next model, whose moments are exact; to take the pair for Gaussian
    gives the best linear smoother. Mixing may change the moments: a model that lacks a component says nothing of it.
    """
    c, models = mixed
    starts, ends = [], []
    for one, start in models:
        starts.append(one.gaussian(start))
        ends.append(unscented_prediction(one, partial(predict, one), start))
    m, P = (np.stack(a, axis) for a, axis in zip(zip(*starts, strict=True), (-2, -3), strict=True))
    mean, cov, D = (np.stack(a, axis) for a, axis in zip(zip(*ends, strict=True), (-2, -3, -3), strict=True))
    spread = _deviation(m, c, angles)[..., :, None] * _deviation(mean, c, angles)[..., None, :]
    pair = (c[..., None, None] * (D + spread)).sum(-3)
    return Gaussian(*moments(m, P, c, angles)), moments(mean, cov, c, angles)[1], pair


def _deviation(means: NDArray, c: NDArray, angles: tuple[int, ...]) -> NDArray:
    """Means (..., K, n) minus their mean under c (..., K)."""
    d = means - means[..., :1, :]
    for a in angles:
        d[..., a] = wrap_angle(d[..., a])
    return d - (c[..., None] * d).sum(-2, keepdims=True)

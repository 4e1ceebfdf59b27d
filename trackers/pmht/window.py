"""The last looks at an object, for the smoother, and its detections in the frame of the body; card bspline_pmht, 7, 8.

Only smoothed means are asked for, so of each look the window keeps the gain G = D P_pred^-1 (12) and two means.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation, wrap_angle
from trackers.motion import PHI
from trackers.pmht.association import Seen
from trackers.pmht.state import LENGTH, N
from trackers.pmht.symmetric import congruence


class Window(NamedTuple):
    """A ring of K looks with up to M detections each; looks counts all that came since it was cleared."""

    m: NDArray  # (..., K, 7) after the update
    m_pred: NDArray  # (..., K, 7) before it
    G: NDArray  # (..., K, 7, 7) smoother gain from the look before
    z: NDArray  # (..., K, M, 2) [m] detections
    R: NDArray  # (..., K, M, 3) [m^2] their noise, as columns xx, xy, yy
    sensor: NDArray  # (..., K, M, 2) [m] where each was seen from
    mask: NDArray  # (..., K, M)
    looks: NDArray  # (...) int
    time: NDArray  # (...) [s] since it was cleared

    @property
    def detections(self) -> NDArray:
        """How many it holds (...)."""
        return self.mask.sum((-1, -2))


class Decoupled(NamedTuple):
    """Detections without the motion of the object, (14)."""

    z: NDArray  # (..., D, 2) in the unit frame
    R: NDArray  # (..., D, 3) their noise there
    sensor: NDArray  # (..., D, 2) [m] where each was seen from, in the frame of the body
    mask: NDArray  # (..., D)


def empty(lead: tuple[int, ...], K: int, M: int) -> Window:
    """No look yet."""
    return Window(
        np.zeros((*lead, K, N)),
        np.zeros((*lead, K, N)),
        np.zeros((*lead, K, N, N)),
        np.zeros((*lead, K, M, 2)),
        np.zeros((*lead, K, M, 3)),
        np.zeros((*lead, K, M, 2)),
        np.zeros((*lead, K, M), bool),
        np.zeros(lead, int),
        np.zeros(lead),
    )


def cleared(window: Window, where: NDArray) -> Window:
    """The window without its looks where (...) is true; what lies in the arrays does not matter there."""
    keep = ~where
    return window._replace(mask=window.mask & keep[..., None, None], looks=window.looks * keep, time=window.time * keep)


def record(
    window: Window, m: NDArray, m_pred: NDArray, G: NDArray, seen: Seen, sensor: NDArray, where: NDArray
) -> Window:
    """The window with one more look, where (...) is true.

    seen are detections relative to m_pred (..., 7), sensor (..., M or 1, 2) [m] their sensors in the world.
    """
    K, M = window.mask.shape[-2:]
    pick = thinned(seen, M, m_pred[..., PHI])
    there = np.arange(M) < seen.mask.sum(-1, keepdims=True)

    def chosen(a: NDArray) -> NDArray:
        a = np.broadcast_to(a, (*seen.mask.shape, a.shape[-1]))
        return np.where(there[..., None], np.take_along_axis(a, pick[..., None], -2), 0.0)

    rows = {
        "m": m,
        "m_pred": m_pred,
        "G": G,
        "z": chosen(seen.z.mT + m_pred[..., None, :2]),
        "R": chosen(seen.R.mT),
        "sensor": chosen(sensor),
        "mask": there,
    }
    at = (np.arange(K) == (window.looks % K)[..., None]) & where[..., None]  # (..., K)
    new = {name: written(getattr(window, name), row, at) for name, row in rows.items()}
    return window._replace(**new, looks=window.looks + where)


def written(ring: NDArray, row: NDArray, at: NDArray) -> NDArray:
    """A copy of ring (..., K, ...) with row (..., ...) where `at` (..., K) is true."""
    ring = ring.copy()
    ring[at] = row[at.any(-1)]
    return ring


def thinned(seen: Seen, M: int, heading: NDArray) -> NDArray:
    """Indices (..., M) of detections: all of few, spread over the angle to the heading (...) [rad] of many."""
    count = seen.mask.shape[-1]
    angle = wrap_angle(np.arctan2(seen.z[..., 1, :], seen.z[..., 0, :]) - heading[..., None])
    angle = np.where(seen.mask, angle, np.inf)
    order = np.argsort(angle, -1, kind="stable")
    if count < M:
        order = np.concatenate([order, np.broadcast_to(order[..., -1:], (*order.shape[:-1], M - count))], -1)
        return order
    n = seen.mask.sum(-1, keepdims=True)
    step = np.maximum(n, M) / M
    return np.take_along_axis(order, np.minimum(np.arange(M) * step, count - 1).astype(int), -1)


def smoothed(window: Window) -> NDArray:
    """Means (..., K, 7) given all looks of the window (12), in the order of the ring."""
    K = window.m.shape[-2]
    count = np.minimum(window.looks, K)
    order = (window.looks[..., None] - count[..., None] + np.arange(K)) % K  # oldest first; padding wraps around
    m, m_pred = (np.take_along_axis(a, order[..., None], -2) for a in (window.m, window.m_pred))
    G = np.take_along_axis(window.G, order[..., None, None], -3)
    for k in range(K - 2, -1, -1):
        step = (G[..., k + 1, :, :] @ (m[..., k + 1, :] - m_pred[..., k + 1, :])[..., None])[..., 0]
        m[..., k, :] += np.where((k + 1 < count)[..., None], step, 0.0)
    out = np.empty(m.shape)
    np.put_along_axis(out, order[..., None], m, -2)
    return out


def in_body(m: NDArray, xy: NDArray, R: NDArray, sensor: NDArray, mask: NDArray) -> Decoupled:
    """Detections (..., M) as bodies with states m (..., 7) have them.

    xy (..., M, 2) [m], R (..., M or 1, 3) [m^2] as columns, sensor (..., M or 1, 2) [m], all in the world.
    """
    A = rotation(m[..., PHI])
    size = np.maximum(m[..., LENGTH:], 1e-3)
    z = (xy - m[..., None, :2]) @ A / size[..., None, :]
    into = congruence((A / size[..., None, :]).mT)
    toward = np.broadcast_to((sensor - m[..., None, :2]) @ A, z.shape)
    return Decoupled(z, np.broadcast_to(R @ into.mT, (*z.shape[:-1], 3)), toward, mask)


def decouple(window: Window) -> Decoupled:
    """The detections of the window in the frame of the smoothed body (14), all in one row."""
    body = in_body(smoothed(window), window.z, window.R, window.sensor, window.mask)
    lead = window.mask.shape[:-2]
    return Decoupled(*(a.reshape(*lead, -1, *a.shape[len(lead) + 2 :]) for a in body))

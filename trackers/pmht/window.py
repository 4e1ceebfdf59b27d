"""The last scans of an object for the smoother, and its detections in the frame of the body.

Equations: docs/methods/smoothing.md and docs/methods/spline-pmht.md. Only smoothed means are needed, so of each scan
the window keeps the smoother gain into it and two means.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation, wrap_angle
from trackers.held_gaussian import LENGTH
from trackers.motion.turn import PHI
from trackers.pmht.association import RelativeDetections, congruence
from trackers.pmht.state import N


class Window(NamedTuple):
    """A ring of the last K scans with detections, up to M detections each."""

    m: NDArray  # (..., K, 7) after the update
    m_pred: NDArray  # (..., K, 7) before it
    G: NDArray  # (..., K, 7, 7) smoother gain from the scan before
    z: NDArray  # (..., K, M, 2) [m] detections
    R: NDArray  # (..., K, M, 3) [m^2] their noise, as columns xx, xy, yy
    sensor: NDArray  # (..., K, M, 2) [m] where each was seen from
    mask: NDArray  # (..., K, M)
    scans: NDArray  # (...) int, recorded since it was cleared, more than K where old ones were overwritten
    time: NDArray  # (...) [s] since it was cleared

    @property
    def detections(self) -> NDArray:
        """Number of detections that it holds (...)."""
        return self.mask.sum((-1, -2))


class Decoupled(NamedTuple):
    """Detections without the motion of the object, (PMHT.29)."""

    z: NDArray  # (..., D, 2) in the unit frame
    R: NDArray  # (..., D, 3) their noise there
    sensor: NDArray  # (..., D, 2) [m] where each was seen from, in the frame of the body
    mask: NDArray  # (..., D)


def empty(lead: tuple[int, ...], K: int, M: int) -> Window:
    """Windows without a scan."""
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
    """The window without its scans where (...) is true; the other arrays keep values that are not used."""
    keep = ~where
    return window._replace(mask=window.mask & keep[..., None, None], scans=window.scans * keep, time=window.time * keep)


def record(
    window: Window,
    m: NDArray,
    m_pred: NDArray,
    G: NDArray,
    detections: RelativeDetections,
    sensor: NDArray,
    where: NDArray,
) -> Window:
    """The window with one more scan, where (...) is true.

    m, m_pred (..., 7) after and before the update, G (..., 7, 7) gain (SM.9); detections relative to m_pred, and the
    places of their sensors (..., M or 1, 2) [m] in the world.
    """
    K, M = window.mask.shape[-2:]
    pick = thinned(detections, M, m_pred[..., PHI])
    there = np.arange(M) < detections.mask.sum(-1, keepdims=True)

    def chosen(a: NDArray) -> NDArray:
        a = np.broadcast_to(a, (*detections.mask.shape, a.shape[-1]))
        return np.where(there[..., None], np.take_along_axis(a, pick[..., None], -2), 0.0)

    rows = {
        "m": m,
        "m_pred": m_pred,
        "G": G,
        "z": chosen(detections.z.mT + m_pred[..., None, :2]),
        "R": chosen(detections.R.mT),
        "sensor": chosen(sensor),
        "mask": there,
    }
    at = (np.arange(K) == (window.scans % K)[..., None]) & where[..., None]  # (..., K)
    new = {name: written(getattr(window, name), row, at) for name, row in rows.items()}
    return window._replace(**new, scans=window.scans + where)


def written(ring: NDArray, row: NDArray, at: NDArray) -> NDArray:
    """A copy of ring (..., K, ...) with row (..., ...) where `at` (..., K) is true."""
    ring = ring.copy()
    ring[at] = row[at.any(-1)]
    return ring


def thinned(detections: RelativeDetections, M: int, heading: NDArray) -> NDArray:
    """Indices (..., M) of at most M detections, spread over their angle to the heading (...) [rad]."""
    count = detections.mask.shape[-1]
    angle = wrap_angle(np.arctan2(detections.z[..., 1, :], detections.z[..., 0, :]) - heading[..., None])
    angle = np.where(detections.mask, angle, np.inf)
    order = np.argsort(angle, -1, kind="stable")
    if count < M:
        order = np.concatenate([order, np.broadcast_to(order[..., -1:], (*order.shape[:-1], M - count))], -1)
        return order
    n = detections.mask.sum(-1, keepdims=True)
    step = np.maximum(n, M) / M
    return np.take_along_axis(order, np.minimum(np.arange(M) * step, count - 1).astype(int), -1)


def smoothed(window: Window) -> NDArray:
    """Means (..., K, 7) given all scans of the window, in the order of the ring."""
    K = window.m.shape[-2]
    count = np.minimum(window.scans, K)
    order = (window.scans[..., None] - count[..., None] + np.arange(K)) % K  # oldest first; padding wraps around
    m, m_pred = (np.take_along_axis(a, order[..., None], -2) for a in (window.m, window.m_pred))
    G = np.take_along_axis(window.G, order[..., None, None], -3)
    for k in range(K - 2, -1, -1):
        step = (G[..., k + 1, :, :] @ (m[..., k + 1, :] - m_pred[..., k + 1, :])[..., None])[..., 0]
        m[..., k, :] += np.where((k + 1 < count)[..., None], step, 0.0)  # (SM.5a)
    out = np.empty(m.shape)
    np.put_along_axis(out, order[..., None], m, -2)
    return out


def in_body(m: NDArray, xy: NDArray, R: NDArray, sensor: NDArray, mask: NDArray) -> Decoupled:
    """Detections (..., M) in the unit frame of bodies with states m (..., 7), (PMHT.29).

    xy (..., M, 2) [m], R (..., M or 1, 3) [m^2] as columns, sensor (..., M or 1, 2) [m], all in the world.
    """
    A = rotation(m[..., PHI])
    size = np.maximum(m[..., LENGTH:], 1e-3)
    z = (xy - m[..., None, :2]) @ A / size[..., None, :]  # (PMHT.29)
    into = congruence((A / size[..., None, :]).mT)
    toward = np.broadcast_to((sensor - m[..., None, :2]) @ A, z.shape)
    return Decoupled(z, np.broadcast_to(R @ into.mT, (*z.shape[:-1], 3)), toward, mask)


def decouple(window: Window) -> Decoupled:
    """The detections of the window in the frame of the smoothed body, all scans in one row."""
    body = in_body(smoothed(window), window.z, window.R, window.sensor, window.mask)
    lead = window.mask.shape[:-2]
    return Decoupled(*(a.reshape(*lead, -1, *a.shape[len(lead) + 2 :]) for a in body))

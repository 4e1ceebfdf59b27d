"""What all sensors saw of the ground under long tracks: the loops of `trackers.multi.ground`.

Equations: docs/methods/life-cycle-of-tracks.md. The numpy form is the reference; functions here are named after theirs.
"""

from typing import NamedTuple

import numpy as np

from trackers.compiled.algebra import compiled, wrapped
from trackers.multi.ground import CELLS, COARSE, STEP


class Sensors(NamedTuple):
    """S sensors."""

    pose: np.ndarray  # (S, 3)
    fov: np.ndarray  # (S,) [rad]
    max_range: np.ndarray  # (S,) [m]


class Along(NamedTuple):
    """M detections in the cells of D tracks, as of `GroundTest._along`."""

    cell: np.ndarray  # (D, M) int
    there: np.ndarray  # (D, M) bool
    across: np.ndarray  # (D, M) [m]
    most: np.ndarray  # (D, M) [m]
    sensor: np.ndarray  # (M,) int


@compiled
def stopped(x, y, ux, uy, r, pose, size):
    """Whether a ray from (x, y) along (ux, uy) enters a box within r [m]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy, near, far = x - pose[0], y - pose[1], -np.inf, np.inf
    for o, d, half in ((dx * cos + dy * sin, ux * cos + uy * sin, size[0] / 2),
                       (dy * cos - dx * sin, uy * cos - ux * sin, size[1] / 2)):  # fmt: skip
        a, b = (-half - o) / d, (half - o) / d
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near <= far and far >= 0 and max(near, 0.0) <= r


@compiled
def density(pose, size, shift, itself, boxes, sizes, sensors, s, out):
    """Relative density out (CELLS,), written, of a sensor's detections along the side of a track."""
    cos, sin, half = np.cos(pose[2]), np.sin(pose[2]), size[1] / 2
    x, y, heading = sensors.pose[s]
    aside = (y - pose[1]) * cos - (x - pose[0]) * sin
    lateral = np.sign(aside) * half
    for c in range(CELLS // COARSE):
        ahead = STEP * (COARSE * (c + 0.5) - CELLS // 2) - shift
        vx, vy = pose[0] + cos * ahead - sin * lateral - x, pose[1] + sin * ahead + cos * lateral - y
        r = np.hypot(vx, vy)
        sees = abs(wrapped(np.arctan2(vy, vx) - heading)) < sensors.fov[s] / 2
        sees &= r < sensors.max_range[s] and abs(ahead) < size[0] / 2 + STEP
        for t in range(len(boxes) if sees else 0):
            if t != itself and stopped(x, y, vx / r, vy / r, r, boxes[t], sizes[t]):
                sees = False
                break
        lit = max(abs(aside) - half, 0.0) / r
        out[COARSE * c : COARSE * (c + 1)] = np.sqrt(lit) / r if sees else 0.0  # (LIFE.31)
    return aside


@compiled
def observe(pose, size, shift, d, boxes, sizes, looks, along, sensors, independent):
    """Detections and expected ones (D, CELLS) that a scan adds to tracks d (D,) among the boxes of T tracks."""
    seen, expected = np.zeros((len(d), CELLS)), np.zeros((len(d), CELLS))
    p, n = np.empty(CELLS), np.empty(CELLS)
    for s in range(len(looks)):
        for i in range(len(d)):
            if not looks[s, i]:
                continue
            aside = density(pose[i], size[i], shift[i], d[i], boxes, sizes, sensors, s, p)
            n[:] = 0.0
            for m in range(len(along.sensor)):
                towards, cell = along.across[i, m] * np.sign(aside), along.cell[i, m]
                mine = along.there[i, m] and along.sensor[m] == s and 0 < towards < along.most[i, m]
                if mine and p[cell] > 0:
                    n[cell] += 1.0
            total = n.sum()
            weight = min(1.0, independent / max(total, 1.0))
            seen[i] += weight * n  # (LIFE.32)
            expected[i] += weight * total * p / max(p.sum(), 1e-9)  # (LIFE.32)
    return seen, expected

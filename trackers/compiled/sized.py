"""The estimate with the size: the box between both ends, how well each edge is known, and the bend of two bodies.

Equations: docs/methods/size-from-both-ends.md, sections 5 and 6; the numpy form is `SizePosterior.estimate`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.tables import Found, Tables

STRAIGHT, SLOWEST, SHARPEST, OUTLINE = 0.02, 2.0, 0.9, 2.5  # as in `trackers.size.posterior`
BEND_ERROR, ROUNDING_ERROR = 0.5, 0.5  # as there
TINY = 1e-12  # [m^2] as there


@compiled
def around(cov: NDArray, cos: float, sin: float, along: float, across: float) -> None:
    """Variances along and across a heading, added to the first two components of cov."""
    cov[0, 0] += along * cos * cos + across * sin * sin
    cov[1, 1] += along * sin * sin + across * cos * cos
    cov[0, 1] += (along - across) * cos * sin
    cov[1, 0] = cov[0, 1]


@compiled
def scaled(cov: NDArray, cos: float, sin: float, along: float, across: float) -> None:
    """The first two components of cov times factors along and across a heading, in place."""
    a, b, c = along * cos**2 + across * sin**2, (along - across) * cos * sin, along * sin**2 + across * cos**2
    for i in range(4):
        cov[0, i], cov[1, i] = a * cov[0, i] + b * cov[1, i], b * cov[0, i] + c * cov[1, i]
    for i in range(4):
        cov[i, 0], cov[i, 1] = a * cov[i, 0] + b * cov[i, 1], b * cov[i, 0] + c * cov[i, 1]


@compiled
def outlined(outline: NDArray, pose: NDArray, length: float, width: float, contour: NDArray) -> None:
    """Points (C, 2) in the world of an outline in the unit frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(len(outline)):
        x, y = outline[i, 0] * length, outline[i, 1] * width
        contour[i, 0], contour[i, 1] = pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y


@compiled
def edges(
    excess: NDArray, b: NDArray, anchor: NDArray, more: NDArray, far_var: float, pin: NDArray, edge: NDArray
) -> None:  # fmt: skip
    """(ENDS.36), (ENDS.37): standard deviations edge (4,) of front, rear, left, right.

    excess (2,) are the variances of the place along its axes that the grids do not know, more (2,) those of the inset,
    far_var that of what the far end of the length is rounded by; pin as in `Tables`.
    """
    for a in range(2):
        rest = more[a] + pin[2] ** 2 + excess[a]
        near, far = b[3, a] + rest, 2 * b[4, a] - b[3, a] + b[1, a] / 2 + rest
        far += far_var if a == 0 else 0.0
        edge[2 * a] = math.sqrt(near if anchor[a] > 0 else far)
        edge[2 * a + 1] = math.sqrt(near if anchor[a] < 0 else far)


@compiled
def curvature(rate: float, rate_std: float, speed: float) -> float:
    """How sharply [1/m] a path bends, as far as it is certain."""
    return max(abs(rate) - rate_std, 0.0) / max(speed, SLOWEST)


@compiled
def bend(
    rate: float, rate_std: float, speed: float, width: float, kind: NDArray, hinges: NDArray
) -> tuple[float, float]:
    """(ENDS.40): how far a front body stands out beside that behind it, to the left positive, and the variance."""
    bent, mean, square = curvature(rate, rate_std, speed), 0.0, 0.0
    for c in range(len(kind)):
        sine = min(hinges[0, c] * bent, SHARPEST)
        out = hinges[1, c] * sine - width / 2 * (1 - math.sqrt(1 - sine**2))
        mean += kind[c] * out
        square += kind[c] * (out**2 + (hinges[1, c] * hinges[0, c] * rate_std / max(speed, SLOWEST)) ** 2)  # (ENDS.41)
    return (0.0 if bent == 0 else math.copysign(mean, rate * mean)), square - mean**2 + (BEND_ERROR * mean) ** 2


@compiled
def rounded(
    var: float, kind: NDArray, anchor: float, aside: float, enough: float, roundings: NDArray
) -> tuple[float, float]:
    """(ENDS.48): how much a body reaches beyond the detections at its far end, and the variance; var of its length."""
    mean = square = 0.0
    for c in range(len(kind) if anchor != 0 else 0):
        x = max(1 - var / roundings[2, c], 0.0) * roundings[0 if anchor < 0 else 1, c] * math.exp(-aside / enough)
        mean += kind[c] * x
        square += kind[c] * x**2
    return mean, square - mean**2 + (ROUNDING_ERROR * mean) ** 2


@compiled
def sized(
    t: int, f: Found, b: NDArray, kind: NDArray, anchor: NDArray, aside: float, outline: NDArray, p: Tables
) -> None:  # fmt: skip
    """(ENDS.20), (ENDS.21), (ENDS.35) to (ENDS.41), (ENDS.48): row t of the box with the size, from that without.

    b (5, 2), kind (C,), anchor (2,) and aside are those of the state.
    """
    pose, cov, size, std, edge = f.pose[1, t], f.cov[1, t], f.size[1, t], f.size_std[t], f.edge_std[t]
    pose[:], cov[:] = f.pose[0, t], f.cov[0, t]
    cos, sin, l, w = math.cos(pose[2]), math.sin(pose[2]), f.size[0, t, 0], f.size[0, t, 1]
    inset, more, place, excess = 0.0, np.zeros(2), np.empty(2), np.empty(2)
    for c in range(len(kind)):
        inset += kind[c] * p.insets[c, 0]  # (ENDS.35)
        more[0] += kind[c] * p.insets[c, 1]
    more[0] -= inset**2
    far, far_var = rounded(b[1, 0], kind, anchor[0], aside, p.enough_aside, p.roundings)
    length = b[0, 0] + far
    place[0] = cos * (cov[0, 0] * cos + cov[0, 1] * sin) + sin * (cov[1, 0] * cos + cov[1, 1] * sin)
    place[1] = sin * (cov[0, 0] * sin - cov[0, 1] * cos) - cos * (cov[1, 0] * sin - cov[1, 1] * cos)
    for a in range(2):
        known = p.pin[3 + a] ** 2 + (OUTLINE * max(p.pin[0] * f.size[0, t, a], p.pin[1])) ** 2
        excess[a] = max(place[a] - known, 0.0)  # (ENDS.36)
    edges(excess, b, anchor, more, far_var, p.pin, edge)
    x, y = anchor[0] * (b[2, 0] + inset + (l - length) / 2), anchor[1] * (b[2, 1] + (w - b[0, 1]) / 2)  # (ENDS.21)
    pose[0] += cos * x - sin * y
    pose[1] += sin * x + cos * y
    least = p.pin[5] ** 2 if p.once else 0.0
    if p.once:
        scaled(cov, cos, sin, math.sqrt(excess[0] / max(place[0], TINY)), math.sqrt(excess[1] / max(place[1], TINY)))
    around(cov, cos, sin, b[4, 0] + more[0] + far_var / 4 + least, b[4, 1] + least)  # (ENDS.20)
    outlined(outline, pose, length, b[0, 1], f.contour[1, t])
    speed = math.hypot(f.velocity[t, 0], f.velocity[t, 1])
    out, var = bend(f.m[t, 4], f.std[t, 1], speed, b[0, 1], kind, p.hinges)
    pose[0] -= sin * out / 2  # (ENDS.41)
    pose[1] += cos * out / 2
    around(cov, cos, sin, 0.0, var / 4)
    size[0], size[1] = length, b[0, 1] + abs(out)
    std[0], std[1] = math.sqrt(b[1, 0] + far_var), math.sqrt(b[1, 1] + var)
    side = 2 if out > 0 else 3
    edge[side] = math.sqrt(edge[side] ** 2 + var)

"""Rays against outlines, and points on the bodies that they meet; docs/methods/radar.md. All random numbers come in.

Bodies are one list of vertices (E, 2), `after` (E,) the next vertex of each, `body` (E,) its body, of those the first
vertex `start` (B,) and the number `size` (B,). Rays of sensor s are `first[s]` to `first[s] + count[s]`, evenly spaced.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import Compiler
from trackers.compiled.linear import wrap

NEAREST = 1e-9  # [m] as in `sensors.raycast`
SLACK = 1e-9  # [rad]
GRAZING = 0.05  # as in `sensors.illumination`
ENTERED = 1e-6  # [m] a ray leaves a body so far behind the point at which it entered

compiled = Compiler(Path(__file__).parent)


@compiled
def crossing(ux: float, uy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """(RAD.3), (RAD.4): range at which a ray from the origin along u crosses a -> b; inf where it does not."""
    sa, sb = ux * ay - uy * ax, ux * by - uy * bx
    if (sa >= 0) == (sb >= 0):
        return np.inf
    t = sa / (sa - sb)
    r = ux * (ax + t * (bx - ax)) + uy * (ay + t * (by - ay))
    return r if r > NEAREST else np.inf


@compiled
def out_of_view(x: NDArray, pose: NDArray, reach: float, fov: float) -> bool:
    """Whether the circle around the vertices x (C, 2) of a body is beyond the reach or beside the field of view."""
    cx, cy, radius = -pose[0], -pose[1], 0.0
    for k in range(len(x)):
        cx += x[k, 0] / len(x)
        cy += x[k, 1] / len(x)
    for k in range(len(x)):
        radius = max(radius, math.hypot(x[k, 0] - pose[0] - cx, x[k, 1] - pose[1] - cy))
    d = math.hypot(cx, cy)
    if d - radius > reach:
        return True
    beside = abs(wrap(math.atan2(cy, cx) - pose[2])) - fov / 2 - 1e-6
    return d > 1.01 * radius and beside > math.asin(min(radius / d, 1.0))


@compiled
def cast(
    pose: NDArray, first: NDArray, count: NDArray, azimuth: NDArray, reach: NDArray, fov: NDArray,
    x: NDArray, after: NDArray, start: NDArray, size: NDArray, owner: NDArray,
    r: NDArray, segment: NDArray, met: NDArray,
) -> None:  # fmt: skip
    """(RAD.5), (RAD.6): first hits r, segment (R,) of all rays; met (S, N) counts the rays that cross each object."""
    stamp = np.full(len(r), -1)
    ux, uy = np.empty(len(r)), np.empty(len(r))
    r[:], segment[:], met[:] = np.inf, -1, 0.0
    for s in range(len(pose)):
        x0, y0, heading = pose[s, 0], pose[s, 1], pose[s, 2]
        step, half = fov[s] / count[s], fov[s] / 2
        for i in range(first[s], first[s] + count[s]):
            ux[i], uy[i] = math.cos(heading + azimuth[i]), math.sin(heading + azimuth[i])
        for b in range(len(start)):
            if out_of_view(x[start[b] : start[b] + size[b]], pose[s], reach[s], fov[s]):
                continue
            for k in range(start[b], start[b] + size[b]):
                ax, ay, bx, by = x[k, 0] - x0, x[k, 1] - y0, x[after[k], 0] - x0, x[after[k], 1] - y0
                begin = math.atan2(ay, ax)
                turn = wrap(math.atan2(by, bx) - begin)
                low = wrap(begin + min(turn, 0.0) - heading) - SLACK
                every = abs(turn) > math.pi - 1e-6  # rounding decides on which side of its line the sensor is
                for lap in range(-1, 1 if every else 2):
                    at = (low + 2 * math.pi * lap + half) / step - 0.5
                    i0 = 0 if every else max(math.floor(at), 0)
                    i1 = count[s] if every else min(math.ceil(at + (abs(turn) + 2 * SLACK) / step) + 1, count[s])
                    for i in range(first[s] + i0, first[s] + i1):
                        found = crossing(ux[i], uy[i], ax, ay, bx, by)
                        if found <= reach[s] and stamp[i] != owner[b]:
                            stamp[i] = owner[b]  # the bodies of one object stand beside each other
                            met[s, owner[b]] += 1.0
                        if found < r[i]:
                            r[i], segment[i] = found, k


@compiled
def illuminate(
    first: NDArray, count: NDArray, reach: NDArray, spacing: NDArray, rates: NDArray,
    body: NDArray, owner: NDArray, r: NDArray, segment: NDArray, met: NDArray, share: NDArray, expected: NDArray,
) -> None:  # fmt: skip
    """(RAD.7) to (RAD.10): visible share (S, N) of each object and detections to be expected (S, N) of it."""
    S, N = met.shape
    for s in range(S):
        chord, lit, nearest = np.zeros(N), np.zeros(N), np.full(N, np.inf)
        for i in range(first[s], first[s] + count[s]):
            if r[i] <= reach[s]:
                o = owner[body[segment[i]]]
                chord[o] += r[i] * spacing[s]
                lit[o] += 1.0
                nearest[o] = min(nearest[o], r[i])
        for o in range(N):
            share[s, o] = lit[o] / max(met[s, o], 1.0)
            expected[s, o] = 0.0
            if chord[o] > 0:
                falloff = (15.0 / max(nearest[o], 1.0)) ** rates[s, 1]
                expected[s, o] = min(rates[s, 0] * falloff * math.sqrt(chord[o] / 3.0), rates[s, 2])


@compiled
def weigh(
    s: int, o: int, pose: NDArray, first: NDArray, count: NDArray, azimuth: NDArray, reach: NDArray, spacing: NDArray,
    grazing: float, x: NDArray, after: NDArray, body: NDArray, owner: NDArray, r: NDArray, segment: NDArray,
    ray: NDArray, total: NDArray,
) -> int:  # fmt: skip
    """(RAD.13): elements of object o for sensor s, their rays and the sums of their weights so far; their number."""
    n, upto = 0, 0.0
    for i in range(first[s], first[s] + count[s]):
        k = segment[i]
        if r[i] <= reach[s] and owner[body[k]] == o:
            ex, ey = x[after[k], 0] - x[k, 0], x[after[k], 1] - x[k, 1]
            bearing = pose[s, 2] + azimuth[i]
            across = abs(math.cos(bearing) * ey - math.sin(bearing) * ex) / math.hypot(ex, ey)
            upto += r[i] * spacing[s] * max(across, GRAZING) ** -grazing
            ray[n], total[n] = i, upto
            n += 1
    return n


@compiled
def room_behind(ux: float, uy: float, r: float, x0: float, y0: float, x: NDArray) -> float:
    """(RAD.15): length of the ray along u inside the body with vertices x (C, 2), which it enters at range r."""
    leave, C = np.inf, len(x)
    for k in range(C):
        j = k + 1 if k + 1 < C else 0
        found = crossing(ux, uy, x[k, 0] - x0, x[k, 1] - y0, x[j, 0] - x0, x[j, 1] - y0)
        if found > r + ENTERED:
            leave = min(leave, found)
    return leave - r if math.isfinite(leave) else 0.0


@compiled
def depth_behind(mean: float, room: float, x: float) -> float:
    """(RAD.15): depth behind the surface at the share x of its distribution."""
    if not mean > 0:
        return 0.0
    if math.isinf(mean):
        return x * room
    return min(-mean * math.log1p(-x * -math.expm1(-room / mean)), room)


@compiled
def points(
    counts: NDArray, random: NDArray, normal: NDArray, pose: NDArray, velocity: NDArray,
    first: NDArray, count: NDArray, azimuth: NDArray, reach: NDArray, spacing: NDArray, figures: NDArray,
    x: NDArray, after: NDArray, body: NDArray, start: NDArray, size: NDArray, owner: NDArray,
    body_pose: NDArray, body_velocity: NDArray, body_yaw: NDArray, r: NDArray, segment: NDArray,
    polar: NDArray, origin: NDArray,
) -> None:  # fmt: skip
    """(RAD.14) to (RAD.19): polar (D, 3) of the returns of vehicles, and origin (D, 5) int of each.

    counts (S, N); random (5, D) even and normal (D, 2) numbers. origin: sensor, object, body, edge, inside. figures
    (S, 6): grazing, share inside, depth behind the contour, depth inside, share of scatter, its spread.
    """
    ray, total = np.empty(len(r), np.int64), np.empty(len(r))
    d = 0
    for s in range(counts.shape[0]):
        for o in range(counts.shape[1]):
            if counts[s, o] == 0:
                continue
            n = weigh(s, o, pose, first, count, azimuth, reach, spacing, figures[s, 0], x, after, body, owner, r,
                      segment, ray, total)  # fmt: skip
            for _ in range(counts[s, o]):
                e = 0
                while e < n - 1 and not total[e] > total[n - 1] * random[0, d]:
                    e += 1
                i = ray[e]
                k = segment[i]
                b = body[k]
                angle = pose[s, 2] + azimuth[i] + spacing[s] * (random[1, d] - 0.5)
                ux, uy = math.cos(angle), math.sin(angle)
                x0, y0, j = pose[s, 0], pose[s, 1], after[k]
                sa, sb = ux * (x[k, 1] - y0) - uy * (x[k, 0] - x0), ux * (x[j, 1] - y0) - uy * (x[j, 0] - x0)
                t = min(max(sa / (sa - sb) if sa != sb else 0.5, 0.0), 1.0)
                px, py = x[k, 0] + t * (x[j, 0] - x[k, 0]), x[k, 1] + t * (x[j, 1] - x[k, 1])  # (RAD.14)
                reached = math.hypot(px - x0, py - y0)
                ux, uy = (px - x0) / max(reached, 1e-12), (py - y0) / max(reached, 1e-12)
                inside = random[2, d] < figures[s, 1]
                room = room_behind(ux, uy, reached, x0, y0, x[start[b] : start[b] + size[b]])
                depth = depth_behind(figures[s, 3] if inside else figures[s, 2], room, random[3, d])
                px, py = px + depth * ux, py + depth * uy  # (RAD.16)
                lx, ly = px - body_pose[b, 0], py - body_pose[b, 1]
                vx, vy = body_velocity[b, 0] - body_yaw[b] * ly, body_velocity[b, 1] + body_yaw[b] * lx
                off = figures[s, 5] if random[4, d] < figures[s, 4] else 0.0
                qx, qy = px + off * normal[d, 0] - x0, py + off * normal[d, 1] - y0
                polar[d, 0], polar[d, 1] = math.hypot(qx, qy), wrap(math.atan2(qy, qx) - pose[s, 2])  # (RAD.18)
                polar[d, 2] = ux * (vx - velocity[s, 0]) + uy * (vy - velocity[s, 1])  # (RAD.17)
                origin[d, 0], origin[d, 1], origin[d, 2], origin[d, 3], origin[d, 4] = s, o, b, k - start[b], inside
                d += 1


@compiled
def look(
    pose: NDArray, first: NDArray, count: NDArray, azimuth: NDArray, reach: NDArray, fov: NDArray, spacing: NDArray,
    rates: NDArray, x: NDArray, after: NDArray, body: NDArray, start: NDArray, size: NDArray, owner: NDArray,
    r: NDArray, segment: NDArray, share: NDArray, expected: NDArray,
) -> None:  # fmt: skip
    """Cast all rays, and say what is visible and to be expected of each object."""
    met = np.empty(share.shape)
    cast(pose, first, count, azimuth, reach, fov, x, after, start, size, owner, r, segment, met)
    illuminate(first, count, reach, spacing, rates, body, owner, r, segment, met, share, expected)


look_at = compiled.first(look, "rays of the radar", 6)
points_on = compiled.first(points, "points of the radar", 6)

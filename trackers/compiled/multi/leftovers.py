"""Detections that no track owns, and whether any of them is born; docs/methods/life-cycle-of-tracks.md, 1 and 2.

Cells of detections are only judged here: where one may be born, `trackers.multi.initiation` does it all.
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.rules import Boxes, Detections, Pool, Rules
from trackers.compiled.multi.view import locate


@compiled
def explained(
    x: float, y: float, ux: float, uy: float, rate: float, var_across: float, box: Boxes, existence: NDArray, p: Rules
) -> bool:
    """(MOT.29), (MOT.30): whether a point lies inside the margins of a track, or beyond its ends and moves like it."""
    along, across, above, end_along, end_across, end_rate = p.suppression
    for t in range(len(existence)):
        if not existence[t] > above:
            continue
        c, s, dx, dy = math.cos(box.pose[t, 2]), math.sin(box.pose[t, 2]), x - box.pose[t, 0], y - box.pose[t, 1]
        ahead, aside = abs(c * dx + s * dy) - box.size[t, 0] / 2, abs(c * dy - s * dx) - box.size[t, 1] / 2
        if ahead < along and aside < across + 1.5 * math.sqrt(var_across):  # (MOT.29)
            return True
        unlike = abs(rate - (ux * box.velocity[t, 0] + uy * box.velocity[t, 1])) >= end_rate  # never without a rate
        if 0 <= ahead < end_along and aside < end_across and not unlike:  # (MOT.30)
            return True
    return False


@compiled
def candidates(z: Detections, owner: NDArray, box: Boxes, existence: NDArray, p: Rules) -> NDArray:
    """(MOT.28) to (MOT.30): unowned detections (M,) bool that may start a track."""
    free = np.zeros(len(owner), np.bool_)
    for j in range(len(owner)):
        if owner[j] < 0 and (not z.static[j] or z.in_lane[j]):  # (MOT.28)
            free[j] = not explained(
                z.xy[j, 0], z.xy[j, 1], z.sight[j, 0], z.sight[j, 1], z.rate[j], z.var_across[j], box, existence, p
            )
    return free


@compiled
def gather(
    old: Pool, free: NDArray, z: Detections, way: NDArray, dt: float, box: Boxes, existence: NDArray, p: Rules
) -> tuple[Pool, int]:
    """(LIFE.1): the window after dt without what tracks explain, then the free detections; and the number of these.

    way (M,) [rad] is the direction of the way of the ego at those detections that no track has.
    """
    span, standing, _, _, moving, beside, _ = p.window
    P, lanes, k = len(old.rate) + len(free), p.lanes, 0
    o = Pool(
        np.empty((P, 2)), np.empty((P, 2)), np.empty(P), np.empty(P), np.empty(P), np.empty(P), np.empty(P, np.int64),
        np.empty((P, 2)), np.empty(P), np.empty(P, np.bool_), np.empty(P),
    )  # fmt: skip
    for i in range(len(old.rate)):
        ux, uy, moves, age = old.sight[i, 0], old.sight[i, 1], abs(old.rate[i]) > moving, old.age[i] + dt
        cx, cy = math.cos(old.course[i]), math.sin(old.course[i])
        speed = old.rate[i] / (ux * cx + uy * cy) if moves else 0.0
        x, y = old.xy[i, 0] + speed * dt * cx, old.xy[i, 1] + speed * dt * cy  # (LIFE.1)
        late = not age < (span if moves else standing) + 1e-9
        if late or explained(x, y, ux, uy, old.rate[i], old.var_across[i], box, existence, p):
            continue
        o.xy[k, 0], o.xy[k, 1], o.sight[k], o.place[k] = x, y, old.sight[i], old.place[i]
        o.rate[k], o.var_along[k], o.var_across[k] = old.rate[i], old.var_along[i], old.var_across[i]
        o.clutter[k], o.sensor[k], o.course[k] = old.clutter[i], old.sensor[i], old.course[i]
        o.off_lane[k], o.age[k], k = old.off_lane[i], age, k + 1
    before = k
    for j in range(len(free)):
        if not free[j]:
            continue
        depth, direction = locate(z.xy[j, 0], z.xy[j, 1], lanes) if lanes.known else (-np.inf, 0.0)
        on = depth > -beside
        if math.isnan(z.rate[j]) and len(lanes.a) and not on:  # as in `Initiation._born_here`
            continue
        o.xy[k], o.sight[k], o.rate[k], o.place[k] = z.xy[j], z.sight[j], z.rate[j], z.pose[j, :2]
        o.var_along[k], o.var_across[k], o.clutter[k] = z.var_along[j], z.var_across[j], z.clutter[j]
        o.sensor[k], o.course[k], o.age[k] = z.sensor[j], direction if on else way[j], 0.0
        o.off_lane[k], k = lanes.known and not on, k + 1
    return cut(o, np.arange(k)), k - before


@compiled
def cut(o: Pool, k: NDArray) -> Pool:
    """The rows k (K,) of a pool."""
    return Pool(
        o.xy[k], o.sight[k], o.rate[k], o.var_along[k], o.var_across[k], o.clutter[k], o.sensor[k], o.place[k],
        o.course[k], o.off_lane[k], o.age[k],
    )  # fmt: skip


@compiled
def first_of(label: NDArray, i: int) -> int:
    """The first row that row i is linked with, by links label (P,) to earlier rows."""
    while label[i] != i:
        i = label[i]
    return i


@compiled
def link(o: Pool, sigma: NDArray, p: Rules) -> NDArray:
    """(LIFE.3): cell (P,) of each detection, named by its first one."""
    along, across, rate_now, rate_between = p.linkage
    P = len(o.rate)
    label, rate, radius = np.arange(P), np.empty(P), 0.0
    for i in range(P):
        rate[i], radius = o.rate[i] if math.isfinite(o.rate[i]) else 0.0, max(radius, along + sigma[i])
    for b in range(P):
        cx, cy = math.cos(o.course[b]), math.sin(o.course[b])
        for a in range(b):
            dx, dy, dr = o.xy[a, 0] - o.xy[b, 0], o.xy[a, 1] - o.xy[b, 1], abs(rate[a] - rate[b])
            if max(abs(dx), abs(dy)) > radius or dr > rate_now:
                continue
            more, limit = (sigma[a] + sigma[b]) / 2, rate_now if o.age[a] == o.age[b] else rate_between
            d2 = ((dx * cx + dy * cy) / (along + more)) ** 2 + ((dy * cx - dx * cy) / (across + more)) ** 2
            if d2 < 1 and dr < limit:
                i, j = first_of(label, a), first_of(label, b)
                label[max(i, j)] = min(i, j)
    for i in range(P):
        label[i] = first_of(label, i)
    return label


@compiled
def stays(o: Pool, label: NDArray, cell: int, n: int, p: Rules) -> bool:
    """(LIFE.8): whether a cell with n detections was seen in enough scans, for long enough, and has not moved."""
    least, time, drift = p.evidence[11], p.evidence[12], p.evidence[13]
    ages, scans, oldest, mean = np.empty(n), 0, 0.0, 0.0
    for i in range(len(label)):
        if label[i] == cell:
            new = True
            for k in range(scans):
                new &= ages[k] != o.age[i]
            if new:
                ages[scans], scans = o.age[i], scans + 1
            oldest, mean = max(oldest, o.age[i]), mean + o.age[i] / n
    x = y = square = 0.0
    for i in range(len(label)):
        if label[i] == cell:
            t = o.age[i] - mean
            x, y, square = x + t * o.xy[i, 0] / n, y + t * o.xy[i, 1] / n, square + t * t / n
    return scans >= least and oldest > time and math.hypot(x, y) / max(square, 1e-9) < drift


@compiled
def quiet(o: Pool, time: float, dt: float, p: Rules) -> bool:
    """(LIFE.3) to (LIFE.8): whether no cell of the pool is born, time after the first scan."""
    least, intensity, first, decay, off_share, factor, cap, born_above, rate_span, standing, at_once, _, _, _ = (
        p.evidence
    )
    along, across, rate_now, rate_between = p.linkage
    P, clutter = len(o.rate), p.sheets.clutter
    sigma = np.sqrt(o.var_along + o.var_across)
    label, cells, n, n_now = link(o, sigma, p), np.zeros(len(clutter)), np.zeros(P, np.int64), np.zeros(P, np.int64)
    for i in range(P):
        n[label[i]] += 1
        if o.age[i] == 0:
            n_now[label[i]] += 1
            new = True
            for k in range(i):
                new &= label[k] != label[i] or o.age[k] != 0 or o.sensor[k] != o.sensor[i]
            cells[o.sensor[i]] += new
    top, low, worth = np.full(P, -np.inf), np.full(P, np.inf), np.zeros(P)
    off, rate = np.zeros(P), np.zeros(P)
    for i in range(P):
        c, now, measured = label[i], o.age[i] == 0, math.isfinite(o.rate[i])
        density = o.clutter[i] * max(1.0, factor * cells[o.sensor[i]] / max(clutter[o.sensor[i]], 1.0))  # (LIFE.4)
        rates = (2 * (rate_now if now else rate_between)) if measured else 1.0
        volume = math.pi * (along + sigma[i]) * (across + sigma[i]) * rates
        scans = 1.0 if now or not dt > 0 else p.window[0] / dt
        one = min(-math.log(min(density * volume * scans, 0.9)), cap)  # (LIFE.5)
        top[c], worth[c] = max(top[c], one), worth[c] + one
        low[c] = min(low[c], density if measured else density / rate_span)
        off[c], rate[c] = off[c] + o.off_lane[i], rate[c] + abs(o.rate[i])
    newcomers = intensity + math.exp(-time / decay) * (first - intensity)  # (LIFE.7)
    for c in range(P):
        if n_now[c] == 0:
            continue
        if rate[c] / n[c] < standing:
            if n_now[c] >= at_once or stays(o, label, c, n[c], p):
                return False
        elif n[c] >= least:
            rho = newcomers * (off_share if off[c] > n[c] / 2 else 1.0)
            odds = math.log(rho / low[c]) + worth[c] - top[c]  # (LIFE.6)
            if 1 / (1 + math.exp(-odds)) > born_above:
                return False
    return True


@compiled
def remembered(o: Pool, p: Rules) -> Pool:
    """(LIFE.2): what goes on to the next scan."""
    _, _, along_sight, beyond, moving, _, _ = p.window
    keep = np.empty(len(o.rate), np.bool_)
    for i in range(len(keep)):
        along = abs(o.sight[i, 0] * math.cos(o.course[i]) + o.sight[i, 1] * math.sin(o.course[i]))
        away = math.hypot(o.xy[i, 0] - o.place[i, 0], o.xy[i, 1] - o.place[i, 1])
        useful = along > along_sight or not abs(o.rate[i]) > moving
        keep[i] = useful and away > beyond and math.isfinite(o.rate[i])
    return cut(o, np.flatnonzero(keep))

"""Gates, likelihoods, and the one track that owns each detection; docs/methods/multi-object-tracking.md, 1, 5, 6."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.linear import bell, ndtr, step
from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.rules import Boxes, Claimed, Detections, Rules, Sheets, Sizes, View
from trackers.compiled.tables import POSE, RANGE, RATE, SENSOR, UX, UY

LEAST_DENSITY = 1e-300  # as in `trackers.size.spatial`, and of the mass of a box


@compiled
def greatest(p: NDArray, sizes: NDArray, impossible: float) -> float:
    """(ENDS.28): the greatest size that is possible, of probabilities p (K,)."""
    total = 0.0
    for k in range(len(p)):
        total += p[k]
        if not total < 1 - impossible:
            return sizes[k]
    return sizes[-1]


@compiled
def reach(box: Boxes, x: Sizes, s: Sheets) -> Boxes:
    """(ENDS.20), (ENDS.21), (ENDS.28): the boxes of the greatest possible size, for gates."""
    g = Boxes(
        x.pose.copy(), box.velocity, box.yaw_rate, np.empty(box.size.shape), x.cov.copy(), np.zeros(box.size.shape),
        box.yaw_rate_std,
    )  # fmt: skip
    body = np.empty(2)
    for t in range(len(x.pose)):
        g.size[t, 0] = greatest(x.length[t], s.lengths, s.impossible)
        g.size[t, 1] = greatest(x.width[t], s.widths, s.impossible)
        c, n = math.cos(x.pose[t, 2]), math.sin(x.pose[t, 2])
        for a in range(2):
            body[a] = x.anchor[t, a] * (x.offset[t, a] + (x.size[t, a] - g.size[t, a]) / 2)  # (ENDS.21)
        g.pose[t, 0] += c * body[0] - n * body[1]
        g.pose[t, 1] += n * body[0] + c * body[1]
        along, across = x.offset_var[t, 0], x.offset_var[t, 1]
        g.cov[t, 0, 0] += along * c * c + across * n * n
        g.cov[t, 1, 1] += along * n * n + across * c * c
        g.cov[t, 0, 1] += (along - across) * c * n
        g.cov[t, 1, 0] += (along - across) * c * n
    return g


@compiled
def turned(cov: NDArray, c: float, s: float) -> tuple[float, float]:
    """The variances of the first two components of cov along and across a heading of this cosine and sine."""
    xx, xy, yy = cov[0, 0], cov[0, 1], cov[1, 1]
    return c * c * xx + 2 * c * s * xy + s * s * yy, s * s * xx - 2 * c * s * xy + c * c * yy


@compiled
def box_density(ex: float, ey: float, half: NDArray, Cx: float, Cy: float) -> float:
    """(MOT.16): log density [1/m^2] at e of a box of this half size that is blurred by variances C."""
    out = 0.0
    for e, h, C in ((ex, half[0], Cx), (ey, half[1], Cy)):
        s = math.sqrt(C)
        out += math.log(max(ndtr((h - e) / s) - ndtr((-h - e) / s), LEAST_DENSITY) / (2 * h))
    return out


@compiled
def size_density(t: int, j: int, x: Sizes, z: Detections, s: Sheets) -> float:
    """(ENDS.25) to (ENDS.27): log density [1/m^2] of detection j over the body of object t, whose size is uncertain."""
    f = s.profile[z.sensor[j]]
    inside, grazing, surface, depth, depth_std = f[0], f[1], f[2], f[3], f[4]
    c, n, size = math.cos(x.pose[t, 2]), math.sin(x.pose[t, 2]), x.size[t]
    ux, uy, dx, dy = z.sight[j, 0], z.sight[j, 1], z.pose[j, 0] - x.pose[t, 0], z.pose[j, 1] - x.pose[t, 1]
    sight, place = (c * ux + n * uy, c * uy - n * ux), (c * dx + n * dy, c * dy - n * dx)
    place_var, shown, end, total = turned(x.cov[t], c, n), np.zeros(2), np.zeros(2), 0.0
    for a in range(2):
        beyond = x.anchor[t, a] * place[a]
        end[a] = 1.0 if beyond > size[a] / 2 else (-1.0 if beyond < -size[a] / 2 else 0.0)
        shown[a] = abs(sight[a]) ** (1 - grazing) * size[1 - a] if end[a] != 0 else 0.0  # (ENDS.4)
        total += shown[a]
    through, even, rest = np.empty(2), np.empty(2), 1.0
    for a in range(2):
        share = shown[a] / total if total > 0 else 0.0
        noise = z.var_along[j] * sight[a] ** 2 + z.var_across[j] * sight[1 - a] ** 2 + surface**2  # (ENDS.6)
        var = noise + x.offset_var[t, a] + place_var[a]  # (ENDS.25)
        d = size[a] / 2 + x.offset[t, a] - x.anchor[t, a] * (place[a] + z.polar[j, 0] * sight[a])
        sigma, sizes, p, total_even = math.sqrt(var), s.lengths, x.length[t], 0.0
        if a == 1:
            sizes, p = s.widths, x.width[t]
        top = step(d / sigma)
        for k in range(len(p)):
            if p[k] > 1e-17:  # less cannot be seen in the sum
                total_even += (top - step((d - sizes[k]) / sigma)) * p[k] / sizes[k]  # (ENDS.26)
        behind, less = x.mean[t, a] - d if end[a] < 0 else d, abs(sight[a]) ** f[5]  # (ENDS.52)
        var_face = var + (less * depth_std) ** 2
        near = bell(-0.5 * (behind - less * depth) ** 2 / var_face) / math.sqrt(2 * math.pi * var_face)  # (ENDS.25)
        even[a], through[a] = total_even, (1 - inside) * share * near + inside * share * total_even
        rest -= share
    density = through[0] * even[1] + through[1] * even[0] + rest * even[0] * even[1]  # (ENDS.27)
    return math.log(max(density, LEAST_DENSITY))


@compiled
def rate_density(t: int, j: int, g: Boxes, z: Detections, rate_gate: float, rate_std: float) -> float:
    """(MOT.17) to (MOT.19): log density [s/m] of a range rate, 0 where not measured, -inf outside the gate."""
    if not math.isfinite(z.rate[j]):
        return 0.0
    ux, uy, P = z.sight[j, 0], z.sight[j, 1], g.cov[t]
    lever = (z.xy[j, 0] - g.pose[t, 0]) * uy - (z.xy[j, 1] - g.pose[t, 1]) * ux
    foretold = ux * g.velocity[t, 0] + uy * g.velocity[t, 1] + g.yaw_rate[t] * lever  # (MOT.17)
    var = ux * (P[2, 2] * ux + P[2, 3] * uy) + uy * (P[3, 2] * ux + P[3, 3] * uy)
    var += (lever * g.yaw_rate_std[t]) ** 2 + rate_std**2  # (MOT.18)
    d2 = (z.rate[j] - foretold) ** 2 / var
    return -0.5 * (d2 + math.log(2 * math.pi * var)) if d2 < rate_gate else -np.inf  # (MOT.19)


@compiled
def gate(g: Boxes, x: Sizes, z: Detections, p: Rules) -> tuple[NDArray, NDArray, NDArray]:
    """(MOT.14) to (MOT.19): tracks, detections and log densities (G,) of the pairs inside both gates."""
    position_gate, rate_gate, rate_std, surface, _, _, _, _ = p.association
    T, M, sized, noise = len(g.pose), len(z.rate), len(x.pose) > 0, 0.0
    for j in range(M):
        noise = max(noise, z.var_along[j], z.var_across[j])
    var, far = np.empty((T, 2)), np.empty(T)
    room = 0
    for t in range(T):
        along, across = turned(g.cov[t], math.cos(g.pose[t, 2]), math.sin(g.pose[t, 2]))
        var[t, 0] = along + surface**2 + g.size_std[t, 0] ** 2 / 4
        var[t, 1] = across + surface**2 + g.size_std[t, 1] ** 2 / 4
        a = g.size[t, 0] / 2 + math.sqrt(position_gate * (var[t, 0] + noise))
        b = g.size[t, 1] / 2 + math.sqrt(position_gate * (var[t, 1] + noise))
        far[t] = (a * a + b * b) * (1 + 1e-9)
        for j in range(M):
            room += (z.xy[j, 0] - g.pose[t, 0]) ** 2 + (z.xy[j, 1] - g.pose[t, 1]) ** 2 < far[t]
    track, detection, log, G = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room), 0
    for t in range(T):
        c, n, half = math.cos(g.pose[t, 2]), math.sin(g.pose[t, 2]), g.size[t] / 2
        for j in range(M):
            dx, dy = z.xy[j, 0] - g.pose[t, 0], z.xy[j, 1] - g.pose[t, 1]
            if not dx * dx + dy * dy < far[t]:
                continue
            ex, ey = abs(c * dx + n * dy), abs(c * dy - n * dx)
            cos2 = (c * z.sight[j, 0] + n * z.sight[j, 1]) ** 2
            Cx = z.var_along[j] * cos2 + z.var_across[j] * (1 - cos2) + var[t, 0]  # (MOT.14a)
            Cy = z.var_along[j] * (1 - cos2) + z.var_across[j] * cos2 + var[t, 1]  # (MOT.14b)
            if max(ex - half[0], 0.0) ** 2 / Cx + max(ey - half[1], 0.0) ** 2 / Cy < position_gate:  # (MOT.15)
                rate = rate_density(t, j, g, z, rate_gate, rate_std)
                if rate > -np.inf:
                    place = size_density(t, j, x, z, p.sheets) if sized else box_density(ex, ey, half, Cx, Cy)
                    track[G], detection[G], log[G], G = t, j, place + rate, G + 1
    return track[:G], detection[:G], log[:G]


@compiled
def measure_clutter(z: Detections, detection: NDArray, p: Rules) -> None:
    """(MOT.49): clutter in place, measured by the false alarms of sensors that have too many."""
    least, times, dx, dy, dr = p.alarms
    M, S = len(z.rate), len(p.sheets.clutter)
    loose, count = np.empty(M, np.bool_), np.zeros(S)
    for j in range(M):
        loose[j] = not z.static[j] and math.isfinite(z.rate[j])
    for j in detection:
        loose[j] = False
    for j in range(M):
        count[z.sensor[j]] += loose[j]
    for s in range(S):
        sheet = max(p.sheets.clutter[s], 1.0)
        if not count[s] > least + times * sheet:
            continue
        cells, seen = 0, np.empty((int(count[s]), 3))
        for j in range(M):
            if loose[j] and z.sensor[j] == s:
                a, b, c = math.floor(z.xy[j, 0] / dx), math.floor(z.xy[j, 1] / dy), math.floor(z.rate[j] / dr)
                new = True
                for i in range(cells):
                    new &= seen[i, 0] != a or seen[i, 1] != b or seen[i, 2] != c
                if new:
                    seen[cells, 0], seen[cells, 1], seen[cells, 2], cells = a, b, c, cells + 1
        if cells > least + times * sheet:
            for j in range(M):
                if z.sensor[j] == s:
                    z.clutter[j] *= cells / sheet


@compiled
def claim(g: Boxes, x: Sizes, z: Detections, v: View, alive: NDArray, hidden: NDArray, p: Rules) -> Claimed:
    """(MOT.20) to (MOT.24): the owners of the detections, whose clutter is measured, and ratios of existence."""
    _, _, _, _, own_above, least_expected, fades, surprise = p.association
    _, _, _, _, k, floor, cap, missing, least, most, _ = p.existence
    track, detection, log = gate(g, x, z, p)
    measure_clutter(z, detection, p)
    T, M = len(alive), len(z.rate)
    best, total, best_gain, owner = np.zeros(M), np.zeros(M), np.zeros(M), np.full(M, -1)
    for i in range(len(track)):
        t, j = track[i], detection[i]
        some = least_expected * max(math.exp(-hidden[t] / fades), surprise)  # (MOT.64)
        gain = max(v.expected[z.sensor[j], t], some) * math.exp(log[i]) / z.clutter[j]  # (MOT.20)
        total[j] += alive[t] * gain
        if alive[t] * gain > best[j]:  # of equals the first
            best[j], best_gain[j], owner[j] = alive[t] * gain, gain, t
    count, evidence, expected, log_ratio = np.zeros(T, np.int64), np.zeros(T), np.zeros(T), np.empty(T)
    for j in range(M):
        if not best[j] / (1 + total[j]) > own_above:  # (MOT.21), (MOT.22)
            owner[j] = -1
        if owner[j] >= 0:
            count[owner[j]] += 1
            evidence[owner[j]] += min(math.log1p(best_gain[j]), cap)  # (MOT.24)
    for t in range(T):
        for s in range(len(v.expected)):
            expected[t] += v.expected[s, t] * v.certain[s, t]
        seen = min(max(evidence[t] - missing * min(expected[t], 6.0), least), most)  # (MOT.24)
        missed = math.log(max((1 + expected[t] / k) ** -k, floor))  # (MOT.23)
        log_ratio[t] = seen if count[t] > 0 else missed
    return Claimed(alive, owner, count, expected, log_ratio)


@compiled
def share(owner: NDArray, z: Detections, T: int, most: int) -> tuple[NDArray, NDArray]:
    """The detections (G, 14) of T tracks, at most so many of each, in columns as in `tables`, and where each begins.

    Of more, evenly spaced ones are taken, as by `trackers.multi.association.shares`.
    """
    M, start, all_of = len(owner), np.zeros(T + 1, np.int64), np.zeros(T, np.int64)
    for t in owner:
        if t >= 0:
            all_of[t] += 1
    for t in range(T):
        start[t + 1] = start[t] + min(all_of[t], most)
    rows, mine = np.empty((start[T], 14)), np.empty(M, np.int64)
    for t in range(T):
        n = 0
        for j in range(M):
            if owner[j] == t:
                mine[n], n = j, n + 1
        some = start[t + 1] - start[t]
        for i in range(some):
            j, row = mine[i], rows[start[t] + i]
            if n > some:
                j = mine[n - 1 if i == some - 1 > 0 else int(np.rint(i * ((n - 1) / max(some - 1, 1))))]
            along, across, rate = z.noise[j, 0], z.polar[j, 0] * z.noise[j, 1], z.noise[j, 2]
            row[UX], row[UY], row[RANGE], row[RATE] = z.sight[j, 0], z.sight[j, 1], z.polar[j, 0], z.rate[j]
            row[POSE], row[POSE + 1], row[POSE + 2], row[SENSOR] = z.pose[j, 0], z.pose[j, 1], z.pose[j, 2], z.sensor[j]
            row[8], row[9], row[10], row[11], row[12], row[13] = along, across, across, rate, along, across
    return rows, start

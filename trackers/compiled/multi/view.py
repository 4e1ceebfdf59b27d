"""What the sensors should see of the predicted tracks; docs/methods/multi-object-tracking.md, sections 2 to 4."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.linear import wrap
from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.rules import Boxes, Detections, Lanes, Rules, View

RAYS, NEARER, SHADOW, LEAST_END = 9, 1.0, 0.5, 0.5  # as in `trackers.multi.visibility`
DEEPER = 1.25  # as in `trackers.multi.association`


@compiled
def within(a: NDArray, least: NDArray, most: NDArray, optional: NDArray) -> bool:
    """Whether the numbers a (N, C) are within bounds (C,), or NaN where that is allowed (C,)."""
    for i in range(a.shape[0]):
        for c in range(a.shape[1]):
            if not (least[c] <= a[i, c] <= most[c]) and not (optional[c] and math.isnan(a[i, c])):
                return False
    return True


@compiled
def locate(x: float, y: float, lanes: Lanes) -> tuple[float, float]:
    """(MOT.27): depth [m] of a point inside the nearest lane, and its direction [rad]."""
    best, direction = -np.inf, 0.0
    for i in range(len(lanes.half_width)):
        ex, ey = lanes.b[i, 0] - lanes.a[i, 0], lanes.b[i, 1] - lanes.a[i, 1]
        dx, dy = x - lanes.a[i, 0], y - lanes.a[i, 1]
        t = min(max((dx * ex + dy * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        depth = lanes.half_width[i] - math.hypot(dx - t * ex, dy - t * ey)
        if depth > best:
            best, direction = depth, math.atan2(ey, ex)
    return best, direction


@compiled
def sort(
    order: NDArray, polar: NDArray, pose: NDArray, velocity: NDArray, noise: NDArray, sensor: NDArray, p: Rules
) -> Detections:
    """(MOT.1) to (MOT.6), (MOT.28): the detections of a scan in this order (M,), and what association needs of them."""
    M, s = len(order), p.sheets
    rate_least, anywhere, in_lanes, least, most = p.static
    z = Detections(
        np.empty((M, 3)), np.empty((M, 3)), np.empty((M, 2)), np.empty((M, 3)), np.empty(M, np.int64),
        np.empty((M, 2)), np.empty((M, 2)), np.empty(M), np.empty(M), np.empty(M), np.empty(M, np.bool_),
        np.empty(M, np.bool_), np.empty(M),
    )  # fmt: skip
    for i in range(M):
        j = order[i]
        z.sensor[i] = sensor[j if len(sensor) > 1 else 0]
        z.polar[i], z.pose[i] = polar[j], pose[j if len(pose) > 1 else 0]
        z.velocity[i], z.noise[i] = velocity[j if len(velocity) > 1 else 0], noise[j if len(noise) > 1 else 0]
        for c in range(3):
            if math.isnan(z.noise[i, c]):
                z.noise[i, c] = s.noise[z.sensor[i], c]
        bearing = z.polar[i, 1] + z.pose[i, 2]
        ux, uy = math.cos(bearing), math.sin(bearing)
        z.sight[i, 0], z.sight[i, 1] = ux, uy
        z.xy[i, 0], z.xy[i, 1] = z.pose[i, 0] + z.polar[i, 0] * ux, z.pose[i, 1] + z.polar[i, 0] * uy
        vx, vy = z.velocity[i, 0], z.velocity[i, 1]
        z.rate[i] = z.polar[i, 2] + (ux * vx + uy * vy)  # (MOT.2)
        sigma = math.hypot(z.noise[i, 2], (ux * vy - uy * vx) * z.noise[i, 1])  # (MOT.4)
        z.static[i] = abs(z.rate[i]) < max(rate_least, 3 * sigma)  # (MOT.5)
        z.var_along[i], z.var_across[i] = z.noise[i, 0] ** 2, (z.polar[i, 0] * z.noise[i, 1]) ** 2  # (MOT.3)
        unknown = math.isnan(z.rate[i])
        z.clutter[i] = s.clutter_density_2d[z.sensor[i]] if unknown else s.clutter_density[z.sensor[i]]
        z.in_lane[i] = False
        if z.static[i]:
            depth, course = locate(z.xy[i, 0], z.xy[i, 1], p.lanes) if p.lanes.known else (-np.inf, 0.0)
            side = math.cos(course) * uy - math.sin(course) * ux
            across = math.sqrt(z.var_along[i] * side**2 + z.var_across[i] * (1 - side**2))
            z.in_lane[i] = depth > min(max(least, DEEPER * across), most)  # (MOT.28)
            z.clutter[i] += in_lanes if depth > least else anywhere  # (MOT.6)
    return z


@compiled
def entered(ox: float, oy: float, dx: float, dy: float, half_x: float, half_y: float) -> float:
    """Distance at which a ray from o along d enters a box, all in its axes; inf for a miss."""
    x0, x1, y0, y1 = (-half_x - ox) / dx, (half_x - ox) / dx, (-half_y - oy) / dy, (half_y - oy) / dy
    if x0 > x1 or math.isnan(x0):
        x0, x1 = x1, x0
    if y0 > y1 or math.isnan(y0):
        y0, y1 = y1, y0
    near, far = max(x0, y0), min(x1 if not math.isnan(x1) else x0, y1 if not math.isnan(y1) else y0)
    return max(near, 0.0) if near <= far and far >= 0 else np.inf


@compiled
def span(x: NDArray, size: NDArray, cos: float, sin: float, sensor: NDArray) -> tuple[float, float, float]:
    """(MOT.8): lowest and highest azimuth [rad] of a box at x (3,) from a sensor (3,), and its nearest corner [m]."""
    cx, cy = x[0] - sensor[0], x[1] - sensor[1]
    middle, low, high, nearest = math.atan2(cy, cx), np.inf, -np.inf, np.inf
    for a in (-0.5, 0.5):
        for b in (-0.5, 0.5):
            u, v = a * size[0], b * size[1]
            dx, dy = cx + cos * u - sin * v, cy + sin * u + cos * v
            offset = wrap(math.atan2(dy, dx) - middle)
            low, high, nearest = min(low, offset), max(high, offset), min(nearest, math.hypot(dx, dy))
    azimuth = wrap(middle - sensor[2])
    return azimuth + low, azimuth + high, nearest


@compiled
def azimuth_std(x: NDArray, cov: NDArray, sensor: NDArray) -> float:
    """Standard deviation [rad] of the azimuth of a centre x (3,) from a sensor (3,)."""
    dx, dy = x[0] - sensor[0], x[1] - sensor[1]
    var = dy * (dy * cov[0, 0] - dx * cov[0, 1]) - dx * (dy * cov[1, 0] - dx * cov[1, 1])
    return math.sqrt(var) / max(dx * dx + dy * dy, 1.0)


@compiled
def stand(mount: NDArray, platform: NDArray, sensor: NDArray) -> None:
    """Pose sensor (3,), in place, of a sensor at mount (3,) on a platform (6,)."""
    c, n = math.cos(platform[2]), math.sin(platform[2])
    sensor[0] = platform[0] + (c * mount[0] - n * mount[1])
    sensor[1] = platform[1] + (n * mount[0] + c * mount[1])
    sensor[2] = platform[2] + mount[2]


@compiled
def see(box: Boxes, occluder: NDArray, platform: NDArray, p: Rules) -> View:
    """(MOT.8) to (MOT.12), (MOT.53): what sensors should see of T predicted tracks; occluder (T,) bool hide others."""
    s, S, T = p.sheets, len(p.sheets.fov), len(box.pose)
    no, yes = np.zeros(T, np.bool_), np.ones(T, np.bool_)
    v = View(np.zeros((S, T)), no, np.zeros((S, T)), np.zeros(T), yes, no.copy(), np.zeros((S, T)), np.zeros(S))
    of_end = np.full(T, -1.0)  # as of a track of which no end is turned to a sensor
    cos, sin, sensor = np.cos(box.pose[:, 2]), np.sin(box.pose[:, 2]), np.empty(3)
    _, _, rate_factor, edge_sigmas = p.occlusion
    for k in range(S):
        stand(s.mount[k], platform, sensor)
        edge = s.fov[k] / 2
        for t in range(T):
            low, high, nearest = span(box.pose[t], box.size[t], cos[t], sin[t], sensor)
            uncut = high - low
            low, high = max(low, -edge), min(high, edge)
            if not (high > low and nearest < s.max_range[k]):
                continue
            seen, ends, ends_seen, first = 0, 0, 0, np.inf
            for ray in range(RAYS):
                bearing = (sensor[2] + low) + (high - low) * ((ray + 0.5) / RAYS)  # (MOT.9)
                dx, dy, own, shadow = math.cos(bearing), math.sin(bearing), np.inf, np.inf
                for b in range(T):
                    if b != t and not occluder[b]:
                        continue
                    wider = 0.0 if b == t else SHADOW
                    ox, oy = sensor[0] - box.pose[b, 0], sensor[1] - box.pose[b, 1]
                    r = entered(
                        cos[b] * ox + sin[b] * oy, cos[b] * oy - sin[b] * ox, cos[b] * dx + sin[b] * dy,
                        cos[b] * dy - sin[b] * dx, box.size[b, 0] / 2 + wider, box.size[b, 1] / 2 + wider,
                    )  # fmt: skip
                    if b == t:
                        own = r
                    elif r > 0:
                        shadow = min(shadow, r)
                if not own < s.max_range[k]:
                    continue
                x, y = sensor[0] + own * dx - box.pose[t, 0], sensor[1] + own * dy - box.pose[t, 1]
                on_end = abs(cos[t] * x + sin[t] * y) * box.size[t, 1] > abs(cos[t] * y - sin[t] * x) * box.size[t, 0]
                ends += on_end
                if shadow > own - NEARER - SHADOW:  # (MOT.10)
                    seen, ends_seen, first = seen + 1, ends_seen + on_end, min(first, own)
            v.in_view[t], v.share[k, t] = True, seen / RAYS
            unsure = edge_sigmas * azimuth_std(box.pose[t], box.cov[t], sensor) if edge < math.pi else 0.0
            sure = min(high, edge - unsure) - max(low, unsure - edge)
            v.certain[k, t] = math.sqrt(max(sure, 0.0) / max(high - low, 1e-9))  # (MOT.59)
            of_end[t] = max(of_end[t], ends_seen / ends if ends else -1.0)
            v.complete[t] = max(v.complete[t], seen / RAYS * (high - low) / uncut)  # (MOT.12)
            if seen:
                v.hidden[t] = False
                rate = s.rates[k, 0] * (15.0 / max(first, 1.0)) ** s.rates[k, 1] * math.sqrt((high - low) * first / 3)
                share = min(1.0, 3 * v.share[k, t])
                v.expected[k, t] = rate_factor * min(rate, s.rates[k, 2]) * share  # (MOT.11)
    for t in range(T):
        v.end_hidden[t] = 0 <= of_end[t] < LEAST_END  # (MOT.53)
    return v


@compiled
def silence(v: View, before: NDArray, heard: NDArray, existence: NDArray, p: Rules) -> None:
    """(LIFE.19) to (LIFE.22): probability v.out (S,) that each sensor is out; before (S,), heard (S,) bool."""
    begins, lasts, k, clutter_share = p.outage
    quiet = np.empty(len(heard))
    for s in range(len(heard)):
        quiet[s] = -clutter_share * p.sheets.clutter[s]
        for t in range(len(existence)):
            quiet[s] += math.log1p(existence[t] * ((1 + v.expected[s, t] / k) ** -k - 1))  # (LIFE.19)
    for s in range(len(heard)):
        prior = begins + (lasts - begins) * before[s]  # (LIFE.21)
        odds = math.log(prior / (1 - prior)) - (quiet[s] if heard.any() else quiet.sum())  # (LIFE.20)
        v.out[s] = 0.0 if heard[s] else 1 / (1 + math.exp(-odds))  # (LIFE.22)


@compiled
def survive(v: View, existence: NDArray, dt: float, p: Rules, alive: NDArray) -> None:
    """(LIFE.23), (MOT.13): what sensors that are not out should see, in place, and existence (T,) after dt."""
    visible, hidden, silent, outside = p.existence[0], p.existence[1], p.existence[2], p.existence[3]
    for t in range(len(existence)):
        seen = False
        for s in range(len(v.out)):
            v.expected[s, t] *= 1 - v.out[s]  # (LIFE.23)
            if v.out[s] > 0.5:
                v.share[s, t] = 0.0
            seen |= v.share[s, t] > 0
        life = visible if seen else (hidden if v.hidden[t] else silent) if v.in_view[t] else outside
        alive[t] = existence[t] * math.exp(-dt / life)  # (MOT.13)

"""The two compiled calls of a step of many objects: from the scan to the claims, and from the update to leftovers."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.multi.claims import claim, reach, share
from trackers.compiled.multi.jit import compiled
from trackers.compiled.multi.leftovers import candidates, gather, quiet, remembered
from trackers.compiled.multi.partial import turned
from trackers.compiled.multi.rules import Boxes, Claimed, Detections, Limits, Pool, Rules, Sizes, View
from trackers.compiled.multi.view import see, silence, sort, survive, within


class Rest(NamedTuple):
    """What is left of a scan after the update, and which rare things happen."""

    existence: NDArray  # (T,)
    candidate: NDArray  # (M,) bool
    window: Pool  # of the next step, where no cell is born
    calm: bool  # no cell is born
    dies: bool  # some track dies
    apart: bool  # no two tracks are one vehicle
    long: bool  # some track may be two vehicles


@compiled
def plausible(
    polar: NDArray, pose: NDArray, velocity: NDArray, noise: NDArray, platform: NDArray, sensor: NDArray, S: int,
    limits: Limits,
) -> bool:  # fmt: skip
    """Whether all numbers of a scan of S sensors are those of radars, padding included."""
    for s in sensor:
        if s < 0 or s >= S:
            return False
    good = within(polar, *limits.polar) and within(pose, *limits.pose) and within(velocity, *limits.velocity)
    return good and within(noise, *limits.noise) and within(platform.reshape(1, -1), *limits.platform)


@compiled
def seen(
    order: NDArray, polar: NDArray, pose: NDArray, velocity: NDArray, noise: NDArray, sensor: NDArray,
    platform: NDArray, box: Boxes, size: Sizes, existence: NDArray, hits: NDArray, hidden: NDArray, told: bool,
    before: NDArray, dt: float, p: Rules,
) -> tuple[Detections, View, Claimed]:  # fmt: skip
    """The sorted scan, what sensors should see of predicted tracks, and the claims.

    before (S,) is the probability that each sensor was out; if `told`, that it is so now.
    """
    T, S = len(existence), len(p.sheets.fov)
    occlude_above, occlude_hits, _, _ = p.occlusion
    z = sort(order, polar, pose, velocity, noise, sensor, p)
    view = see(box, (existence > occlude_above) & (hits > occlude_hits), platform, p)
    heard, alive = np.zeros(S, np.bool_), np.empty(T)
    if told:
        view.out[:] = before
    else:
        for s in z.sensor:
            heard[s] = True
        silence(view, before, heard, existence, p)
    survive(view, existence, dt, p, alive)
    return z, view, claim(reach(box, size, p.sheets) if len(size.pose) else box, size, z, view, alive, hidden, p)


@compiled
def inside(box: Boxes, a: int, b: int) -> float:
    """(MOT.42): share of a grid of 15 points of box a that lie in box b."""
    ca, sa, cb, sb = (
        math.cos(box.pose[a, 2]),
        math.sin(box.pose[a, 2]),
        math.cos(box.pose[b, 2]),
        math.sin(box.pose[b, 2]),
    )
    n = 0
    for i in range(5):
        for j in range(3):
            u, v = (-0.4 + 0.2 * i) * box.size[a, 0], (j - 1) / 3 * box.size[a, 1]
            x, y = box.pose[a, 0] + ca * u - sa * v - box.pose[b, 0], box.pose[a, 1] + sa * u + ca * v - box.pose[b, 1]
            n += abs(cb * x + sb * y) < box.size[b, 0] / 2 and abs(cb * y - sb * x) < box.size[b, 1] / 2
    return n / 15


@compiled
def in_file(box: Boxes, a: int, b: int, touching: bool, p: Rules) -> bool:
    """(MOT.44), (MOT.52): whether b is in the lane of a, nearer than two vehicles, or those of a column, drive."""
    _, _, _, lane, _, _, most, base, slope = p.exclusion
    c, s = math.cos(box.pose[a, 2]), math.sin(box.pose[a, 2])
    dx, dy = box.pose[b, 0] - box.pose[a, 0], box.pose[b, 1] - box.pose[a, 1]
    more = slope * (box.velocity[a, 0] ** 2 + box.velocity[a, 1] ** 2)
    gap = abs(c * dx + s * dy) - (box.size[a, 0] + box.size[b, 0]) / 2
    near = gap < base and more > base if touching else gap < min(most, base + more)
    return near and abs(c * dy - s * dx) < lane


@compiled
def ahead(box: Boxes, a: int, b: int) -> int:
    """Whether b is ahead of a."""
    c, s = math.cos(box.pose[a, 2]), math.sin(box.pose[a, 2])
    return int(c * (box.pose[b, 0] - box.pose[a, 0]) + s * (box.pose[b, 1] - box.pose[a, 1]) > 0)


@compiled
def apart(box: Boxes, divided: NDArray, p: Rules) -> bool:
    """(MOT.42) to (MOT.44): whether no two tracks may be one vehicle; over divided ends (T, 2) bool short ones only."""
    overlap, overlap_speed, sure, _, speed, short, _, _, _ = p.exclusion
    for a in range(len(box.pose)):
        for b in range(a):
            d = math.hypot(box.pose[a, 0] - box.pose[b, 0], box.pose[a, 1] - box.pose[b, 1])
            v = math.hypot(box.velocity[a, 0] - box.velocity[b, 0], box.velocity[a, 1] - box.velocity[b, 1])
            radius = math.hypot(box.size[a, 0], box.size[a, 1]) / 2 + math.hypot(box.size[b, 0], box.size[b, 1]) / 2
            if d < radius:
                share = max(inside(box, a, b), inside(box, b, a))
                if (share > overlap and v < overlap_speed) or share > sure:  # (MOT.43)
                    return False
            parallel = math.cos(box.pose[a, 2] - box.pose[b, 2]) > 0.9
            long = d + (box.size[a, 0] + box.size[b, 0]) / 2 >= short
            some = long and (divided[a].any() or divided[b].any())
            if some and (divided[a, ahead(box, a, b)] or divided[b, ahead(box, b, a)]):
                continue
            if v < speed and parallel and in_file(box, a, b, some, p) and in_file(box, b, a, some, p):
                return False
    return True


@compiled
def rest(
    box: Boxes, alive: NDArray, log_ratio: NDArray, owner: NDArray, z: Detections, window: Pool, way: NDArray,
    time: float, dt: float, divided: NDArray, p: Rules,
) -> Rest:  # fmt: skip
    """Existence after the scan, leftovers and the window, and what of the rest of a step has to be done."""
    below, most_std, ground_above, longer = p.end
    T, existence, dies, long = len(alive), np.empty(len(alive)), False, False
    for t in range(T):
        L = math.exp(log_ratio[t])
        existence[t] = min(alive[t] * L / (1 - alive[t] + alive[t] * L), p.existence[-1])  # (MOT.25)
        a, b, d = box.cov[t, 0, 0], box.cov[t, 0, 1], box.cov[t, 1, 1]
        dies |= existence[t] < below or (a + d) / 2 + math.hypot((a - d) / 2, b) > most_std**2  # (MOT.47)
        long |= existence[t] > ground_above and box.size[t, 0] > longer
    free = candidates(z, owner, box, existence, p)
    pool, fresh = gather(window, free, z, way, dt, box, existence, p)
    calm = fresh <= p.window[-1] and quiet(pool, time, dt, p)
    return Rest(existence, free, remembered(pool, p), calm, dies, apart(box, divided, p), long)


see_all = compiled.first(seen, "claims of tracks", 20)
finish_all = compiled.first(rest, "leftovers of tracks", 15)
share_all = compiled.first(share, "shares of tracks", 2)
turn_all = compiled.first(turned, "turns of detections", 3)
plausible_all = compiled.first(plausible, "limits of scans", 2)

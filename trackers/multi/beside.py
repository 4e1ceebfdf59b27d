"""A long track: one vehicle, or two in neighbouring lanes that noise across the line of sight joins.

Far away its gate reaches over the next lane, as does that of a new track nearer by, whose length is not known yet. What
it takes from that lane starts no track of its own. Along the line of sight detections are sharp: where those behind and
those ahead lie in different lanes, there are two vehicles. Far away there are, too, where they crowd in two lanes.
Equations: docs/methods/life-cycle-of-tracks.md, section 7.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import concatenate, keep, take
from trackers.geometry import perpendicular
from trackers.multi.association import SortedScan
from trackers.parameters import check_numbers

STEP = 0.5  # [m] of the places across that two vehicles abreast are tried at
SHARES = (0.25, 0.5, 0.75)  # of the detections that are of the one on the left
STRAY = 0.1  # share of the detections of a track that are of neither
SOME = 100  # densities whose product is no less than a float can be


class Taken(NamedTuple):
    """P noisy detections that long tracks took in the last scans."""

    id: NDArray  # (P,) int, of the track
    xy: NDArray  # (P, 2) [m] where it was seen
    var: NDArray  # (P,) [m^2] noise across the line of sight
    place: NDArray  # (P, 2) [m] of the sensor
    age: NDArray  # (P,) [s]
    row: NDArray  # (P,) int, in the sorted scan; -1 of earlier ones


NOTHING = Taken(np.zeros(0, int), np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0, int))


class Pair(NamedTuple):
    """A track that is two vehicles, which share its speed."""

    track: int  # place among those that were asked about
    across: float  # [m] from the lane of the one behind to that of the one ahead, positive to the left
    velocity: NDArray  # (2,) [m/s] of both
    parts: tuple[Taken, Taken]  # of the one behind and of the one ahead, where they should be now


Rule = Callable[[Taken, NDArray, NDArray, float], tuple[bool, float, NDArray]]


@dataclass(frozen=True)
class BesideTest:
    """When a long track is two vehicles in neighbouring lanes."""

    memory: float = 3.0  # [s]
    noisy: float = 0.2  # [m] least noise across of a detection: a step across that is sharper is a turned or bent body
    wide: float = 1.0  # [m] least spread across the line of sight, beside the noise, of what may be of two lanes
    fast: float = 8.0  # [m/s] below it a body with a hinge may bend so far
    curved: float = 1.0  # [m/s^2] across, from which on the way is curved, and nothing is said of it
    body: float = 0.6  # [m] standard deviation across a vehicle of what is seen of it
    within: float = 1.5  # [m] between the means of two parts of one vehicle, as of its rear and of a side, at most
    lanes: tuple[float, float] = (3.0, 6.0)  # [m] between the means of two vehicles
    independent: float = 0.5  # share of the detections: those of one scan are not independent
    surer: float = 4.0  # standard deviations beyond `within` from which it is two
    least: int = 4  # detections of each of the two
    far: float = 0.5  # [m] mean noise across of the detections, from which two abreast are told apart
    bent: float = 1.2  # [m] as `body`, of a vehicle that is turned or bent
    likelier: float = 2.0  # log likelihood ratio from which it is two abreast
    crowd: int = 12  # detections of each of two abreast
    level: float = 0.3  # difference from a half of how often the left one of two detections is ahead

    def __post_init__(self) -> None:
        check_numbers(self, positive=("least", "crowd"))
        if not self.lanes[0] + STEP <= self.lanes[1]:
            raise ValueError(
                f"BesideTest.lanes must be two distances {STEP} m apart or more, the lesser first, got {self.lanes}"
            )

    def observe(self, taken: Taken, d: NDArray, id: NDArray, z: SortedScan, owner: NDArray, dt: float) -> Taken:
        """What the tracks with rows d (D,) of ids id (T,) took, after a scan of M detections with their owners (M,)."""
        new = np.flatnonzero((owner >= 0) & (z.var_across > self.noisy**2))
        new = new[np.isin(owner[new], d)]
        if not len(new) and not len(taken.id):
            return NOTHING
        old = taken._replace(age=taken.age + dt, row=np.full(len(taken.id), -1))
        old = keep(old, np.isin(old.id, id[d]) & (old.age < self.memory))
        of_scan = Taken(id[owner[new]], z.xy[new], z.var_across[new], z.scan.pose[new, :2], np.zeros(len(new)), new)
        return concatenate([old, of_scan])

    def pairs(self, taken: Taken, id: NDArray, velocity: NDArray, curvature: NDArray | float = 0.0) -> list[Pair]:
        """Those of the tracks with ids (D,) and velocities (D, 2) [m/s] that took detections of two lanes.

        curvature (D,) [1/m] is that of their lanes, positive to the left. Both vehicles have a detection in this scan,
        so that they can start from it.
        """
        found, bend = [], np.broadcast_to(curvature, len(id))
        for k, speed in enumerate(np.hypot(*velocity.T)):
            rows = np.flatnonzero(taken.id == id[k])
            if len(rows) < 2 * self.least or speed < self.fast:
                continue
            mine, along = take(taken, rows), velocity[k] / speed
            sag = bend[k] * (speed * mine.age) ** 2 / 2  # (LIFE.58)
            mine = mine._replace(xy=mine.xy - sag[:, None] * perpendicular(along))  # (LIFE.58)
            if not self._wide(mine.xy - mine.place, mine.var):
                continue
            noisy = mine.var.mean() > self.far**2 and abs(bend[k]) * speed**2 < 2 * self.curved
            rules = (self._behind, self._abreast) if noisy else (self._behind,)
            pair = next(filter(None, (self._two(k, mine, speed, along, rule) for rule in rules)), None)
            found += [pair] if pair else []
        return found

    def _wide(self, away: NDArray, var: NDArray) -> bool:
        """Whether detections (P, 2) [m] from their sensors spread by more than a vehicle across the line of sight."""
        sight = away.mean(0)
        y = away @ perpendicular(sight) / np.hypot(*sight)
        return bool(y.var() > var.mean() + self.wide**2)  # (LIFE.44)

    def _two(self, track: int, mine: Taken, speed: float, along: NDArray, rule: Rule) -> Pair | None:
        """The vehicles that detections are of, if there are two by a rule.

        The direction of the track may be the way from one vehicle to the other, so it is that in which the detections
        moved, and then that in which both groups did.
        """
        second = np.zeros(len(mine.id), bool)
        for _ in range(2):
            along, std, straight = self._course(mine, along, second)  # (LIFE.40)
            now = mine._replace(xy=mine.xy + mine.age[:, None] * (speed * along))  # (LIFE.41)
            found, across, second = rule(now, now.xy @ along, now.xy @ perpendicular(along), std / speed)
        parts = take(now, ~second), take(now, second)
        if found and (parts[1].xy.mean(0) - parts[0].xy.mean(0)) @ along < 0:  # the one behind comes first
            parts, across = parts[::-1], -across
        both = found and straight and all((part.row >= 0).any() for part in parts)
        return Pair(track, across, speed * along, parts) if both else None

    def _course(self, mine: Taken, along: NDArray, second: NDArray) -> tuple[NDArray, float, bool]:
        """Unit vector (2,) along which detections of two groups moved, the std [m/s] of their speed across it.

        And whether they moved straight ahead. Without a time between them the vector is `along`.
        """
        t, xy = centred(-mine.age, second), centred(mine.xy, second)
        total = np.maximum(t @ t, 1e-9)
        v = t @ xy / total  # (LIFE.40)
        along = v / np.hypot(*v) if np.hypot(*v) > 0 else along
        y = (xy - t[:, None] * v) @ perpendicular(along)
        q = centred(mine.age**2 / 2, second)
        q = q - (q @ t / total) * t
        bend, sharp = q @ y / max(q @ q, 1e-9), y.std() / np.sqrt(self.independent * max(q @ q, 1e-9))
        straight = abs(bend) < max(self.curved, 2 * sharp)  # (LIFE.45)
        return along, float(y.std() / np.sqrt(self.independent * total)), bool(straight)  # (LIFE.40)

    def _behind(self, mine: Taken, x: NDArray, y: NDArray, turn: float) -> tuple[bool, float, NDArray]:
        """Whether detections (P,) lie in one lane and, ahead of them, in another; how far apart, and which are ahead.

        x and y [m] are their places along and across, turn [rad] is the standard deviation of the direction of x.
        """
        order = np.argsort(x, kind="stable")
        x, y, w = x[order], y[order], self.independent / (mine.var[order] + self.body**2)
        W, X, Y = np.cumsum(w), np.cumsum(w * x), np.cumsum(w * y)
        last = np.arange(self.least - 1, len(y) - self.least)  # the last one behind
        behind, ahead = W[last], W[-1] - W[last]
        along, across = ((S[-1] - S[last]) / ahead - S[last] / behind for S in (X, Y))  # (LIFE.42)
        sure = (np.abs(across) - self.within) / np.sqrt(1 / behind + 1 / ahead + (turn * along) ** 2)  # (LIFE.42)
        k = int(sure.argmax())
        found = sure[k] > self.surer and self.lanes[0] < abs(across[k]) < self.lanes[1]
        return bool(found), float(across[k]), np.isin(np.arange(len(x)), order[last[k] + 1 :])

    def _abreast(self, mine: Taken, x: NDArray, y: NDArray, turn: float) -> tuple[bool, float, NDArray]:
        """Whether detections (P,) crowd in two lanes, neither ahead; how far apart, and which are on the left."""
        if len(y) < 2 * self.crowd:
            return False, 0.0, np.zeros(len(y), bool)
        places = np.median(y) + np.arange(-self.lanes[1], self.lanes[1] + STEP / 2, STEP)
        any_place = STRAY / (2 * self.lanes[1])  # [1/m]
        near, bent = (
            (1 - STRAY) * density(y, places, mine.var + std**2) + any_place  # (LIFE.59)
            for std in (self.body, self.bent)
        )
        gaps = range(int(np.ceil(self.lanes[0] / STEP)), int(self.lanes[1] / STEP) + 1)
        tried = [
            (*likeliest((1 - part) * near[:, :-gap] + part * near[:, gap:]), gap, part)
            for gap, part in product(gaps, SHARES)
        ]
        two, k, apart, share = max(tried, key=lambda one: one[0])
        more = two - max(likeliest(each)[0] for each in (near, bent))
        right, other = density(y, places[[k, k + apart]], mine.var + self.body**2).T
        left = share * other > (1 - share) * right
        if not self.crowd <= left.sum() <= len(y) - self.crowd:
            return False, apart * STEP, left
        level = abs(np.mean(x[left, None] > x[~left]) - 0.5) < self.level  # (LIFE.61)
        return bool(level and self.independent * more > self.likelier), apart * STEP, left  # (LIFE.60)


def likeliest(p: NDArray) -> tuple[float, int]:
    """The greatest log likelihood of the columns of densities p (P, C) [1/m], and whose it is."""
    some = np.multiply.reduceat(p, np.arange(0, len(p), SOME), axis=0)
    total = np.log(some).sum(0)  # (LIFE.59): a logarithm of each would take twice as long
    return float(total.max()), int(total.argmax())


def density(y: NDArray, places: NDArray, var: NDArray) -> NDArray:
    """Gaussian densities (P, C) [1/m] of y (P,) [m] about places (C,) with variances (P,)."""
    return np.exp(-0.5 * (y[:, None] - places) ** 2 / var[:, None]) / np.sqrt(2 * np.pi * var[:, None])


def centred(values: NDArray, second: NDArray) -> NDArray:
    """Values (P, ...) less the mean of their group, of the second (P,) bool or of the first."""
    values = values.copy()
    for group in (second, ~second):
        values[group] -= values[group].mean(0) if group.any() else 0.0
    return values


def owners(parts: Sequence[Taken], detections: int) -> NDArray:
    """The part that each of the detections (M,) of this scan belongs to, -1 for none."""
    owner = np.full(detections, -1)
    for k, part in enumerate(parts):
        owner[part.row[part.row >= 0]] = k
    return owner

"""Velocities and yaw rates against places and headings. Equations: docs/methods/plausibility.md."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from testbed.replay.fixes import DOUBT, FACTORS, FAULT, GOOD, NEAR, OPEN, SPEEDS, Finding
from testbed.replay.recording import RecordedFrame
from trackers.geometry import dot, unit

WINDOW = 1.0  # [s] over which motion is compared with places
OFTEN, APART = 0.1, 0.5  # share of the windows that must show motion, and by which share both may differ
TURN, DRIVE = 0.05, 2.5  # [rad/s], [m/s] from which on there is motion
SCALE = 0.2  # share up to which a speed may differ from that of the places
LONG, LEAST = 3.0, 10  # [m] least length of a vehicle, and boxes that must move


class Ways(NamedTuple):
    """W windows: what places or headings did and what a rate says, (W, D) each, a second."""

    went: NDArray
    said: NDArray

    @classmethod
    def of(cls, time: NDArray, value: NDArray, rate: NDArray) -> Self:
        """Of values (K, D) and their rates at K times, K at least 1, over windows of a second or all there is."""
        length = min(WINDOW, float(np.ptp(time)))
        first = np.flatnonzero((time + length <= time[-1] + 1e-9) & (length > 0))
        last = np.minimum(np.searchsorted(time, time[first] + length - 1e-9), len(time) - 1)
        whole = time[last] - time[first] <= 1.5 * length  # else there is a pause in it
        first, last = first[whole], last[whole]
        way = np.cumsum(np.diff(time, prepend=time[:1])[:, None] * (rate + np.roll(rate, 1, 0)) / 2, axis=0)
        span = (time[last] - time[first])[:, None]
        return cls((value[last] - value[first]) / span, (way[last] - way[first]) / span)

    def judge(self, test: str, unit_: str, least: float, names: Sequence[str], fix: str, rest: str) -> Finding:
        """The finding on them; `names` are factors that may put rates right, else `rest` is what --fix `fix` can be."""
        went, said = (np.linalg.norm(way, axis=-1) for way in self)
        most = np.maximum(went, said)
        use = most > least
        if not use.any() or use.mean() < OFTEN:
            return Finding(test, "no motion to compare", OPEN, OPEN)
        a, b, most = self.said[use], self.went[use], most[use]
        off = float(np.median(np.linalg.norm(a - b, axis=-1) / most))
        factor = float((a * b).sum() / max((a * a).sum(), 1e-12))  # (PLA.5)
        moved, claimed = float(np.median(went[use])), float(np.median(said[use]))
        figure = f"{claimed:.3g} {unit_} against {moved:.3g} {unit_} by places or headings, {off:.0%} off"
        if off <= APART and abs(factor - 1) <= SCALE:
            return Finding(test, figure, GOOD, GOOD)
        left = float(np.median(np.linalg.norm(factor * a - b, axis=-1) / most))
        close = [n for n in names if abs(factor - FACTORS[n]) <= NEAR * abs(FACTORS[n]) and left < NEAR]
        remedy = f"read it with --fix {fix}={close[0] if close else rest}"
        return Finding(test, figure, close[0] if close else "does not fit", FAULT if off > APART else DOUBT, remedy)


def ego_speed(frames: Sequence[RecordedFrame]) -> Finding:
    """Speed and heading of the ego against its places."""
    egos = [f.scene.ego for f in frames]
    pose, ahead = np.array([e.pose for e in egos]), unit([e.pose[2] for e in egos])
    velocity = np.array([e.velocity for e in egos])
    ways = Ways.of(_times(frames), pose[:, :2], dot(velocity, ahead)[:, None] * ahead)  # none across the heading
    found = ways.judge("speed of the ego", "m/s", 2 * DRIVE, SPEEDS, "ego.speed", "places")
    went = float(np.linalg.norm(ways.went, axis=-1).mean()) if len(ways.went) else 0.0
    said = float(np.hypot(*velocity.T).mean())
    if went < NEAR * said:
        return found._replace(remedy="read it with --fix ego.places=speed")
    if found.fits not in SPEEDS and abs(said - went) < NEAR * went:
        return found._replace(remedy="read it with --fix ego.heading=places")
    return found


def yaw_rate(frames: Sequence[RecordedFrame]) -> Finding:
    """Yaw rate of the ego against its headings."""
    egos = [f.scene.ego for f in frames]
    heading, rate = np.unwrap([e.pose[2] for e in egos]), np.array([e.yaw_rate for e in egos])
    drives = np.array([np.hypot(*e.velocity) > 1 for e in egos])
    turned = np.append(0.0, np.cumsum(np.diff(heading) * drives[1:]))  # a course at standstill is noise
    ways = Ways.of(_times(frames), turned[:, None], rate[:, None])
    return ways.judge("yaw rate of the ego", "rad/s", TURN, ("deg", "reversed"), "ego.yaw_rate", "heading")


def truth(frames: Sequence[RecordedFrame]) -> list[Finding]:
    """Velocities and sizes of the truth against its places, none without truth."""
    objects = [f.scene.objects for f in frames]
    if not any(len(o.id) for o in objects):
        return []
    time = np.repeat(_times(frames), [len(o.id) for o in objects])
    number, place, size, speed = (np.concatenate([getattr(o, n) for o in objects])
                                  for n in ("id", "pose", "size", "velocity"))  # fmt: skip
    drives = np.concatenate([np.array(o.kind, np.str_).reshape(-1) != "obstacle" for o in objects])
    each = [rows for n in np.unique(number) if len(rows := np.flatnonzero((number == n) & drives))]
    ways = [Ways.of(time[rows], place[rows, :2], speed[rows]) for rows in each]
    if not ways:
        return []
    joined = Ways(*map(np.concatenate, zip(*ways, strict=True)))
    found = joined.judge("speed of the truth", "m/s", DRIVE, SPEEDS, "truth.speed", "places")
    return [found, _sizes(place[drives, 2], size[drives], speed[drives])]


def _sizes(heading: NDArray, size: NDArray, speed: NDArray) -> Finding:
    """Whether boxes (B,) of vehicles that move lie along their way."""
    moves, test = (np.hypot(*speed.T) > DRIVE) & (size.max(-1) > LONG), "boxes of the truth"
    if moves.sum() < LEAST:
        return Finding(test, "none moves", OPEN, OPEN)
    turned = np.abs(dot(unit(heading), speed)) < np.hypot(*speed.T) / 2
    wide = size[:, 1] > size[:, 0]
    figure = f"{wide[moves].mean():.0%} are wider than long, {turned[moves].mean():.0%} lie across their way"
    if wide[moves].mean() > 0.5:
        return Finding(test, figure, "length and width may be swapped", FAULT, "read it with --fix truth.size=swapped")
    if turned[moves].mean() > 0.5:
        return Finding(test, figure, "headings are not those of the ways", FAULT, "correct heading, or vx and vy")
    return Finding(test, figure, GOOD, GOOD)


def _times(frames: Sequence[RecordedFrame]) -> NDArray:
    return np.array([f.scene.time for f in frames])

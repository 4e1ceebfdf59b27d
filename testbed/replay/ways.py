"""Velocities and yaw rates against places and headings. Equations: docs/methods/plausibility.md."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from testbed.replay.findings import DOUBT, FAULT, GOOD, NEAR, OPEN, Finding
from testbed.replay.fixes import FACTORS, SPEEDS
from testbed.replay.recording import RecordedFrame
from trackers.geometry import unit

WINDOW = 1.0  # [s] over which motion is compared with places
OFTEN, APART = 0.1, 0.5  # share of the windows that must show motion, and by which share both may differ
TURN, DRIVE = 0.05, 2.5  # [rad/s], [m/s] from which on there is motion
SCALE = 0.2  # share up to which a speed may differ from that of the places


class Ways(NamedTuple):
    """W windows: what places or headings did and what a rate says, (W, D) each, a second."""

    went: NDArray
    said: NDArray

    @classmethod
    def of(cls, time: NDArray, value: NDArray, rate: NDArray) -> Self:
        """Of values (K, D) and their rates (K, D) at K times, over windows of a second or all there is."""
        length = min(WINDOW, float(np.ptp(time))) if len(time) else 0.0
        first = np.flatnonzero((time + length <= time[-1:].sum() + 1e-9) & (length > 0))
        last = np.minimum(np.searchsorted(time, time[first] + length - 1e-9), len(time) - 1)
        whole = time[last] - time[first] <= 1.5 * length  # else there is a pause in it
        first, last = first[whole], last[whole]
        steps = np.diff(time)[:, None] * (rate[1:] + rate[:-1]) / 2
        way = np.concatenate([np.zeros((min(len(time), 1), rate.shape[1])), np.cumsum(steps, axis=0)])
        span = (time[last] - time[first])[:, None]
        return cls((value[last] - value[first]) / span, (way[last] - way[first]) / span)

    def judge(self, test: str, unit_: str, least: float, units: Mapping[str, float], remedy: str) -> Finding:
        """The finding on them; `units` are factors that put rates right, and their names."""
        went, said = (np.linalg.norm(way, axis=-1) for way in self)
        most = np.maximum(went, said)
        use = most > least
        if not use.any() or use.mean() < OFTEN:
            return Finding(test, "no motion to compare", OPEN, OPEN)
        off = float(np.median(np.linalg.norm(self.said - self.went, axis=-1)[use] / most[use]))
        a, b = self.said[use], self.went[use]
        factor = float((a * b).sum() / max((a * a).sum(), 1e-12))  # (PLA.5)
        moved, claimed = float(np.median(went[use])), float(np.median(said[use]))
        figure = f"{claimed:.3g} {unit_} against {moved:.3g} {unit_} by places or headings, {off:.0%} off"
        if off <= APART and abs(factor - 1) <= SCALE:
            return Finding(test, figure, GOOD, GOOD)
        rest = float(np.median(np.linalg.norm(factor * a - b, axis=-1) / most[use]))
        name = next((n for n, f in units.items() if abs(factor - f) <= NEAR * abs(f) and rest < NEAR), "")
        return Finding(test, figure, name or "does not fit", FAULT if off > APART else DOUBT, remedy)


def ego_speed(frames: Sequence[RecordedFrame]) -> Finding:
    """Speed and heading of the ego against its places."""
    egos = [f.scene.ego for f in frames]
    pose = np.array([e.pose for e in egos])
    ahead = unit(pose[:, 2])
    along = (np.array([e.velocity for e in egos]) * ahead).sum(-1, keepdims=True)  # none across the heading
    ways = Ways.of(_times(frames), pose[:, :2], along * ahead)
    found = ways.judge("speed of the ego", "m/s", 2 * DRIVE, SPEEDS, "")
    went, said = (float(np.linalg.norm(way, axis=-1).mean()) if len(way) else 0.0 for way in ways)
    how = f"ego.speed={found.fits}" if found.fits in SPEEDS else "ego.speed=places"
    if went < NEAR * said:
        how = "ego.places=speed"
    elif found.fits not in SPEEDS and abs(said - went) < NEAR * went:
        how = "ego.heading=places"
    return found._replace(remedy=f"read it with --fix {how}")


def yaw_rate(frames: Sequence[RecordedFrame]) -> Finding:
    """Yaw rate of the ego against its headings."""
    egos = [f.scene.ego for f in frames]
    heading, rate = np.unwrap([e.pose[2] for e in egos]), np.array([e.yaw_rate for e in egos])
    drives = np.array([np.hypot(*e.velocity) > 1 for e in egos])
    turned = np.append(0.0, np.cumsum(np.diff(heading) * drives[1:]))  # a course at standstill is noise
    ways = Ways.of(_times(frames), turned[:, None], rate[:, None])
    units = {"deg": FACTORS["deg"], "reversed": -1.0}
    found = ways.judge("yaw rate of the ego", "rad/s", TURN, units, "")
    return found._replace(remedy=f"read it with --fix ego.yaw_rate={found.fits if found.fits in units else 'heading'}")


def truth_speed(frames: Sequence[RecordedFrame]) -> Finding | None:
    """Velocities of the truth against its places, None without truth."""
    objects = [f.scene.objects for f in frames]
    number = np.concatenate([np.zeros(0, int), *(o.id for o in objects)])
    if not len(number):
        return None
    time = np.repeat(_times(frames), [len(o.id) for o in objects])
    place, speed = (np.concatenate([getattr(o, name) for o in objects]) for name in ("pose", "velocity"))
    drives = np.concatenate([np.array(o.kind, np.str_).reshape(-1) != "obstacle" for o in objects])
    each = [np.flatnonzero((number == n) & drives) for n in np.unique(number)]
    ways = [Ways.of(time[rows], place[rows, :2], speed[rows]) for rows in each]
    found = Ways(*map(np.concatenate, zip(*ways, strict=True))).judge("speed of the truth", "m/s", DRIVE, SPEEDS, "")
    return found._replace(remedy=f"read it with --fix truth.speed={found.fits if found.fits in SPEEDS else 'places'}")


def _times(frames: Sequence[RecordedFrame]) -> NDArray:
    return np.array([f.scene.time for f in frames])

"""Whether a recording can be right: what was tested, the figure, the reading that fits, and a verdict with a remedy.

Method and equations: docs/methods/plausibility.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from testbed.replay import evidence
from testbed.replay.evidence import RIGHT, Boxed, Counts, Reading, Seen
from testbed.replay.fixes import FACTORS, MEASURED, SPEEDS, parse
from testbed.replay.reading import Recorded, read
from testbed.replay.recording import RecordedFrame
from testbed.replay.sensor_sheets import SensorSheets
from trackers.geometry import unit

GOOD, OPEN, DOUBT, FAULT = "right", "nothing can be said", "doubt", "fault"
LEAST, CLEAR, ALONE = 10, 4.0, 10.0  # detections that a vote needs, and how many times as many as speak against it
SHARE = 0.03  # of the detections that tell two readings apart, which standing things must at least be
SPREAD = 10  # cells that what stands must be in
WINDOW = 1.0  # [s] over which motion is compared with places
OFTEN, APART = 0.1, 0.5  # share of the windows that must show motion, and by which share both may differ
TURN, DRIVE = 0.05, 2.5  # [rad/s], [m/s] from which on there is motion
NEAR = 0.1  # share up to which a factor is that of a unit, and one reading explains as much as another
SCALE = 0.2  # share up to which a speed may differ from that of the places
FAR, BEYOND = 1.25, 0.05  # times `max_range`, and the share of detections that may lie further away
TWICE, SOME = 0.25, 0.02  # share of detections with an equal, of a fault and of a doubt
CROWD, LOST = 10.0, 0.4  # unexplained detections in expected false alarms; share explained below which that counts


class Finding(NamedTuple):
    """One line of the report."""

    test: str
    figure: str
    fits: str
    verdict: str  # GOOD, OPEN, DOUBT or FAULT
    remedy: str = ""

    @property
    def sentence(self) -> str:
        """What is wrong and what to do, for doubts and faults."""
        return f"{self.test}: {self.fits} ({self.figure}); {self.remedy}"


def judged(
    folder: Path, start: float | None = None, end: float | None = None, fixes: Sequence[str] = ()
) -> tuple[Recorded, list[Finding]]:
    """The recording of a folder with its fixes, and all findings on it; errors as in `read` and `parse`."""
    chosen = parse(fixes)
    recorded = read(folder, start, end, chosen)
    if any(fix.how == MEASURED for fix in chosen):
        seen = Seen.of(recorded.frames)
        count, _ = unexplained(seen, evidence.steps(seen), len(recorded.sensors.models))
        models = [
            replace(m, clutter=max(float(n), m.clutter)) for m, n in zip(recorded.sensors.models, count, strict=True)
        ]
        recorded = recorded._replace(sensors=recorded.sensors._replace(models=tuple(models)))
    found = [_names_of(recorded), *examine(recorded.frames, recorded.sensors)]
    return recorded, [f if f.verdict in (DOUBT, FAULT) else f._replace(remedy="") for f in found]


def _names_of(recorded: Recorded) -> Finding:
    """Columns that are not read; a fault where the range rates seem to be one of them."""
    other = [one for one in recorded.unread if one.like]
    said = ", ".join(f"{one.name} of {one.file}" for one in recorded.unread)
    if not other:
        return Finding("columns", f"not read: {said}" if said else "all are read", GOOD, GOOD)
    one = min(other, key=lambda one: one.like != "range_rate")
    rates = one.like == "range_rate"
    remedy = f"rename it{f', or read it with --fix {one.name}=range_rate' * rates}"
    figure = f"{one.name} of {one.file} is not read"
    return Finding("columns", figure, f"it seems to be {one.like}", FAULT if rates else DOUBT, remedy)


def examine(frames: Sequence[RecordedFrame], sensors: SensorSheets) -> list[Finding]:
    """All findings on the frames of a recording."""
    seen, boxes = Seen.of(frames), Boxed.of(frames)
    said = _truth_speed(frames)
    ways = [_ego_speed(frames), _yaw_rate(frames), *([] if said is None else [said])]
    if not len(seen.scan):
        return [*ways, Finding("detections", "none", OPEN, OPEN)]
    pairs = evidence.steps(seen)
    read = _readings(seen, boxes, pairs, sensors, said is not None and said.verdict != FAULT)
    found = [*read, _shares(seen), _reach(seen, sensors), *ways, _equals(seen)]
    return found if faults(found) else [*found, _crowd(seen, pairs, sensors)]  # wrong rates explain nothing


def faults(found: Sequence[Finding]) -> list[str]:
    """Sentences of the definite faults."""
    return [f.sentence for f in found if f.verdict == FAULT]


# -- range rate, azimuth, range ----------------------------------------------------------------------------------------


def _names() -> list[Reading]:
    """All other readings of the three columns, those with the fewest changes first."""
    rates = [
        ("right", 1.0, False, ()),
        *((unit_, FACTORS[unit_], False, (f"range_rate={unit_}",)) for unit_ in ("km/h", "mph")),
        ("reversed", -1.0, False, ("range_rate=reversed",)),
        ("reversed, km/h", -1 / 3.6, False, ("range_rate=km/h", "range_rate=reversed")),
        ("relative to the ground", 1.0, True, ("range_rate=ground",)),
        ("relative to the ground, km/h", 1 / 3.6, True, ("range_rate=km/h", "range_rate=ground")),
        ("relative to the ground, reversed", -1.0, True, ("range_rate=reversed", "range_rate=ground")),
    ]
    found = []
    for (rate, factor, ground, fixes), side, far in product(rates, (1, -1), (1.0, 0.3048)):
        fixes = (*fixes, *["azimuth=mirrored"] * (side < 0), *["range=ft"] * (far != 1))
        if fixes:
            found.append(Reading(rate, fixes, factor, ground, side, far))
    return sorted(found, key=lambda how: len(how.fixes))


READINGS = tuple(_names())


class Votes(NamedTuple):
    """Counts of the sources for one reading against the usual one."""

    standing: Counts
    moving: Counts
    claimed: Counts  # against it only
    truth: Counts

    def __add__(self, other: Any) -> "Votes":
        return Votes(*(Counts(*np.add(a, b).tolist()) for a, b in zip(self, other, strict=True)))

    @property
    def net(self) -> int:
        """Detections for it less those against it."""
        return sum(c.other - c.right for c in (self.standing, self.moving, self.truth))

    @property
    def verdict(self) -> str:
        """FAULT where the reading is right and the usual one is not, DOUBT where that is likely, else GOOD or OPEN."""
        stand, move, claim, true = self
        against = [_clear(c.right, c.other) for c in self]
        if any(against) or (move.right >= LEAST / 2 and move.right > 2 * move.other):
            return GOOD
        stands = _clear(stand.other, stand.right) and stand.other > SHARE * stand.all and stand.spread >= SPREAD
        others = _clear(move.other, move.right) or _clear(true.other, true.right)
        alone = stand.other >= ALONE * stand.right
        if others or (stands and alone):
            return FAULT
        return DOUBT if stands else OPEN


def _clear(much: int, little: int) -> bool:
    """Whether so many detections for it, and so few against it, decide."""
    return much >= LEAST and much > CLEAR * little  # (PLA.4)


def _readings(
    seen: Seen, boxes: Boxed, pairs: list[evidence.Step], sensors: SensorSheets, trusted: bool
) -> list[Finding]:
    """What range rates, azimuths and ranges are: of all sensors together, or of those that differ."""
    parts = {s: _votes(seen.of_sensor(s), boxes, [p for p in pairs if p.first.sensor[0] == s], trusted)
             for s in np.unique(seen.sensor).tolist()}  # fmt: skip
    total = [sum(votes[1:], votes[0]) for votes in zip(*parts.values(), strict=True)]
    best = _best(total)
    if best is not None and not any(_best_is_right(votes, best) for votes in parts.values()):
        return _told(seen, boxes, total, best, "")
    found = _told(seen, boxes, total, None, "")
    for s, votes in parts.items():
        if (own := _best(votes)) is not None and len(parts) > 1 and votes[own].verdict == FAULT:
            found += [
                f for f in _told(seen.take(seen.sensor == s), boxes, votes, own, sensors.names[s]) if f.verdict == FAULT
            ]
    return found


def _votes(seen: Seen, boxes: Boxed, pairs: list[evidence.Step], trusted: bool) -> list[Votes]:
    """Of each reading; continuity is counted where another source speaks for it, or where it changes one thing only."""
    base, none, found = evidence.base_of(pairs), evidence.NONE, []
    kinds = {(how.side, how.range): how for how in (*READINGS, RIGHT)} if trusted else {}
    boxed = {kind: evidence.in_boxes(seen, boxes, how) for kind, how in kinds.items()}
    rates = np.isfinite(seen.polar[:, 2]).any()
    for how in READINGS:
        if not rates and how.name != "right":
            found.append(Votes(none, none, none, none))
            continue
        stand = evidence.standing(seen, how)
        true = evidence.truth(seen, how, boxed[1, 1.0], boxed[how.side, how.range]) if trusted else none
        moved = (none, none)
        if len(how.fixes) == 1 or stand.other > stand.right or true.other > true.right:
            moved = evidence.continuity(pairs, how, base)
        found.append(Votes(stand, *moved, true))
    return found


def _best(votes: Sequence[Votes]) -> int | None:
    """The reading that explains most, the plainest of those that explain about as much; None if none is better."""
    good = [k for k, v in enumerate(votes) if v.verdict in (FAULT, DOUBT)]
    most = max((votes[k].net for k in good), default=0)
    return next((k for k in good if votes[k].net >= (1 - NEAR) * most), None)


def _best_is_right(votes: Sequence[Votes], best: int) -> bool:
    return votes[best].verdict == GOOD


def _told(seen: Seen, boxes: Boxed, votes: Sequence[Votes], best: int | None, sensor: str) -> list[Finding]:
    """A line for each of the three columns."""
    at = f"@{sensor}" * bool(sensor)
    changed = {} if best is None else {fix.partition("=")[0]: fix for fix in READINGS[best].fixes}
    found = []
    for column, of in (("range_rate", "range rate"), ("azimuth", "azimuth"), ("range", "range")):
        test = of + f" of {sensor}" * bool(sensor)
        singles = [k for k, how in enumerate(READINGS) if {f.partition("=")[0] for f in how.fixes} == {column}]
        if column == "range_rate" and (flat := _flat(seen, boxes, test, at)) is not None:
            found.append(flat)
        elif best is not None and column in changed:
            fixes = [fix for fix in READINGS[best].fixes if fix.startswith(f"{column}=")]
            name = READINGS[best].name if column == "range_rate" else fixes[0].partition("=")[2]
            options = " ".join(f"--fix {fix.replace('=', f'{at}=')}" for fix in fixes)
            found.append(Finding(test, _figure(votes[best]), name, votes[best].verdict, f"read it with {options}"))
        else:
            speaks = any(votes[k].verdict == GOOD for k in singles)
            k = max(singles, key=lambda k: sum(c.right for c in votes[k]))
            found.append(
                Finding(test, _figure(votes[k], READINGS[k]), GOOD if speaks else OPEN, GOOD if speaks else OPEN)
            )
    return found


def _figure(votes: Votes, other: Reading | None = None) -> str:
    """Counts in words."""
    names = ("standing returns", "next scan", "truth")
    counts = (votes.standing, votes.moving, votes.truth)
    said = [
        f"{name} {c.right if other else c.other} : {c.other if other else c.right}"
        for name, c in zip(names, counts, strict=True)
        if c.other + c.right
    ]
    against = f" against {other.name if other.name != 'right' else other.fixes[0].partition('=')[2]}" if other else ""
    return f"detections for it : against it, {', '.join(said)}{against}" if said else "no detection tells it"


def _shares(seen: Seen) -> Finding:
    """Shares of the detections that stand in each reading of the range rates, and the line through those that do."""
    plain = [RIGHT, *(how for how in READINGS if how.side > 0 and how.range == 1 and how.name.count(",") == 0)]
    share = [evidence.fits(seen, how)[0].mean() for how in plain]
    said = ", ".join(f"{how.name} {part:.0%}" for how, part in zip(plain, share, strict=True))
    g, t = seen.over_ground(RIGHT)
    use = np.abs(g) < 2 * t
    due = -(unit(seen.polar[:, 1]) * seen.velocity).sum(-1)[use]
    if use.sum() < LEAST or np.ptp(due) < 2.0:
        return Finding("standing returns", said, OPEN, OPEN)
    scale, offset = np.polyfit(due, seen.polar[use, 2], 1)
    return Finding("standing returns", f"{said}; scale {scale:.2f}, offset {offset:+.2f} m/s", GOOD, GOOD)


def _flat(seen: Seen, boxes: Boxed, test: str, at: str) -> Finding | None:
    """Range rates that are all the same, or none."""
    rate = seen.polar[np.isfinite(seen.polar[:, 2]), 2]
    if not len(rate):
        return Finding(test, "no range rates", OPEN, OPEN)
    value, count = np.unique(rate, return_counts=True)
    k = count.argmax()
    speed = np.median(np.hypot(*seen.velocity.T))
    if count[k] < max(LEAST, 0.5 * len(rate)) or speed < 1.0:
        return None
    inside, due = evidence.in_boxes(seen, boxes, RIGHT)
    fit = np.abs(seen.polar[inside, 2] - due[inside]) < evidence.RATE_TRUTH
    if _clear(fit.sum(), (~fit).sum()):  # the truth moves as the ego does
        return None
    figure, remedy = (
        f"{count[k] / len(rate):.0%} are {value[k]:g} m/s",
        f"leave them out with --fix range_rate{at}=none",
    )
    return Finding(test, figure, "all zero" if value[k] == 0 else "all the same", FAULT, remedy)


def _reach(seen: Seen, sensors: SensorSheets) -> Finding:
    """Ranges against the data sheet."""
    limit = np.array([model.max_range for model in sensors.models])[seen.sensor]
    share = float((seen.polar[:, 0] > FAR * limit).mean())
    figure = f"{share:.1%} are beyond {FAR:g} times max_range"
    if share <= BEYOND:
        return Finding("reach", figure, GOOD, GOOD)
    fits = next(
        (u for u in ("ft", "cm", "mm") if (FACTORS[u] * seen.polar[:, 0] > FAR * limit).mean() < BEYOND), "too far"
    )
    remedy = f"read them with --fix range={fits}, or correct" if fits in FACTORS else "correct"
    return Finding(
        "reach", figure, f"ranges may be in {fits}" if fits in FACTORS else fits, FAULT, f"{remedy} max_range"
    )


# -- motion of the ego and of the truth --------------------------------------------------------------------------------


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


def _ego_speed(frames: Sequence[RecordedFrame]) -> Finding:
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


def _yaw_rate(frames: Sequence[RecordedFrame]) -> Finding:
    egos = [f.scene.ego for f in frames]
    heading, rate = np.unwrap([e.pose[2] for e in egos]), np.array([e.yaw_rate for e in egos])
    drives = np.array([np.hypot(*e.velocity) > 1 for e in egos])
    turned = np.append(0.0, np.cumsum(np.diff(heading) * drives[1:]))  # a course at standstill is noise
    ways = Ways.of(_times(frames), turned[:, None], rate[:, None])
    units = {"deg": FACTORS["deg"], "reversed": -1.0}
    found = ways.judge("yaw rate of the ego", "rad/s", TURN, units, "")
    return found._replace(remedy=f"read it with --fix ego.yaw_rate={found.fits if found.fits in units else 'heading'}")


def _truth_speed(frames: Sequence[RecordedFrame]) -> Finding | None:
    """None without truth."""
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


# -- how many ----------------------------------------------------------------------------------------------------------


def _equals(seen: Seen) -> Finding:
    """Detections that are there more than once."""
    rows = np.column_stack([seen.time, seen.polar])
    share = 1 - len(np.unique(rows, axis=0, equal_nan=True)) / len(rows)
    verdict = FAULT if share > TWICE else DOUBT if share > SOME else GOOD
    fits = GOOD if verdict == GOOD else "there more than once"
    return Finding(
        "equal detections", f"{share:.1%} of them", fits, verdict, "keep one of each with --fix detections=once"
    )


def unexplained(seen: Seen, pairs: list[evidence.Step], count: int) -> tuple[NDArray, float]:
    """Detections a scan of each sensor (S,) that neither stand nor are found again, and the share of the others."""
    lost, scans, share = np.zeros(count), np.zeros(count), []
    for step, (_, there) in zip(pairs, evidence.base_of(pairs), strict=True):
        s, (g, t) = step.first.sensor[0], step.first.over_ground(RIGHT)
        free = ~there & ~(np.abs(g) < t)
        low, high = np.searchsorted(seen.scan, [step.first.scan[0], step.first.scan[0] + 1])
        lost[s] += free.mean() * (seen.sensor[low:high] == s).sum()  # of some detections to all of the scan
        scans[s] += 1
        share.append(~free)
    return lost / np.maximum(scans, 1), float(np.concatenate(share).mean()) if share else 1.0


def _crowd(seen: Seen, pairs: list[evidence.Step], sensors: SensorSheets) -> Finding:
    """Detections that nothing explains, against the false alarms that the sensors are said to have."""
    due = np.array([model.clutter for model in sensors.models])
    count, share = unexplained(seen, pairs, len(due))
    if not pairs or not np.isfinite(seen.polar[:, 2]).any():
        return Finding("detections a scan", "no scans with range rates to compare", OPEN, OPEN)
    figure = f"{count.sum():.1f} without an explanation, {due.sum():g} false alarms expected, {share:.0%} explained"
    many = count.sum() > CROWD * max(due.sum(), 1.0) and share < LOST  # (PLA.6)
    if not many:
        return Finding("detections a scan", figure, GOOD, GOOD)
    remedy = "thin them out, or take the false alarms as they are with --fix clutter=measured"
    return Finding("detections a scan", figure, "far more than the sensors are said to have", FAULT, remedy)

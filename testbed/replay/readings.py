"""Which reading of range rates, azimuths and ranges detections speak for. Equations: docs/methods/plausibility.md."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from testbed.replay import evidence
from testbed.replay.evidence import RIGHT, Boxed, Counts, Reading, Seen
from testbed.replay.findings import DOUBT, FAULT, GOOD, NEAR, OPEN, Finding
from testbed.replay.fixes import FACTORS
from testbed.replay.sensor_sheets import SensorSheets
from trackers.geometry import unit

LEAST, CLEAR, ALONE = 10, 4.0, 10.0  # detections that a vote needs, and how many times as many as speak against it
SHARE = 0.03  # of the detections that tell two readings apart, which standing things must at least be


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
    def stands(self) -> bool:
        """Whether standing returns speak for it."""
        one = self.standing
        return _clear(one.other, one.right) and one.other > SHARE * one.all and one.spread >= evidence.SPREAD

    @property
    def support(self) -> int:
        """Sources that speak for it."""
        return self.stands + sum(_clear(c.other, c.right) for c in (self.moving, self.truth))

    @property
    def verdict(self) -> str:
        """FAULT where the reading is right and the usual one is not, DOUBT where that is likely, else GOOD or OPEN."""
        move = self.moving
        if any(_clear(c.right, c.other) for c in self) or (move.right >= LEAST / 2 and move.right > 2 * move.other):
            return GOOD
        alone = self.standing.other >= ALONE * self.standing.right
        if self.support > self.stands or (self.stands and alone):
            return FAULT
        return DOUBT if self.stands else OPEN


def _clear(much: int, little: int) -> bool:
    """Whether so many detections for it, and so few against it, decide."""
    return much >= LEAST and much > CLEAR * little  # (PLA.4)


def columns(
    seen: Seen, boxes: Boxed, pairs: list[evidence.Step], sensors: SensorSheets, trusted: bool
) -> list[Finding]:
    """Findings on range rates, azimuths and ranges: of all sensors together, or of those that differ."""
    parts = {s: _votes(seen.of_sensor(s), boxes, [p for p in pairs if p.first.sensor[0] == s], trusted)
             for s in np.unique(seen.sensor).tolist()}  # fmt: skip
    total = [sum(votes[1:], votes[0]) for votes in zip(*parts.values(), strict=True)]
    best = _best(total)
    if best is not None and not any(votes[best].verdict == GOOD for votes in parts.values()):
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
    """The reading that most sources speak for, of these the one that explains most, the plainest of about as much."""
    good = [k for k, v in enumerate(votes) if v.verdict in (FAULT, DOUBT)]
    good = [k for k in good if votes[k].support == max(votes[k].support for k in good)]
    most = max((votes[k].net for k in good), default=0)
    return next((k for k in good if votes[k].net >= (1 - NEAR) * most), None)


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


def shares(seen: Seen) -> Finding:
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

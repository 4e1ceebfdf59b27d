"""Which reading of range rates, azimuths and ranges detections speak for. Equations: docs/methods/plausibility.md.

Votes are counts (..., R, 4, 4) of readings and sources, each as in `Seen.tally`.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.replay.evidence import RIGHT, SPREAD, Boxed, Pairs, Reading, Seen, explained, standing
from testbed.replay.fixes import DOUBT, FACTORS, FAULT, GOOD, NEAR, OPEN, Finding
from testbed.replay.sensor_sheets import SensorSheets
from trackers.geometry import dot, unit

LEAST, CLEAR = 10, 4.0  # detections that a source needs, and how many times as many as speak against it
SHARE = 0.03  # of the detections that tell two readings apart, which standing things must at least be
MANY = 0.25  # the same share from which on the next scan need not find them again, if `ALONE` times as many
STANDING, MOVING, CLAIMED, TRUTH = range(4)  # sources; what is claimed speaks against a reading only
SOURCES = ((STANDING, "standing returns"), (MOVING, "next scan"), (TRUTH, "truth"))
COLUMNS = {"range_rate": "range rate", "azimuth": "azimuth", "range": "range"}
LEVELS = (OPEN, GOOD, DOUBT, FAULT)
RATES = (  # name, options, and whether the motion of the ego is taken out
    ("right", (), False),
    ("km/h", ("km/h",), False),
    ("mph", ("mph",), False),
    ("reversed", ("reversed",), False),
    ("reversed, km/h", ("km/h", "reversed"), False),
    ("relative to the ground", ("ground",), True),
    ("relative to the ground, km/h", ("km/h", "ground"), True),
    ("relative to the ground, reversed", ("reversed", "ground"), True),
)


def _readings() -> tuple[Reading, ...]:
    """All other readings of the three columns, those with the fewest changes first."""
    found = []
    for (name, units, ground), side, far in product(RATES, (1, -1), ("", "ft")):
        fixes = [f"range_rate={u}" for u in units] + ["azimuth=mirrored"] * (side < 0) + ["range=ft"] * bool(far)
        rate = float(np.prod([FACTORS.get(u, 1.0) for u in units]))
        found.append(Reading(name, tuple(fixes), rate, ground, side, FACTORS.get(far, 1.0)))
    return tuple(sorted(found[1:], key=lambda how: len(how.fixes)))


READINGS = _readings()
MIRRORED = np.array([how.fixes == ("azimuth=mirrored",) for how in READINGS])
ALONE = np.array([25.0 if how.ground else 10.0 for how in READINGS])  # as `CLEAR`, of standing returns alone
RARE = np.array([how.side > 0 and not how.ground for how in READINGS])  # hardly any traffic seems to stand in them


class Judged(NamedTuple):
    """What votes (..., R, 4, 4) say of R readings."""

    level: NDArray  # (..., R) int, of `LEVELS`: 3 where the reading is right and the usual one is not
    support: NDArray  # (..., R) int sources that speak for it
    net: NDArray  # (..., R) int detections for it less those against it

    @classmethod
    def of(cls, votes: NDArray) -> "Judged":
        """The verdicts."""
        other, right, tells, cells = np.moveaxis(votes, -1, 0)
        spread = (cells >= SPREAD) | (np.arange(4) == TRUTH)  # vehicles are few things, though in many scans
        speaks, move = _clear(other, right) & spread, (other[..., MOVING], right[..., MOVING])
        much, little = other[..., STANDING], right[..., STANDING]
        asked = tells[..., CLAIMED] >= 2 * LEAST  # else the next scan could not speak against it
        found = (other - right)[..., [MOVING, CLAIMED]].sum(-1) >= 0
        part, far = much > MANY * tells[..., STANDING], cells[..., STANDING] >= 2 * SPREAD
        many = part & (much >= ALONE * little) & (RARE | (asked & far))
        sure = (asked & found) | many | (part & MIRRORED)
        stands = speaks[..., STANDING] & (much > SHARE * tells[..., STANDING]) & sure
        more = speaks[..., [MOVING, TRUTH]].sum(-1)
        veto = _clear(right, other)
        veto[..., CLAIMED] &= ~speaks[..., TRUTH]  # rails may hide it
        against = veto.any(-1) | ((move[1] >= LEAST / 2) & (move[1] > 2 * move[0]) & ~(stands & many))
        fault = (more > 0) | (stands & (much >= ALONE * little))
        net = (other - right)[..., [STANDING, MOVING, TRUTH]].sum(-1)
        return cls(np.where(against, 1, np.where(fault, 3, np.where(stands, 2, 0))), stands + more, net)

    @property
    def best(self) -> int | None:
        """The reading that most sources speak for, then that which explains most, or the plainest of about as much."""
        good = np.flatnonzero(self.level >= 2)
        good = good[self.support[good] == self.support[good].max(initial=0)]
        return next((k for k in good.tolist() if self.net[k] >= (1 - NEAR) * max(self.net[good].max(), 0)), None)


def _clear(much: NDArray, little: NDArray) -> NDArray:
    """Whether so many detections for it, and so few against it, decide."""
    return (much >= LEAST) & (much > CLEAR * little)  # (PLA.4)


def columns(seen: Seen, boxes: Boxed, sensors: SensorSheets, trusted: bool) -> list[Finding]:
    """Findings on range rates, azimuths and ranges: of all sensors together, or of those that differ.

    `trusted`: whether there is a truth whose velocities can be right.
    """
    pairs, names = Pairs.of(seen, np.array([model.fov for model in sensors.models])), sensors.names
    votes = votes_of(seen.thinned(), boxes if trusted else None, pairs, len(names))
    total, best, each = votes.sum(0), Judged.of(votes.sum(0)).best, Judged.of(votes)
    if best is not None and not ((each.level[:, best] == 1) & (each.support[:, best] == 0)).any():
        return _told(seen, boxes, total, best, "")
    found = _told(seen, boxes, total, None, "")
    for s in np.unique(seen.sensor).tolist() if len(names) > 1 else ():
        one = Judged(*(value[s] for value in each)).best
        if one is not None and each.level[s, one] == 3:
            found += _told(seen.take(seen.sensor == s), boxes, votes[s], one, names[s])
    return [f for k, f in enumerate(found) if k < len(COLUMNS) or f.verdict == FAULT]


def votes_of(seen: Seen, boxes: Boxed | None, pairs: Pairs, sensors: int) -> NDArray:
    """Counts (S, R, 4, 4) of each sensor; the next scan counts where another source agrees, or for one change alone."""
    votes = np.zeros((sensors, len(READINGS), 4, 4), int)
    usual = pairs.again(RIGHT)
    kinds = {(how.side, how.range): how for how in (*READINGS, RIGHT)}
    due = {} if boxes is None else {kind: boxes.due(seen, how) for kind, how in kinds.items()}
    for k, how in enumerate(READINGS):
        votes[:, k, STANDING] = seen.tally(*standing(seen, how), sensors)
        if due:
            one, two = due[how.side, how.range], due[1, 1.0]
            fits = explained(seen, how, one), explained(seen, RIGHT, two)
            votes[:, k, TRUTH] = seen.tally(*fits, np.isfinite(one) | np.isfinite(two), sensors)
        agree = (votes[:, k, :, 0] > votes[:, k, :, 1]).any(-1, keepdims=True) | (len(how.fixes) == 1)
        if agree.any():
            votes[:, k, [MOVING, CLAIMED]] = (pairs.counts(how, usual, sensors) * agree).swapaxes(0, 1)
    return votes


def _told(seen: Seen, boxes: Boxed, votes: NDArray, best: int | None, sensor: str) -> list[Finding]:
    """A line for each of the three columns, from votes (R, 4, 4)."""
    at, level, found = f"@{sensor}" * bool(sensor), Judged.of(votes).level, []
    others = Judged.of(votes * (np.arange(4) != TRUTH)[:, None]).level  # what is said without the truth
    moved = ", or correct the places of the truth, which alone say so" if best is not None and others[best] < 2 else ""
    for column, test in COLUMNS.items():
        test += f" of {sensor}" * bool(sensor)
        fixes = [] if best is None else [fix for fix in READINGS[best].fixes if fix.startswith(f"{column}=")]
        if column == "range_rate" and (flat := _flat(seen, boxes, test, at)) is not None:
            found.append(flat)
        elif best is not None and fixes:
            name = READINGS[best].name if column == "range_rate" else fixes[0].partition("=")[2]
            options = " ".join(f"--fix {fix.replace('=', f'{at}=')}" for fix in fixes)
            remedy = f"read it with {options}{moved * (column != 'range_rate')}"
            found.append(Finding(test, _figure(votes[best]), name, LEVELS[level[best]], remedy))
        else:
            single = [k for k, how in enumerate(READINGS) if {f.partition("=")[0] for f in how.fixes} == {column}]
            k = max(single, key=lambda k: votes[k, :, 1].sum())
            name = READINGS[k].name if column == "range_rate" else READINGS[k].fixes[0].partition("=")[2]
            verdict = GOOD if (level[single] == 1).any() else OPEN
            found.append(Finding(test, _figure(votes[k, :, [1, 0]].T, f" against {name}"), verdict, verdict))
    return found


def _figure(votes: NDArray, against: str = "") -> str:
    """Counts (4, 2) in words."""
    said = ", ".join(f"{name} {votes[k, 0]} : {votes[k, 1]}" for k, name in SOURCES if votes[k, :2].any())
    return f"detections for it : against it, {said}{against}" if said else "no detection tells it"


def shares(seen: Seen) -> Finding:
    """Shares of the detections that stand in each reading of the range rates, and the line through those that do."""
    plain = [RIGHT, *(how for how in READINGS if how.side > 0 and how.range == 1 and "," not in how.name)]
    said = ", ".join(f"{how.name} {standing(seen, how)[0].mean():.0%}" for how in plain)
    g, t = seen.over_ground(RIGHT)
    use = np.abs(g) < 2 * t
    due = -dot(unit(seen.polar[:, 1]), seen.velocity)[use]
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
    if count[k] < max(LEAST, 0.5 * len(rate)) or np.median(np.hypot(*seen.velocity.T)) < 1.0:
        return None
    due = boxes.due(seen, RIGHT)
    fit = explained(seen, RIGHT, due).sum()
    if _clear(fit, np.isfinite(due).sum() - fit):  # the truth moves as the ego does
        return None
    remedy = f"leave them out with --fix range_rate{at}=none"
    what = "all zero" if value[k] == 0 else "all the same"
    return Finding(test, f"{count[k] / len(rate):.0%} are {value[k]:g} m/s", what, FAULT, remedy)

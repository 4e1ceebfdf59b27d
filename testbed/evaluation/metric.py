"""All metrics, one entry each: key, unit, which way is better, of what, in words, and how it is computed.

`METRICS` is the only list: rows of results, columns of tables and their units, what a run prints, a comparison, a
regret and the log show, and docs/results.md are made from it. A quantity has one key everywhere; what committed files
hold under older keys is read through `ALIASES`. Equations: docs/methods/metrics.md.

`compute` takes what the level says: `Pairs` (its values are (K,)), the errors of many pairs by key, a `Judged` scan, a
`Span` of a run, a `DriveRecord`, metrics of drives with the progress on the truth, two `Driven`, or a tracker's cost.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation import driving, histories, identities
from testbed.evaluation.driving import LONGEST
from testbed.evaluation.metrics import mean, nees_bounds, rmse
from testbed.evaluation.span import Span

PAIR = "pair"  # an object and its track at one scan
PAIRS = "pairs"  # all such pairs of a run, a phase or an object
SCAN = "scan"
SPAN = "run or phase"
RUN = "run"
COST = "tracker"  # wall time: all that differs from one execution to the next
DRIVE = "drive"
SCORED = "drive beside the truth"  # beside the drive of the same planner and seed on the truth
DRIVES = "two drives"  # of one seed, one beside the other
LEVELS = (PAIR, PAIRS, SCAN, SPAN, RUN, COST, DRIVE, SCORED, DRIVES)


@dataclass(frozen=True)
class Metric:
    """One quantity: what it is called, how it is read, and how it is computed."""

    key: str  # its name in every file, table and mapping
    of: str  # one of `LEVELS`
    unit: str  # "1" without one
    better: int  # 1: the more the better, -1: the less, 0: neither, or the nearer to `ideal`
    label: str  # a few words, for the head of a column
    words: str  # what it is
    compute: Callable[..., Any]
    digits: int = 2  # behind the point, in tables
    ideal: float | None = None  # best value, where that is not the least or the largest
    averaged: bool = False  # of a pair or a scan: the row of a run has its mean under the same key
    needs: str = ""  # a library that is not always there; without it the metric is left out

    @property
    def title(self) -> str:
        """Label with unit."""
        return self.label if self.unit == "1" else f"{self.label} [{self.unit}]"

    @property
    def known(self) -> bool:
        """Whether it can be computed here."""
        return not self.needs or find_spec(self.needs) is not None

    @property
    def sense(self) -> str:
        """Which way is better, in words."""
        if self.ideal is not None:
            return f"{self.ideal:g} is ideal"
        return {-1: "less is better", 0: "", 1: "more is better"}[self.better]

    def badness(self, value: float) -> float:
        """The value on a scale on which less is better: itself, its distance from the ideal, or its negative."""
        if self.ideal is not None:
            return abs(value - self.ideal)
        return -value if self.better > 0 else value

    def text(self, value: object, missing: str) -> str:
        """A value as people read it: counts whole, others with `digits`; `missing` where nothing was measured."""
        if not isinstance(value, int | float | np.number) or not np.isfinite(value):
            return missing
        return f"{value:.{0 if isinstance(value, int) else self.digits}f}"


def _share(part: NDArray, whole: NDArray) -> float:
    """Sum over sum [%], NaN of none."""
    return 100 * float(part.sum() / (whole.sum() or np.nan))


def _unborn_percent(span: Span) -> float:
    objects = span.objects_at([h.counted for h, _ in span.objects])
    return 100 * span.objects_at([histories.unborn(h) for h, _ in span.objects]) / objects if objects else np.nan


_TABLE = (
    # Scans of a tracker.
    Metric("scans", SPAN, "1", 0, "scans", "scans of the radar", lambda s: len(s.scans["gospa"]), 0),
    Metric("gospa", SCAN, "m", -1, "GOSPA",
           "generalized optimal sub-pattern assignment, over the rooted Gaussian Wasserstein distance with c = 5 m",
           lambda scan: scan.gospa.total, averaged=True),
    Metric("localisation", SCAN, "m^2", -1, "GOSPA, localisation part", "GOSPA's part of pairs, before the root",
           lambda scan: scan.gospa.localisation, averaged=True),
    Metric("missed", SCAN, "m^2", -1, "GOSPA, missed part", "GOSPA's part of objects without a track, before the root",
           lambda scan: scan.gospa.missed, averaged=True),
    Metric("false", SCAN, "m^2", -1, "GOSPA, false part", "GOSPA's part of tracks without an object, before the root",
           lambda scan: scan.gospa.false, averaged=True),
    Metric("objects", SCAN, "1", 0, "objects that count", "objects that count",
           lambda scan: int(scan.counted.sum()), 0),
    Metric("unassigned", SCAN, "1", -1, "objects without a track", "objects that count and have no track",
           lambda scan: int((scan.counted & (scan.holder < 0)).sum()), 0),
    Metric("ghosts", SCAN, "1", -1, "tracks without an object", "reported tracks without an object",
           lambda scan: len(scan.track) - len(scan.gospa.pairs), 0),
    Metric("tracks", SCAN, "1", 0, "reported tracks", "reported tracks", lambda scan: len(scan.track), 0),
    # Runs of a tracker, and their phases.
    Metric("missed_percent", SPAN, "%", -1, "missed", "counted objects without a track, as a share of all counted ones",
           lambda s: _share(s.scans["unassigned"], s.scans["objects"]), 1),
    Metric("false_per_scan", SPAN, "1", -1, "false tracks a scan", "reported tracks without an object, mean over scans",
           lambda s: mean(s.scans["ghosts"])),
    Metric("objects_per_scan", SPAN, "1", 0, "objects a scan", "counted objects, mean over scans",
           lambda s: mean(s.scans["objects"])),
    Metric("tracks_per_scan", SPAN, "1", 0, "tracks a scan", "reported tracks, mean over scans",
           lambda s: mean(s.scans["tracks"])),
    Metric("objects_visible", SPAN, "1", 0, "objects visible", "objects that ever counted",
           lambda s: len(s.counted), 0),
    Metric("objects_confirmed", SPAN, "1", 1, "objects tracked", "objects that ever counted while they had a track",
           lambda s: sum(bool((h.held & now).any()) for h, now in s.objects), 0),
    Metric("tracks_reported", SPAN, "1", 0, "tracks", "tracks that were ever reported", lambda s: len(s.tracks), 0),
    Metric("tracks_orphan", SPAN, "1", -1, "orphan tracks", "reported tracks that never belonged to an object",
           lambda s: sum(track.orphan for track in s.tracks), 0),
    Metric("tracks_clutter", SPAN, "1", -1, "tracks of clutter",
           "reported tracks with more detections of clutter and rails than of objects",
           lambda s: sum(track.empty and not track.ghostly for track in s.tracks), 0),
    Metric("tracks_ghost", SPAN, "1", -1, "tracks of ghosts", "tracks of that kind that had more ghosts than clutter",
           lambda s: sum(track.empty and track.ghostly for track in s.tracks), 0),
    Metric("switches", SPAN, "1", -1, "switches", "how often an object changed its track",
           lambda s: sum(s.within(histories.switches(h)) for h, _ in s.objects), 1),
    Metric("jumps", SPAN, "1", -1, "jumps", "how often a track changed its object", lambda s: s.within(s.jumps), 1),
    Metric("lost", SPAN, "1", -1, "lost tracks", "how often an object had lost its track for a second",
           lambda s: sum(s.within(histories.losses(h)) for h, _ in s.objects)),
    Metric("never", SPAN, "1", -1, "never tracked", "objects that counted for two seconds and never had a track",
           lambda s: sum(histories.never_tracked(h) for h in s.counted)),
    Metric("birth_delay", SPAN, "s", -1, "birth delay", "from first counted to first track, mean over objects",
           lambda s: mean([delay for h in s.first_seen if not np.isnan(delay := histories.birth_delay(h))])),
    Metric("unborn_percent", SPAN, "%", -1, "missed before birth",
           "counted objects that have not had a track yet, as a share of all counted ones", _unborn_percent, 1),
    # Pairs of object and track.
    Metric("gwd", PAIR, "m", -1, "GWD", "Gaussian Wasserstein distance of the boxes",
           lambda pairs: pairs.distance, averaged=True),
    Metric("gwd2", PAIR, "m^2", -1, "squared GWD", "squared Gaussian Wasserstein distance of the boxes",
           lambda pairs: pairs.distance**2, averaged=True),
    Metric("position", PAIR, "m", -1, "position error", "distance of the centres", lambda pairs: pairs.lengths[0]),
    Metric("velocity", PAIR, "m/s", -1, "velocity error", "magnitude of the difference of the velocities",
           lambda pairs: pairs.lengths[1]),
    Metric("heading_deg", PAIR, "deg", 0, "heading error", "heading, estimate minus truth",
           lambda pairs: np.degrees(pairs.turn), 1, ideal=0.0),
    Metric("length", PAIR, "m", 0, "length error", "length, estimate minus truth",
           lambda pairs: pairs.growth[:, 0], ideal=0.0),
    Metric("width", PAIR, "m", 0, "width error", "width, estimate minus truth",
           lambda pairs: pairs.growth[:, 1], ideal=0.0),
    Metric("box_iou", PAIR, "1", 1, "box IoU", "intersection over union of the boxes",
           lambda pairs: pairs.iou[0], ideal=1.0, averaged=True),
    Metric("contour_iou", PAIR, "1", 1, "contour IoU",
           "intersection over union of the estimated contour, or the box without one, and the true outline",
           lambda pairs: pairs.iou[1], ideal=1.0, averaged=True),
    Metric("rmse_position", PAIRS, "m", -1, "position RMSE", "root mean square distance of the centres",
           lambda e: rmse(e["position"])),
    Metric("rmse_velocity", PAIRS, "m/s", -1, "velocity RMSE", "root mean square difference of the velocities",
           lambda e: rmse(e["velocity"])),
    Metric("rmse_heading_deg", PAIRS, "deg", -1, "heading RMSE", "root mean square error of the heading",
           lambda e: rmse(e["heading_deg"]), 1),
    Metric("rmse_length", PAIRS, "m", -1, "length RMSE", "root mean square error of the length",
           lambda e: rmse(e["length"])),
    Metric("rmse_width", PAIRS, "m", -1, "width RMSE", "root mean square error of the width",
           lambda e: rmse(e["width"])),
    Metric("abs_length", PAIRS, "m", -1, "absolute length error", "mean absolute error of the length",
           lambda e: mean(np.abs(e["length"]))),
    Metric("abs_width", PAIRS, "m", -1, "absolute width error", "mean absolute error of the width",
           lambda e: mean(np.abs(e["width"]))),
    Metric("nees_position", PAIR, "1", 0, "NEES position",
           "normalised estimation error squared of the centre, 2 degrees of freedom",
           lambda pairs: pairs.nees[:, 0], 1, ideal=2.0, averaged=True),
    Metric("nees_velocity", PAIR, "1", 0, "NEES velocity", "the same of the velocity, 2 degrees of freedom",
           lambda pairs: pairs.nees[:, 1], 1, ideal=2.0, averaged=True),
    Metric("nees_heading", PAIR, "1", 0, "NEES heading", "the same of the heading, 1 degree of freedom",
           lambda pairs: (pairs.turn / pairs.estimate.heading_std) ** 2, 1, ideal=1.0, averaged=True),
    Metric("nees_length", PAIR, "1", 0, "NEES length", "the same of the length, 1 degree of freedom",
           lambda pairs: ((pairs.growth / pairs.estimate.size_std) ** 2)[:, 0], 1, ideal=1.0, averaged=True),
    Metric("nees_width", PAIR, "1", 0, "NEES width", "the same of the width, 1 degree of freedom",
           lambda pairs: ((pairs.growth / pairs.estimate.size_std) ** 2)[:, 1], 1, ideal=1.0, averaged=True),
    Metric("nees_edge", PAIR, "1", 0, "NEES near edge",
           "the same of the edge that faces the ego, across itself, 1 degree of freedom",
           lambda pairs: (pairs.near_edge[0] / pairs.near_edge[1]) ** 2, 1, ideal=1.0, averaged=True),
    Metric("nees_low", PAIRS, "1", 0, "NEES, low bound",
           "where the mean of `nees_position` or `nees_velocity` lies with a consistent filter: from this, chi-square",
           lambda e: nees_bounds(2, int(np.isfinite(e["nees_position"]).sum()))[0]),
    Metric("nees_high", PAIRS, "1", 0, "NEES, high bound", "where it lies: to this",
           lambda e: nees_bounds(2, int(np.isfinite(e["nees_position"]).sum()))[1]),
    Metric("pairs", PAIRS, "1", 0, "pairs", "pairs of object and track, over scans", lambda e: len(e["gwd"]), 0),
    # The worst of a run.
    Metric("plain_view_gap", RUN, "s", -1, "longest in view without a fitting track",
           "longest time in which an object was in plain view without an assigned track",
           lambda s: max((histories.plain_view_gap(h) for h, _ in s.objects), default=0.0)),
    Metric("uncovered_gap", RUN, "s", -1, "longest in view without a track",
           "longest time in which an object was in plain view without any track on it",
           lambda s: max((histories.uncovered_gap(h) for h, _ in s.objects), default=0.0)),
    Metric("orphan_duration", RUN, "s", -1, "longest orphan",
           "longest life of a track that never belonged to an object",
           lambda s: max((track.duration for track in s.tracks if track.orphan), default=0.0)),
    Metric("hota", RUN, "1", 1, "HOTA", "higher order tracking accuracy: detection and association together",
           lambda s: identities.hota(s.meetings), 3),
    Metric("mota", RUN, "1", 1, "MOTA",
           "multiple object tracking accuracy: one less misses, false tracks and switches per object",
           lambda s: s.clear["mota"], 3, needs="motmetrics"),
    Metric("idf1", RUN, "1", 1, "IDF1", "how often an object has the track that is its own",
           lambda s: s.clear["idf1"], 3, needs="motmetrics"),
    # What a tracker costs.
    Metric("ms_per_scan", COST, "ms", -1, "cost of a scan",
           "wall time of one scan: prediction, visibility and association of all tracks included",
           lambda c: 1e3 * c.seconds / c.scans if c.scans else np.nan, 1),
    Metric("us_per_update", COST, "us", -1, "cost of an update",
           "wall time of all scans over the updates: each track that got a detection in a scan is one",
           lambda c: 1e6 * c.seconds / c.updates if c.updates else np.nan, 0),
    # Drives of the ego.
    Metric("elapsed", DRIVE, "s", 0, "simulated", "simulated time",
           lambda d: float(d.curves.time[-1] - d.curves.time[0])),
    Metric("collisions", DRIVE, "1", -1, "collisions", "collisions of the ego: how often it was hit or hit something",
           lambda d: d.collisions),
    Metric("ttc_min", DRIVE, "s", 1, "least time to collision",
           f"least time to collision in the corridor ahead, at most {LONGEST:g} s",
           lambda d: float(np.minimum(d.curves.ttc, LONGEST).min())),
    Metric("ttc_plane_min", DRIVE, "s", 1, "least time to collision, all around",
           "least time to collision of boxes in the plane, so also of what comes from the side or from behind",
           lambda d: float(np.minimum(d.curves.ttc_plane, LONGEST).min())),
    Metric("distance_min", DRIVE, "m", 1, "least distance", "least distance box to box",
           lambda d: float(d.curves.distance.min())),
    Metric("distance_min_at", DRIVE, "s", 0, "time of the least distance", "when the distance was least",
           lambda d: d.closest, 1),
    Metric("progress", DRIVE, "m", 1, "progress", "way driven along the heading", lambda d: d.progress, 1),
    Metric("speed_mean", DRIVE, "m/s", 1, "mean speed", "progress over time", lambda d: d.speed_mean, 1),
    Metric("speed_max", DRIVE, "m/s", 0, "top speed", "largest speed", lambda d: float(np.max(d.curves.speed)), 1),
    Metric("deceleration_max", DRIVE, "m/s^2", -1, "hardest braking", "hardest braking, crashes excluded",
           lambda d: abs(float(np.fmin.reduce(d.curves.acceleration, initial=0.0)))),
    Metric("harsh_braking", DRIVE, "1", -1, "harsh brakings", "how often the acceleration fell below -4 m/s^2",
           lambda d: driving.count_onsets(d.curves.acceleration, d.harsh, d.released), 1),
    Metric("ttc_5", DRIVE, "s", 1, "5 % time to collision",
           f"5 % quantile of the time to collision over the frames, each at most {LONGEST:g} s",
           lambda d: float(np.quantile(np.minimum(d.curves.ttc, LONGEST), 0.05))),
    Metric("drac_max", DRIVE, "m/s^2", -1, "needed braking (DRAC)",
           f"hardest braking that was needed not to hit what is ahead, at most {driving.HARDEST:g} m/s^2",
           lambda d: float(d.curves.drac.max())),
    Metric("tit", DRIVE, "s^2", -1, "time-integrated TTC", f"time to collision below {driving.NEAR:g} s, integrated",
           lambda d: driving.time_integrated(d.curves)),
    Metric("headway_min", DRIVE, "s", 1, "least headway", f"least time headway, at most {LONGEST:g} s",
           lambda d: float(np.minimum(d.curves.headway, LONGEST).min())),
    Metric("jerk", DRIVE, "m/s^3", -1, "jerk", "root mean square of the change of the acceleration",
           lambda d: driving.rms_jerk(d.curves.acceleration, d.curves.dt)),
    Metric("off_road", DRIVE, "s", -1, "time off the road", "time with the centre of the ego on no lane",
           lambda d: d.off_road),
    Metric("drive_value", DRIVE, "s", 1, "drive value",
           "speed less the prices of a short time to collision and of braking, over time",
           lambda d: float((d.curves.value * d.curves.dt).sum())),
    Metric("score", SCORED, "1", 1, "drive score",
           "0 after a crash or off the road, else progress, time to collision and comfort, at most 1",
           driving.drive_score, 3),
    # A drive beside another one.
    Metric("extra_braking", DRIVES, "m/s", -1, "extra braking",
           "braking beyond that of the other drive, at equal times",
           lambda a, b: driving.extra_braking(a.curves, b.curves)),
    Metric("speed_difference", DRIVES, "m/s", -1, "speed difference", "root mean square difference of the speeds",
           lambda a, b: driving.speed_difference(a.curves, b.curves)),
    Metric("changed", DRIVES, "%", -1, "decisions changed", "decisions that differ",
           lambda a, b: 100 * driving.changed_decisions(a.decisions, b.decisions, driving.SAME), 0),
)  # fmt: skip
METRICS: Mapping[str, Metric] = MappingProxyType({metric.key: metric for metric in _TABLE})

ALIASES: Mapping[tuple[str, str], str] = MappingProxyType(
    {  # kind of file, key in files that were made before -> key
        ("comparison", "J"): "drive_value",
        ("comparison", "drive_score"): "drive_value",
        ("drives", "J"): "drive_value",
        ("drives", "drive_score"): "drive_value",
        ("drives", "collided"): "collisions",  # a crash ends an episode, so there is one or none
        ("drives", "brake_max"): "deceleration_max",
    }
)


def old_names(kind: str) -> dict[str, str]:
    """Old key -> key, of files of one kind."""
    return {old: key for (of, old), key in ALIASES.items() if of == kind}


@cache
def keys(*levels: str) -> tuple[str, ...]:
    """Keys of all metrics of some levels that can be computed here."""
    return tuple(m.key for m in METRICS.values() if m.of in levels and m.known)


def values(level: str, *of: Any) -> dict[str, Any]:
    """All metrics of a level by key."""
    return {key: METRICS[key].compute(*of) for key in keys(level)}


COSTS = keys(COST)

"""What the compiled functions of a step of many objects take: detections, boxes, and parameters as arrays."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.multi.road import RoadMap
from trackers.validation import LIMITS, PLATFORM

Numbers = tuple[float, ...]


class Boxes(NamedTuple):
    """T objects, the fields of `Estimate`."""

    pose: NDArray  # (T, 3)
    velocity: NDArray  # (T, 2)
    yaw_rate: NDArray  # (T,)
    size: NDArray  # (T, 2)
    cov: NDArray  # (T, 4, 4)
    size_std: NDArray  # (T, 2)
    yaw_rate_std: NDArray  # (T,)


class Sizes(NamedTuple):
    """The boxes of place and motion of T objects, and what is believed of their size; without rows: nothing is."""

    pose: NDArray  # (T, 3)
    size: NDArray  # (T, 2)
    cov: NDArray  # (T, 4, 4)
    anchor: NDArray  # (T, 2)
    mean: NDArray  # (T, 2) of the size
    offset: NDArray  # (T, 2)
    offset_var: NDArray  # (T, 2)
    length: NDArray  # (T, K) probabilities
    width: NDArray  # (T, K')


class Detections(NamedTuple):
    """M sorted detections, the fields of `SortedScan` and of its scan."""

    polar: NDArray  # (M, 3)
    pose: NDArray  # (M, 3)
    velocity: NDArray  # (M, 2)
    noise: NDArray  # (M, 3)
    sensor: NDArray  # (M,) int
    xy: NDArray  # (M, 2)
    sight: NDArray  # (M, 2)
    rate: NDArray  # (M,)
    var_along: NDArray  # (M,)
    var_across: NDArray  # (M,)
    static: NDArray  # (M,) bool
    in_lane: NDArray  # (M,) bool
    clutter: NDArray  # (M,)


class View(NamedTuple):
    """The fields of `Visibility`, and the probability that each sensor delivers nothing."""

    expected: NDArray  # (S, T)
    in_view: NDArray  # (T,) bool
    share: NDArray  # (S, T)
    complete: NDArray  # (T,)
    hidden: NDArray  # (T,) bool
    end_hidden: NDArray  # (T,) bool
    certain: NDArray  # (S, T)
    out: NDArray  # (S,)


class Claimed(NamedTuple):
    """Who owns the detections, and what that says of the existence of the tracks."""

    alive: NDArray  # (T,) existence before the detections
    owner: NDArray  # (M,) int, row of the track, -1 for none
    number: NDArray  # (T,) int, detections owned
    expected: NDArray  # (T,)
    log_ratio: NDArray  # (T,)


class Pool(NamedTuple):
    """Unexplained detections, the fields of `Unexplained`."""

    xy: NDArray  # (P, 2)
    sight: NDArray  # (P, 2)
    rate: NDArray  # (P,)
    var_along: NDArray  # (P,)
    var_across: NDArray  # (P,)
    clutter: NDArray  # (P,)
    sensor: NDArray  # (P,) int
    place: NDArray  # (P, 2)
    course: NDArray  # (P,)
    off_lane: NDArray  # (P,) bool
    age: NDArray  # (P,)


class Sheets(NamedTuple):
    """The data sheets of S sensors, the fields of `SensorArray`, and how sizes read their detections."""

    mount: NDArray  # (S, 3)
    max_range: NDArray  # (S,)
    fov: NDArray  # (S,)
    noise: NDArray  # (S, 3)
    clutter: NDArray  # (S,)
    clutter_density: NDArray  # (S,)
    clutter_density_2d: NDArray  # (S,)
    rates: NDArray  # (S, 3)
    profile: NDArray  # (S, 6) inside, grazing, surface_std, mean depth and its spread, slant
    lengths: NDArray  # (K,) [m] of the size posterior
    widths: NDArray  # (K',) [m]
    impossible: float
    sigma: float


class Limits(NamedTuple):
    """Least and greatest numbers (C,) of the fields of a scan, and which (C,) may be NaN."""

    polar: tuple[NDArray, NDArray, NDArray]
    pose: tuple[NDArray, NDArray, NDArray]
    velocity: tuple[NDArray, NDArray, NDArray]
    noise: tuple[NDArray, NDArray, NDArray]
    platform: tuple[NDArray, NDArray, NDArray]

    @classmethod
    def of(cls) -> "Limits":
        """Those of `trackers.validation`."""
        return cls(*((plain(l.least), plain(l.most), l.optional.copy()) for l in (*LIMITS.values(), PLATFORM)))


class Lanes(NamedTuple):
    """The road map, and whether there is one."""

    a: NDArray  # (L, 2)
    b: NDArray  # (L, 2)
    half_width: NDArray  # (L,)
    known: bool


class Rules(NamedTuple):
    """Parameters of the parts of a multi-object tracker, in the order in which the functions unpack them."""

    sheets: Sheets
    lanes: Lanes
    association: Numbers
    alarms: Numbers
    static: Numbers
    existence: Numbers
    outage: Numbers
    occlusion: Numbers
    suppression: Numbers
    window: Numbers
    linkage: Numbers
    evidence: Numbers
    exclusion: Numbers
    end: Numbers

    @classmethod
    def of(cls, t: Any) -> "Rules":
        """Those of a `MultiObjectTracker` whose parts are those of this package."""
        a, e, o, s, x = t.association, t.existence, t.outage, t.suppression, t.exclusion
        w, l, v = t.initiation.window, t.initiation.linkage, t.initiation.evidence
        ground = (np.inf, np.inf) if not t.ground else (t.ground.above, t.ground.longer)
        return cls(
            sheets_of(t),
            lanes_of(t.road),
            *(tuple(map(float, values)) for values in (
                (a.position_gate, a.rate_gate, a.rate_std, a.surface_std, a.own_above, a.least_expected,
                 a.fades, a.surprise),
                (*a.alarms, *a.alarm_cell),
                (a.static_rate, *a.static_density, *a.static_inside),
                (e.life_visible, e.life_hidden, e.life_silent, e.life_outside, e.dispersion, e.miss_floor, e.pair_cap,
                 e.missing, *e.bounds, e.most),
                (o.begins, o.lasts, o.dispersion, o.clutter_share),
                (t.occlude_above, t.occlude_hits, t.rate_factor, t.edge_sigmas),
                (s.along, s.across, s.above, s.end_along, s.end_across, s.end_rate),
                (w.span, w.span_standing, w.along_sight, w.beyond, w.moving, w.beside_lane, t.initiation.crowd),
                (l.along, l.across, l.rate, l.rate_between),
                (v.least, v.intensity, v.intensity_first, v.first_decay, v.off_lane, v.clutter_factor, v.pair_cap,
                 v.born_above, v.rate_span, v.standing_rate, v.static_least, v.static_scans, v.static_time,
                 v.static_drift),
                (x.overlap, x.overlap_speed, x.overlap_sure, x.lane, x.speed, x.short, *x.gap),
                (t.prune_below, t.prune_position_std, *ground),
            )),
        )  # fmt: skip


def sheets_of(t: Any) -> Sheets:
    """The data sheets of a tracker."""
    s, size = t.sensor_array, getattr(t.filter, "size", None)
    if size is None:
        return Sheets(*map(plain, s[:8]), np.zeros((len(s.fov), 6)), np.ones(1), np.ones(1), 0.0, 0.0)  # type: ignore[arg-type, call-arg]
    q = size.profiles
    profile = np.column_stack([q.inside, q.grazing, q.surface_std, q.depth, q.slant])
    sizes = size.length.sizes, size.width.sizes
    return Sheets(*map(plain, s[:8]), profile, *sizes, size.impossible, size.sigma)  # type: ignore[arg-type, call-arg]


def lanes_of(road: RoadMap | None) -> Lanes:
    """The road map of a tracker."""
    known = RoadMap.of([]) if road is None else road
    return Lanes(*map(plain, known), road is not None)  # type: ignore[arg-type, call-arg]


def plain(a: NDArray) -> NDArray:
    """A writable array of numbers in one piece: numba compiles for each layout."""
    return np.array(a, float, order="C")

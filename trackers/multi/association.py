"""Association: gates, likelihoods, and the one track that owns each detection.

Equations: docs/methods/multi-object-tracking.md, sections 1 and 5. A detection has weight one in the update of its
owner and none in any other: soft weights fall on the detections just outside the box, shrink it, and two tracks then
share one vehicle for good.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import ndtr

from trackers.batch import take
from trackers.estimate import Estimate
from trackers.geometry import cross, dot, rotation, to_frame, unit, vector
from trackers.multi.road import RoadMap
from trackers.multi.visibility import SensorArray
from trackers.parameters import check_numbers
from trackers.range_rate import over_ground
from trackers.scan import Scan

FEW_PAIRS = 2000  # pairs of track and detection up to which all are gated, without a search for those nearby
DEEPER = 1.25  # deviations of the noise across a lane, so far inside of which a birth is of no wall


class SortedScan(NamedTuple):
    """M detections without padding, sorted by sensor, range, azimuth and rate, with what association needs of them."""

    scan: Scan
    xy: NDArray  # (M, 2) [m]
    sight: NDArray  # (M, 2) unit lines of sight
    rate: NDArray  # (M,) [m/s] range rate over ground, NaN: not measured
    var_along: NDArray  # (M,) [m^2] noise along the line of sight
    var_across: NDArray  # (M,) [m^2] noise across it
    sensor: NDArray  # (M,) int
    static: NDArray  # (M,) bool, the range rate is that of something that stands still
    in_lane: NDArray  # (M,) bool, static and so far inside a lane of the map that it is of no wall
    clutter: NDArray  # (M,) intensity [1/(m^2 m/s)], or [1/m^2] where the rate is not measured


class Claims(NamedTuple):
    """G pairs of track and detection inside both gates, and the owner of each of M detections."""

    track: NDArray  # (G,) row of the track
    detection: NDArray  # (G,) row of the sorted scan
    gain: NDArray  # (G,) likelihood ratio of track against clutter, (MOT.20)
    owner: NDArray  # (M,) row of the track, -1 for none
    clutter: NDArray  # (M,) intensity as measured in this scan, as of `SortedScan`


@dataclass(frozen=True)
class Association:
    """Gates and noise of the association."""

    position_gate: float = 10.0  # squared distance outside the box, in standard deviations, (MOT.15)
    rate_gate: float = 12.0  # squared deviation of the range rate, in standard deviations, (MOT.19)
    rate_std: float = 0.5  # [m/s] noise of the ground range rate in the gate
    surface_std: float = 0.2  # [m] roughness of the box as a model of the outline
    own_above: float = 0.3  # least probability to own a detection
    least_expected: float = 0.5  # a track expects at least so many detections where one falls into its gates
    fades: float = np.inf  # [s] time constant with which these become fewer while no sensor should see the track
    surprise: float = 0.02  # and the share that stays
    settled: float = 1.0  # [s] age from which a track takes no single detection of a scan from far outside its box
    stray: float = 1.5  # [m] by which the gate for that one reaches further than that of the box
    alarms: tuple[float, float] = (20.0, 5.0)  # more than these, and times those of the data sheet, are false alarms
    alarm_cell: tuple[float, float, float] = (5.0, 5.0, 4.0)  # [m, m, m/s] in which they count as one
    static_rate: float = 0.4  # [m/s] least threshold below which a detection counts as static
    static_density: tuple[float, float] = (0.02, 0.002)  # [1/(m^2 m/s)] of returns of what stands: anywhere, in lanes
    static_inside: tuple[float, float] = (0.5, 0.5)  # [m] depth inside a lane for that; most for births

    def __post_init__(self) -> None:
        check_numbers(
            self, positive=("position_gate", "rate_gate", "rate_std", "fades"), unlimited=("fades", "settled")
        )

    def prepare(self, scan: Scan, sensors: SensorArray, road: RoadMap | None = None) -> tuple[SortedScan, NDArray]:
        """The M detections under the mask, sorted, and their indices (M,) in the scan; road is the map of the lanes.

        The order is that of the values, so a permutation of the scan gives the same result to the last digit.
        """
        polar = scan.polar
        sensor = scan.sensor + np.zeros(len(polar), int)
        order = np.lexsort((polar[:, 2], polar[:, 1], polar[:, 0], sensor))
        order = order[scan.mask[order]]
        sensor = sensor[order]
        pose, velocity, noise = (
            a[order] if len(a) > 1 else np.repeat(a, len(order), 0) for a in (scan.pose, scan.velocity, scan.noise)
        )
        noise = np.where(np.isnan(noise), sensors.noise[sensor], noise)
        sorted_scan = Scan(polar[order], np.ones(len(order), bool), pose, velocity, noise, sensor, scan.platform)
        sight = sorted_scan.sight
        rate = sorted_scan.rates(sight)
        sideways = cross(sight, velocity)
        sigma_g = np.hypot(noise[:, 2], sideways * noise[:, 1])  # (MOT.4)
        static = np.abs(rate) < np.maximum(self.static_rate, 3 * sigma_g)  # (MOT.5)
        clutter = np.where(np.isnan(rate), sensors.clutter_density_2d[sensor], sensors.clutter_density[sensor])
        xy, var_along = sorted_scan.points(sight), noise[:, 0] ** 2  # (MOT.3)
        var_across = (sorted_scan.polar[:, 0] * noise[:, 1]) ** 2  # (MOT.3)
        depth, deep = np.full(len(xy), -np.inf), np.full(len(xy), np.inf)
        if road is not None:
            depth[static], course = road.locate(xy[static])
            along = cross(unit(course), sight[static]) ** 2  # share of the noise along the line of sight
            sigma = np.sqrt(var_along[static] * along + var_across[static] * (1 - along))
            deep[static] = np.minimum(np.maximum(self.static_inside[0], DEEPER * sigma), self.static_inside[1])
        in_lane = depth > deep  # (MOT.28)
        of_static = np.where(depth > self.static_inside[0], self.static_density[1], self.static_density[0])
        return SortedScan(
            scan=sorted_scan,
            xy=xy,
            sight=sight,
            rate=rate,
            var_along=var_along,
            var_across=var_across,
            sensor=sensor,
            static=static,
            in_lane=in_lane,
            clutter=clutter + np.where(static, of_static, 0.0),  # (MOT.6)
        ), order

    def claim(
        self,
        log_spatial: Callable[..., NDArray] | None,
        state: object,
        estimate: Estimate,
        existence: NDArray,
        expected: NDArray,
        z: SortedScan,
        false_alarms: NDArray | None = None,
        hidden: NDArray | None = None,
    ) -> Claims:
        """Pairs inside both gates, and the owner of each of the M detections.

        estimate and existence (T,) are those of the predicted tracks, expected (S, T) their expected detections by
        sensor. `log_spatial` is that of the filter with the state (T,), see `trackers.filter.Abilities`; None stands
        for a density that is even over the box. false_alarms (S,) are those of the data sheets, with which those of
        this scan are compared; None: the clutter is that of the data sheets. hidden (T,) [s] is how long no sensor
        should have seen a track; None: some should.
        """
        track, detection, log_box = self.inside_gate(estimate, z)
        log_rate, near = self.inside_rate_gate(estimate, z, track, detection)
        track, detection, log_box, log_rate = (a[near] for a in (track, detection, log_box, log_rate))
        if log_spatial is not None:
            log_box = log_spatial(state, z.scan, track, detection)
        clutter = z.clutter if false_alarms is None else z.clutter * self._excess(z, detection, false_alarms)[z.sensor]
        unseen = np.zeros(len(existence)) if hidden is None else hidden
        least = self.least_expected * np.maximum(np.exp(-unseen / self.fades), self.surprise)  # (MOT.64)
        gam = np.maximum(expected[z.sensor[detection], track], least[track])
        gain = gam * np.exp(log_box + log_rate) / clutter[detection]  # (MOT.20)
        weight, M = existence[track] * gain, len(z.rate)
        best, owner = np.zeros(M), np.full(M, -1)
        np.maximum.at(best, detection, weight)
        p = best / (1 + np.bincount(detection, weight, M))  # (MOT.21)
        wins = ((weight == best[detection]) & (p[detection] > self.own_above))[::-1]  # of equals the first comes last
        owner[detection[::-1][wins]] = track[::-1][wins]  # (MOT.22)
        return Claims(track, detection, gain, owner, clutter)

    def _excess(self, z: SortedScan, explained: NDArray, false_alarms: NDArray) -> NDArray:
        """Factors (S,) by which the false alarms of this scan exceed those of the data sheets, false_alarms (S,).

        Counted are moving things outside the gates of all tracks, of those nearby and of one rate one: `explained` are
        the rows of detections inside.
        """
        loose = ~z.static & np.isfinite(z.rate)
        loose[explained] = False
        grid = np.floor(np.c_[z.xy, z.rate][loose] / self.alarm_cell).astype(int)
        alarms = np.bincount(np.unique(np.c_[grid, z.sensor[loose]], axis=0)[:, 3], minlength=len(false_alarms))
        sheet = np.maximum(false_alarms, 1.0)
        return np.where(alarms > self.alarms[0] + self.alarms[1] * sheet, alarms / sheet, 1.0)  # (MOT.49)

    def inside_gate(self, estimate: Estimate, z: SortedScan) -> tuple[NDArray, NDArray, NDArray]:
        """Pairs (G,) inside the position gate, and the log density (G,) [1/m^2] of a box blurred by all noise."""
        M, own = self._own(estimate)
        half = (estimate.size / 2)[:, None]
        if len(own) * len(z.rate) < FEW_PAIRS:
            rows, xy, along, across = None, z.xy, z.var_along, z.var_across
            cos2 = (unit(estimate.pose[:, 2]) @ z.sight.T) ** 2
        else:
            rows, there = self._nearby(estimate, own, z)  # (T, K)
            xy, along, across = z.xy[rows], z.var_along[rows], z.var_across[rows]
            cos2 = (z.sight[rows] @ M)[..., 0] ** 2
        e = to_frame(estimate.pose, xy)  # (T, M or K, 2)
        C = _noise(cos2, along, across)
        C += own[:, None]  # (MOT.14a), (MOT.14b)
        d2 = np.maximum(np.abs(e) - half, 0.0) ** 2 / C
        inside = d2[..., 0] + d2[..., 1] < self.position_gate  # (MOT.15)
        track, column = np.nonzero(inside if rows is None else inside & there)
        detection = column if rows is None else rows[track, column]
        e, s, half = e[track, column], np.sqrt(C[track, column]), half[track, 0]
        # On the far side of an axis both terms are near one: use the mirrored tail, which keeps its digits.
        a = np.abs(e)
        mass = ndtr((half - a) / s) - ndtr((-half - a) / s)
        return track, detection, np.log(np.maximum(mass, 1e-300) / (2 * half)).sum(-1)  # (MOT.16)

    def strays(self, estimate: Estimate, age: NDArray, detections: NDArray, z: SortedScan, owner: NDArray) -> NDArray:
        """Mask (M,) of the detections that are the only one of a track older than `settled` and far outside its box.

        estimate (T,) are the predicted tracks, age (T,) [s] and detections (T,) theirs, owner (M,) the track of each
        detection, -1 for none. Far is outside the position gate of a box that ends `stray` further out than the
        estimated one.
        """
        stray = np.isin(owner, np.flatnonzero((detections == 1) & (age > self.settled)))
        lone = np.flatnonzero(stray)
        if not len(lone):
            return stray
        box = take(estimate, owner[lone])
        M, own = self._own(box)
        cos2 = dot(z.sight[lone], M[..., 0]) ** 2
        C = own + _noise(cos2, z.var_along[lone], z.var_across[lone])  # (MOT.14a), (MOT.14b)
        outside = np.abs(to_frame(box.pose, z.xy[lone, None])[:, 0]) - box.size / 2 - self.stray
        stray[lone] = (np.maximum(outside, 0.0) ** 2 / C).sum(-1) >= self.position_gate  # (MOT.67)
        return stray

    def _own(self, estimate: Estimate) -> tuple[NDArray, NDArray]:
        """Rotations (T, 2, 2) of boxes, and the variances (T, 2) [m^2] along their axes without noise of detections."""
        M = rotation(estimate.pose[:, 2])
        P = (M.mT @ estimate.cov[:, :2, :2] @ M).diagonal(axis1=-2, axis2=-1)
        return M, P + self.surface_std**2 + estimate.size_std**2 / 4

    def _nearby(self, estimate: Estimate, own: NDArray, z: SortedScan) -> tuple[NDArray, NDArray]:
        """Rows (T, K) of the detections that may be inside the position gates, in rising order, and bool which are any.

        own (T, 2) [m^2] is the variance along the axes of a box without the noise of detections; K is at least 2, as
        products of a single row may differ from others in the last digit.
        """
        noise = max(z.var_along.max(), z.var_across.max())
        reach = np.hypot(*(estimate.size / 2 + np.sqrt(self.position_gate * (own + noise))).T)
        found = cKDTree(z.xy).query_ball_point(estimate.pose[:, :2], reach * (1 + 1e-9), return_sorted=True)
        count = np.array([len(one) for one in found])
        there = np.arange(max(count.max(), 2)) < count[:, None]
        rows = np.zeros(there.shape, int)
        rows[there] = np.concatenate(found).astype(int)
        return rows, there

    def inside_rate_gate(
        self, estimate: Estimate, z: SortedScan, track: NDArray, detection: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Log density (G,) [s/m] of the ground range rates, 0 where not measured, and whether inside the rate gate."""
        u, g = z.sight[detection], z.rate[detection]
        lever = z.xy[detection] - estimate.pose[track, :2]
        ghat = over_ground(u, estimate.velocity[track], estimate.yaw_rate[track], lever)  # (MOT.17)
        var = dot(u, (estimate.cov[track, 2:, 2:] @ u[..., None])[..., 0])
        var = var + (cross(lever, u) * estimate.yaw_rate_std[track]) ** 2 + self.rate_std**2  # (MOT.18)
        measured = np.isfinite(g)
        d2 = np.where(measured, (g - ghat) ** 2 / var, 0.0)  # (MOT.19)
        log_rate = np.where(measured, -0.5 * (d2 + np.log(2 * np.pi * var)), 0.0)  # (MOT.19)
        return log_rate, d2 < self.rate_gate


def _noise(cos2: NDArray, along: NDArray, across: NDArray) -> NDArray:
    """Variances (..., 2) [m^2] along the axes of boxes of the noise along and across lines of sight.

    cos2 is the square of the cosine of the angle between a line of sight and the first axis.
    """
    sin2 = 1 - cos2
    return vector(along * cos2 + across * sin2, along * sin2 + across * cos2)  # (MOT.14a), (MOT.14b)


def shares(owner: NDArray, tracks: int, most: int) -> NDArray:
    """Indices (T, K) of the detections of each track, -1 for padding; K at most `most`.

    owner (M,) is the row of each detection's track, -1 for none. Of a track with more than `most`, evenly spaced ones
    in the order of the sorted scan are kept.
    """
    count = np.bincount(owner[owner >= 0], minlength=tracks)
    K = int(min(count.max(initial=0), most))
    index = np.full((tracks, max(K, 1)), -1)
    detections = np.argsort(owner, kind="stable")[(owner < 0).sum() :]
    start = np.concatenate([[0], np.cumsum(count)])
    for t in np.flatnonzero(count):
        mine = detections[start[t] : start[t + 1]]
        if len(mine) > most:
            mine = mine[np.linspace(0, len(mine) - 1, most).round().astype(int)]
        index[t, : len(mine)] = mine
    return index


def gather(z: SortedScan, index: NDArray) -> Scan:
    """One scan (T, K) a track, of the detections with indices `index` (T, K), -1 for padding."""
    scan = z.scan
    if not len(z.rate):
        T, K = index.shape
        return Scan(np.zeros((T, K, 3)), np.zeros((T, K), bool), np.zeros((T, K, 3)), np.zeros((T, K, 2)))
    i = np.maximum(index, 0)
    return Scan(scan.polar[i], index >= 0, scan.pose[i], scan.velocity[i], scan.noise[i], scan.sensor[i], scan.platform)


def least(value: NDArray, owner: NDArray, T: int) -> NDArray:
    """Least value (T,) of the detections of each track, inf without one; value (M,), owner (M,), -1 for none."""
    found = np.full(T, np.inf)
    np.minimum.at(found, owner[owner >= 0], value[owner >= 0])
    return found

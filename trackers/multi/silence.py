"""Silence: a longer vehicle would reach into the view of sensors that have no detection of it.

What a sensor with detections has in view is in their likelihood; this is of those without. Equations:
docs/methods/multi-object-tracking.md, section 3.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import rotation, to_frame, unit, vector, wrap_angle
from trackers.multi.association import SortedScan
from trackers.multi.visibility import SHADOW, SensorArray, angular_spans, entered, first_shadows
from trackers.parameters import check_numbers
from trackers.shade import NEARER

LENGTHS = 12  # that are tried, from SHORTEST up to the greatest that is possible
SHORTEST = 1.5  # [m]
REACH = 20.0  # [m] no vehicle reaches further from its centre
RAYS = 24  # over the part of the longest box that is in view


class Quiet(NamedTuple):
    """What silence says of the lengths of R tracks."""

    rows: NDArray  # (R,) of the tracks
    length: NDArray  # (R, C) [m] rising
    log_p: NDArray  # (R, C) log probability of the silence, were this the length


class Pairs(NamedTuple):
    """P pairs of a sensor without detections and a track that would be in its view, were it longer."""

    sensor: NDArray  # (P,) int
    row: NDArray  # (P,) int, among those R that are asked for
    low: NDArray  # (P,) [rad] azimuth where the part in view begins, in the frame of the sensor
    span: NDArray  # (P,) [rad] up to where it ends


def tried(longest: Estimate) -> NDArray:
    """Lengths (R, C) [m] up to those of the greatest boxes (R,)."""
    return SHORTEST + np.linspace(0.0, 1.0, LENGTHS) * (longest.size[:, :1] - SHORTEST)


@dataclass(frozen=True)
class Silence:
    """When the silence of a sensor speaks against a length, and how loud."""

    unsure: float = 0.5  # [m] standard deviation of a length from which on it is asked for
    weight: float = 0.5  # of a scan: what no model of a radar has right is the same in the next one
    dispersion: float = 2.0  # k of the negative binomial count
    least: float = 0.1  # probability of silence, however many detections are expected
    margin: float = 0.5  # [m] about the longest box, where a detection of something else hinders all conclusions

    def __post_init__(self) -> None:
        check_numbers(self, positive=("dispersion", "least"))

    def asked(
        self, estimate: Estimate, some: NDArray, z: SortedScan, owner: NDArray, out: NDArray, sensors: SensorArray
    ) -> NDArray:
        """Rows (R,) of the tracks with detections, some (T,) bool, of which silence may say something.

        The length of such a one is not sure, and some sensor that works and has no detection of it might see it, were
        it as long as vehicles are.
        """
        rows = np.flatnonzero(some & (estimate.size_std[:, 0] > self.unsure))
        if not len(rows):
            return rows
        poses, heard = sensors.poses(z.scan.platform), np.zeros((len(out), len(some)), bool)
        heard[z.sensor[owner >= 0], owner[owner >= 0]] = True
        v = estimate.pose[rows, :2] - poses[:, None, :2]  # (S, R, 2)
        r = np.hypot(v[..., 0], v[..., 1])
        wide = sensors.fov[:, None] / 2 + np.where(r > REACH, np.arcsin(REACH / np.maximum(r, REACH)), np.pi)
        sees = np.abs(wrap_angle(np.arctan2(v[..., 1], v[..., 0]) - poses[:, 2:])) < wide
        sees &= (r < sensors.max_range[:, None] + REACH) & (out[:, None] < 0.5) & ~heard[:, rows]
        return rows[sees.any(0)]

    def quiet(
        self, rows: NDArray, longest: Estimate, estimate: Estimate, occluder: NDArray, z: SortedScan, owner: NDArray,
        out: NDArray, sensors: SensorArray, rate_factor: float,
    ) -> Quiet | None:  # fmt: skip
        """What sensors without a detection of the tracks rows (R,) say of their lengths; None: nothing.

        longest (R,) are their greatest boxes that are possible, estimate (T,) all tracks, occluder (T,) bool those that
        hide others, owner (M,) the rows of the tracks that own the detections z, out (S,) the probabilities that the
        sensors deliver nothing, rate_factor the factor of their counts.
        """
        poses = sensors.poses(z.scan.platform)
        pairs = self._pairs(rows, longest, z, owner, out, sensors, poses)
        if not len(pairs.row):
            return None
        length = tried(longest)
        Gam = rate_factor * self._expected(pairs, length, rows, longest, estimate, occluder, sensors, poses)
        none = np.maximum((1 + Gam / self.dispersion) ** -self.dispersion, self.least)  # (MOT.57)
        log_p = np.zeros(length.shape)
        np.add.at(log_p, pairs.row, self.weight * np.log(none))  # (MOT.57)
        return Quiet(rows, length, log_p)

    def _pairs(
        self, rows: NDArray, longest: Estimate, z: SortedScan, owner: NDArray, out: NDArray, sensors: SensorArray,
        poses: NDArray,
    ) -> Pairs:  # fmt: skip
        """Those of sensors that work and have no detection, be it of something else, where a longest box may be."""
        low, high, nearest = angular_spans(longest, poses)  # (S, R)
        edge = sensors.fov[:, None] / 2
        low, high = np.maximum(low, -edge), np.minimum(high, edge)  # (MOT.8)
        s, r = np.nonzero((high > low) & (nearest < sensors.max_range[:, None]) & (out[:, None] < 0.5))
        its = z.sensor == s[:, None]  # (P, M)
        inside = (np.abs(to_frame(longest.pose[r], z.xy)) < longest.size[r, None] / 2 + self.margin).all(-1)
        silent = ~(its & (inside | (owner == rows[r, None]))).any(-1)  # (MOT.54)
        s, r = s[silent], r[silent]
        return Pairs(s, r, low[s, r], (high - low)[s, r])

    def _expected(
        self, pairs: Pairs, length: NDArray, rows: NDArray, longest: Estimate, estimate: Estimate, occluder: NDArray,
        sensors: SensorArray, poses: NDArray,
    ) -> NDArray:  # fmt: skip
        """Detections (P, C) by the data sheets, were the lengths these (R, C) [m]; near ends are where they are."""
        s, r = pairs.sensor, pairs.row
        size, place = estimate.size[rows], estimate.pose[rows, None, :2]
        more = np.maximum(longest.size[:, :1] - size[:, :1], 1e-3)
        moved = (length - size[:, :1]) / more * (longest.size[:, :1] > size[:, :1])
        centre = place + moved[..., None] * (longest.pose[:, None, :2] - place)  # (R, C, 2), (MOT.55)
        half = vector(length, np.broadcast_to(size[:, 1:], length.shape)) / 2
        bearing = poses[s, 2:] + pairs.low[:, None] + pairs.span[:, None] * (np.arange(RAYS) + 0.5) / RAYS
        ray, turn = unit(bearing), rotation(longest.pose[r, 2])  # (P, B, 2), (P, 2, 2)
        first = first_shadows(poses[s], ray, rows[r], estimate, np.flatnonzero(occluder))
        origin = (poses[s, None, :2] - centre[r]) @ turn
        own = entered(origin[:, :, None], (ray @ turn)[:, None], half[r][:, :, None])  # (P, C, B)
        sees = (first[:, None] > own - NEARER - SHADOW) & (own < sensors.max_range[s, None, None])  # (MOT.10)
        own = np.where(sees, own, 0.0)
        chord = own.sum(-1) * pairs.span[:, None] / RAYS  # (MOT.56)
        nearest = np.where(sees, own, np.inf).min(-1)
        which = np.broadcast_to(s[:, None], chord.shape)
        return sensors.expected_count(which, np.where(chord > 0, nearest, 1.0), chord)  # (MOT.56)

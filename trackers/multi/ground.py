"""The ground under a track: one long vehicle, or two in file with empty ground between them.

Detections lie all along the visible side of one vehicle. Where many are expected and few are seen for long, while there
are some on both sides, there are two. Equations: docs/methods/life-cycle-of-tracks.md, section 6.
"""

from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import take
from trackers.estimate import Estimate
from trackers.geometry import dot, to_frame, to_world, unit, vector, wrap_angle
from trackers.multi.association import SortedScan
from trackers.multi.beside import BesideTest
from trackers.multi.visibility import SensorArray, Visibility, ray_box
from trackers.parameters import check_numbers
from trackers.size.fleet import Fleet
from trackers.size.grid import LENGTH
from trackers.size.visible import in_view

STEP, CELLS = 0.25, 128  # [m] and number of the cells along a track: 16 m to both sides of the origin
PLACE = STEP * (np.arange(CELLS) - CELLS // 2 + 0.5)  # [m] of the cells
LEAST_HITS = 0.5  # below which a cell has none
COARSE = 4  # cells for which one ray decides whether others hide them


class Ground(NamedTuple):
    """What was seen along D long tracks; it fades."""

    id: NDArray  # (D,) int
    origin: NDArray  # (D, 2) [m] of the cells; moves with the velocity of the track, not with its box
    seen: NDArray  # (D, CELLS) detections
    expected: NDArray  # (D, CELLS) of as many detections on one vehicle
    hits: NDArray  # (D, CELLS) detections on any side, also where its own side is not in view
    end_on: NDArray  # (D, CELLS) those of sensors that see more of an end than of a side


class Split(NamedTuple):
    """Which of D tracks are two vehicles, and where these lie along its heading, from its centre."""

    where: NDArray  # (D,) bool
    ratio: NDArray  # (D,) log odds
    rear: NDArray  # (D, 2) [m] from, to
    front: NDArray  # (D, 2) [m] from, to


def untouched(id: NDArray, origin: NDArray) -> Ground:
    """Ground of D tracks of which nothing was seen."""
    return Ground(id, origin, *(np.zeros((len(id), CELLS)) for _ in Ground._fields[2:]))


NOTHING = untouched(np.zeros(0, int), np.zeros((0, 2)))


@dataclass(frozen=True)
class GroundTest:
    """When a track is two vehicles in file."""

    memory: float = 1.5  # [s]
    longer: float = 5.5  # [m] length from which a track may be two vehicles
    above: float = 0.5  # existence from which it is looked at
    aside: float = 0.4  # [m] beside the box, up to which detections count as its own
    rate: float = 2.0  # [m/s] difference of the range rate up to which they do
    gaps: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 40, 48)  # [cells] widths of empty ground that are tried
    beside: int = 6  # [cells] on each side of the gap, from which the density in it is foretold
    facing: float = 0.5  # share of the detections of a vehicle whose side is in no view, that its end at the gap has
    face: int = 4  # [cells] at both ends of a box that is seen end-on, where its face may be
    denser: float = 2.5  # most by which more detections than expected beside a gap, no wider than that, count for it
    thin: float = 0.5  # share of the expected detections that one vehicle may show in a stretch
    stray: float = 0.1  # share of them that noise carries into a gap
    independent: float = 60.0  # a sensor with more detections of a track in a scan counts as so many
    surer: float = 3.0  # log odds from which it is two
    least: float = 4.0  # detections of each of the two
    closest: float = 2.0  # [m] mean gap of a queue that stands
    headway: float = 1.0  # [s] by which the mean gap grows with the speed
    strays: float = 0.05  # share of the detections of one of the two that may lie beyond its end
    slack: float = 0.5  # [m] to which ends lie beyond the outermost others
    beyond: float = 1.0  # [m] ahead or behind, where no sensor looks if an end is open
    open_std: float = 2.0  # [m] of the length of one with an open end
    settled: float = 1.0  # [s] age from which a track may begin with empty ground
    unreached: float = LENGTH.reach  # [m] of empty ground up to which its size is corrected without a new start
    fleet: Fleet = field(default_factory=Fleet)  # whose lengths one vehicle, or two, may have
    length_std: float = 0.7  # [m] of a length, beside the spread of its class
    width_std: float = 0.1  # [m] of a width, beside that and what is claimed of it
    lanes: BesideTest = field(default_factory=BesideTest)  # of two that are not in file

    def __post_init__(self) -> None:
        check_numbers(self)

    def examined(self, estimate: Estimate, existence: NDArray) -> NDArray:
        """Rows (D,) of the tracks (T,) that may be two vehicles."""
        return np.flatnonzero((existence > self.above) & (estimate.size[:, 0] > self.longer))

    def predict(self, ground: Ground, id: NDArray, estimate: Estimate, dt: float) -> Ground:
        """What was seen of the D tracks of these ids, moved with them and faded over dt [s]; nothing of new ones."""
        new = untouched(id, estimate.pose[:, :2].copy())
        _, here, there = np.intersect1d(id, ground.id, assume_unique=True, return_indices=True)
        new.origin[here] = ground.origin[there] + estimate.velocity[here] * dt  # (LIFE.30)
        for old, faded in zip(ground[2:], new[2:], strict=True):
            faded[here] = np.exp(-dt / self.memory) * old[there]  # (LIFE.30)
        shift = shift_of(new, estimate)[:, 0]
        for row in np.flatnonzero(np.abs(shift) > STEP * CELLS / 8):  # the box would leave the cells
            cells = int(np.rint(shift[row] / STEP))
            new.origin[row] += cells * STEP * unit(estimate.pose[row, 2])
            for faded in new[2:]:
                faded[row] = moved(faded[row], -cells)
        return new

    def observe(
        self, ground: Ground, d: NDArray, e: Estimate, estimate: Estimate, view: Visibility, z: SortedScan,
        sensors: SensorArray,
    ) -> Ground:  # fmt: skip
        """The ground of tracks d (D,), whose estimates are e, after a scan of M detections, among T tracks.

        Sensors whose detections are patchy say nothing of it.
        """
        looks = (view.expected[:, d] > 0) & ~sensors.patchy[:, None]
        k, row = np.nonzero(looks)  # G pairs of sensor and track, one sensor after the other
        places = sensors.poses(z.scan.platform)
        poses, body, size = places[k], e.pose[row], e.size[row]
        shift = shift_of(ground, e)
        away = to_frame(body, poses[:, None, :2])[:, 0]  # (G, 2) of the sensors
        narrow = end_on(e, places) & ~sensors.patchy
        density = self._density(body, size, shift[row], away[:, 1:], d[row], estimate, poses, sensors.at(k))
        density *= ~(narrow[row, k][:, None] & self._on_face(PLACE - shift[row], away[:, :1], size[:, :1] / 2))
        cell, there, across, most = self._along(e, shift, z)
        of_body = there & (np.abs(across) < most)
        ground = ground._replace(
            hits=ground.hits + counts(cell, of_body),
            end_on=ground.end_on + counts(cell, of_body & narrow[:, z.sensor]),
        )
        cell, there, across, most = (a[row] for a in (cell, there, across, most))
        towards = across * np.sign(away[:, 1:])
        there &= (z.sensor == k[:, None]) & (towards > 0) & (towards < most)
        n = counts(cell, there) * (density > 0)
        total = n.sum(1, keepdims=True)
        weight = np.minimum(1.0, self.independent / np.maximum(total, 1.0))
        share = density / np.maximum(density.sum(1, keepdims=True), 1e-9)
        seen, expected = ground.seen.copy(), ground.expected.copy()
        for one, own, foretold in zip(row, weight * n, weight * total * share, strict=True):
            seen[one] += own  # (LIFE.32)
            expected[one] += foretold  # (LIFE.32)
        return ground._replace(seen=seen, expected=expected)

    def _along(self, e: Estimate, shift: NDArray, z: SortedScan) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Cells of the detections, whether they may be of a body, their place across it and the most of that [m].

        All are (D, M).
        """
        body = to_frame(e.pose, z.xy)  # (D, M, 2)
        cell = np.floor((body[..., 0] + shift) / STEP).astype(int) + CELLS // 2
        rate = ~(np.abs(z.rate - e.velocity @ z.sight.T) > self.rate)  # one that is not measured counts
        along = np.abs(body[..., 0]) < e.size[:, :1] / 2 + STEP
        most = e.size[:, 1:] / 2 + self.aside + np.sqrt(z.var_across)
        return cell, rate & along & (cell >= 0) & (cell < CELLS), body[..., 1], most

    def _on_face(self, x: NDArray, along: NDArray, half: NDArray) -> NDArray:
        """Places x (G, CELLS) where the face of a box may be that is turned to a sensor at along (G, 1), all in [m]."""
        return np.sign(along) * x > half - self.face * STEP

    def _density(
        self, body: NDArray, size: NDArray, shift: NDArray, aside: NDArray, d: NDArray, estimate: Estimate,
        poses: NDArray, sensor: SensorArray,
    ) -> NDArray:  # fmt: skip
        """Relative density (G, CELLS) of the detections along the sides of G boxes, 0 where hidden.

        The boxes, body (G, 3), size (G, 2), shift (G, 1) and rows d (G,) among all tracks, are seen by sensors at poses
        (G, 3), which lie aside (G, 1) [m] of their axes; all of that is of pairs, so are the data sheets.
        """
        half, x = size[:, 1:] / 2, PLACE - shift  # (G, CELLS) in the body frame
        v = to_world(body, vector(x, np.sign(aside) * half)) - poses[:, None, :2]  # (G, CELLS, 2)
        r = np.hypot(v[..., 0], v[..., 1])
        sees = np.abs(wrap_angle(np.arctan2(v[..., 1], v[..., 0]) - poses[:, 2:])) < sensor.fov[:, None] / 2
        sees &= (r < sensor.max_range[:, None]) & (np.abs(x) < size[:, :1] / 2 + STEP)
        some = slice(COARSE // 2, None, COARSE)
        hit = ray_box(poses[:, :2], v[:, some] / r[:, some, None], estimate.pose, estimate.size)
        hit[np.arange(len(d)), :, d] = np.inf
        sees &= np.repeat(hit.min(-1) > r[:, some], COARSE, axis=1)
        lit = np.maximum(np.abs(aside) - half, 0.0) / r  # sine of the angle under which the side is seen
        return np.where(sees, np.sqrt(lit) / r, 0.0)  # (LIFE.31)

    @cached_property
    def _of_class(self) -> NDArray:
        """Density (C, CELLS) [1/m] of the lengths of each class, at the multiples of `STEP`."""
        mean, std = np.array([c.length for c in self.fleet.classes]).T[..., None]
        std = np.hypot(std, self.length_std)
        return np.asarray(np.exp(-0.5 * ((STEP * np.arange(CELLS) - mean) / std) ** 2) / (std * np.sqrt(2 * np.pi)))

    def lengths(self, width: NDArray, width_std: NDArray) -> NDArray:
        """Density (D, CELLS) [1/m] of the lengths of vehicles no wider than D tracks, at the multiples of `STEP`.

        width and its std (D,) [m]. A class that is wider than the track is less likely; of one that is narrower the
        width of the track says nothing, for where only a side is seen the width follows from the length.
        """
        mean, std = np.array([c.width for c in self.fleet.classes]).T
        wider = np.maximum(mean - width[:, None], 0.0)
        p = self.fleet.shares * np.exp(-0.5 * wider**2 / (std**2 + self.width_std**2 + width_std[:, None] ** 2))
        p /= p.sum(1, keepdims=True)
        return (1 - self.fleet.floor) * p @ self._of_class + self.fleet.floor / (STEP * (CELLS - 1))  # (LIFE.35)

    def _in_file(self, lengths: NDArray, speed: NDArray) -> tuple[NDArray, NDArray]:
        """Densities (D, CELLS) of the gap to the next vehicle, and of the extent of one vehicle or several in file.

        Both [1/m] at the multiples of `STEP`, as lengths (D, CELLS) are, at speeds (D,) [m/s].
        """
        mean = (self.closest + self.headway * speed)[:, None]
        gap = np.exp(-STEP * np.arange(CELLS) / mean) / mean  # (LIFE.36)
        one, next = np.fft.rfft(lengths, 8 * CELLS), np.fft.rfft(STEP**2 * gap, 8 * CELLS)
        more = one * next
        return gap, np.fft.irfft(one * (1 + more * (1 + more * (1 + more))), 8 * CELLS)[:, :CELLS]  # (LIFE.37)

    def two(self, estimate: Estimate, a: NDArray, b: NDArray) -> NDArray:
        """Which of P pairs of tracks in file, rows a and b, are two vehicles by lengths and widths alone, bool (P,).

        The width is that of the track of which it is known better.
        """
        rows, std = np.arange(len(a)), estimate.size_std[:, 1]
        width = np.where(std[a] < std[b], estimate.size[a, 1], estimate.size[b, 1])
        lengths = self.lengths(width, np.minimum(std[a], std[b]))
        gaps, file = self._in_file(lengths, np.hypot(*estimate.velocity[a].T))
        long = np.abs(to_frame(estimate.pose[a], estimate.pose[b, None, :2])[:, 0, 0])
        la, lb = estimate.size[a, 0], estimate.size[b, 0]
        one = lengths[rows, cells_of(long + (la + lb) / 2)]
        gap = gaps[rows, cells_of(np.maximum(long - (la + lb) / 2, 0.0))]
        ratio = np.log(file[rows, cells_of(la)] * gap * file[rows, cells_of(lb)]) - np.log(one)  # (LIFE.39)
        return np.asarray(ratio > self.surer)

    def split(self, ground: Ground, estimate: Estimate) -> Split:
        """Which of D tracks are two vehicles; estimate (D,) is theirs."""
        D, b = len(ground.id), self.beside
        rows, none = np.arange(D)[:, None], np.zeros((D, 1))
        S, X, H, E = (np.concatenate([none, np.cumsum(a, 1)], 1) for a in ground[2:])
        edge = STEP * (np.arange(CELLS + 1) - CELLS // 2) - shift_of(ground, estimate)  # (D, CELLS + 1) of the body
        end = estimate.size[:, :1] / 2
        half, deep = end + STEP, end - self.face * STEP
        lengths = self.lengths(estimate.size[:, 1], estimate.size_std[:, 1])
        gaps, file = self._in_file(lengths, np.sqrt(dot(estimate.velocity, estimate.velocity)))
        long = np.log(lengths[rows, cells_of(2 * half - 2 * STEP)])  # (D, 1)
        rear, front = (np.log(file[rows, cells_of(a)]) for a in (edge + half - STEP, half - STEP - edge))
        begins, ends = edge > -half, edge < half
        behind, ahead = (n >= self.least for n in (H, H[:, -1:] - H))
        w, edges = np.array(self.gaps)[:, None], np.arange(b, CELLS + 1 - b)  # (W, 1), (P,)
        first, last = edges + 0 * w, np.minimum(edges + w, CELLS - b)  # (W, P) edges where a gap begins and ends
        ratio = self._of_sides(S, X, H, first, last)
        low, high = ((edge < x).sum(1)[:, None, None] for x in (-deep, deep))
        other, known = self._of_insides(E, low, high, first, last)
        ratio = np.where(known, np.maximum(ratio, other), ratio)  # (LIFE.49)
        there = begins[:, first - b] & ends[:, last + b] & behind[:, first] & ahead[:, last] & (edges + w <= CELLS - b)
        there &= (ratio > 0) | (w > 1)  # a gap of one cell must have been seen
        ratio += rear[:, first] + front[:, last] + np.log(gaps[:, w]) - long[..., None]  # (LIFE.38)
        ratio = np.where(there, ratio, -np.inf).reshape(D, -1)
        best = ratio.argmax(1)[:, None]
        ratio, gap = ratio[rows, best][:, 0], edge[rows, np.stack([first, last], -1).reshape(-1, 2)[best[:, 0]]]
        return Split(ratio > self.surer, ratio, vector(-end[:, 0], gap[:, 0]), vector(gap[:, 1], end[:, 0]))

    def _of_sides(self, S: NDArray, X: NDArray, H: NDArray, first: NDArray, last: NDArray) -> NDArray:
        """Log likelihood ratio (D, W, P) of empty ground from edges first to last (W, P), by the sides in view.

        S and X (D, CELLS + 1) are sums of the detections and of those expected of one vehicle, H of those on any side.
        """
        b = self.beside
        shown, due, hits = (a[:, b:] - a[:, :-b] for a in (S, X, H))  # in so many cells from each edge on
        dense = np.where(shown < self.least, 0.0, shown / np.maximum(due, 1e-9))
        behind, ahead = first - b, last  # where the cells on both sides of a gap begin
        denser = np.minimum(dense[:, behind], dense[:, ahead])  # (D, W, P)
        for one, other, all_of in ((behind, ahead, H[:, first]), (ahead, behind, H[:, -1:, None] - H[:, last])):
            face = hits[:, one] > np.maximum(self.facing * all_of, self.least)
            denser = np.where(face & (due[:, one] < self.stray * due[:, other]), dense[:, other], denser)
        most = np.where(last - first <= b, self.denser, 1.0)
        return self._empty((X[:, last] - X[:, first]) * np.minimum(denser, most), S[:, last] - S[:, first])  # (LIFE.33)

    def _of_insides(
        self, E: NDArray, low: NDArray, high: NDArray, first: NDArray, last: NDArray
    ) -> tuple[NDArray, NDArray]:
        """The same by detections of what is seen end-on, whose sums are E (D, CELLS + 1), and where it is known.

        The insides of the vehicles begin at edge low and end at edge high (D, 1, 1).
        """
        rows = np.arange(len(E))[:, None, None]
        even = [
            np.where(to - at < self.beside, 0.0, (E[rows, to] - E[rows, at]) / np.maximum(to - at, 1))
            for at, to in ((low, first), (last, high))
        ]
        foretold = np.minimum(even[0], even[1]) * (last - first)  # (LIFE.49)
        return self._empty(foretold, E[:, last] - E[:, first]), foretold > 0

    def _empty(self, foretold: NDArray, n: NDArray) -> NDArray:
        """Log likelihood ratio of empty ground, where n detections were seen and those foretold are of one vehicle."""
        return np.asarray((self.thin - self.stray) * foretold - np.log(self.thin / self.stray) * n)  # (LIFE.34)

    def pieces(
        self, ground: Ground, split: Split, estimate: Estimate, sensors: SensorArray, platform: NDArray
    ) -> tuple[Estimate, Estimate]:
        """The rear and the front one of D boxes that are two; platform (6,) carries the sensors."""
        x, spans = PLACE - shift_of(ground, estimate), (split.rear, split.front)
        own = (ground.hits * (span[:, :1] - STEP < x) * (x < span[:, 1:] + STEP) for span in spans)
        bare = (self._bare(x, hits, span) for hits, span in zip(own, spans, strict=True))
        std = np.where(self._looked_at(estimate, sensors, platform), 0.0, self.open_std).T  # (LIFE.47)
        rear, front = map(partial(piece, estimate), spans, bare, std)
        return rear, front

    def cut(
        self, ground: Ground, estimate: Estimate, asked: NDArray, sensors: SensorArray, platform: NDArray
    ) -> tuple[NDArray, Estimate]:
        """Which of D boxes begin with empty ground, bool (D,), and these C boxes without it.

        Of those asked for (D,) bool none hides the end that faces the sensors, which platform (6,) carries.
        """
        half = estimate.size[:, 0] / 2
        along, aside = to_frame(estimate.pose, platform[None, None, :2])[:, 0].T
        faced, span = np.stack([along < 0, along > 0], -1), vector(-half, half)
        bare = self._bare(PLACE - shift_of(ground, estimate), ground.hits, span)
        b = (bare * faced).sum(1)
        where = asked & (b > self.unreached) & (np.abs(along) - half > np.abs(aside))
        if where.any():
            n, rows, rest = ground.hits.sum(1), np.arange(len(half)), 2 * half - b
            density = np.log(self.lengths(estimate.size[:, 1], estimate.size_std[:, 1]))
            ratio = density[rows, cells_of(rest)] - density[rows, cells_of(2 * half)]
            ratio += (self.thin - self.stray) * n * b / np.maximum(rest, STEP)  # (LIFE.48)
            where &= (self._looked_at(estimate, sensors, platform) & faced).any(1) & (ratio > self.surer)
        span += b[:, None] * faced * np.array([1.0, -1.0])
        far = bare * ~faced
        return where, piece(take(estimate, where), span[where], far[where], np.zeros(where.sum()))

    def _looked_at(self, estimate: Estimate, sensors: SensorArray, platform: NDArray) -> NDArray:
        """Which ends (D, 2), rear and front, lie where a sensor looks, with what is `beyond` of them."""
        outside = (estimate.size[:, :1] / 2 + self.beyond) * np.array([-1.0, 1.0])
        places = to_world(estimate.pose, vector(outside, np.zeros(outside.shape))).reshape(1, -1, 2)
        sees = in_view(places, sensors.poses(platform), sensors.max_range, sensors.fov).any(0)
        return np.asarray(sees.reshape(-1, 2))

    def _bare(self, x: NDArray, hits: NDArray, span: NDArray) -> NDArray:
        """How far (D, 2) [m] inwards of ends span (D, 2) most hits (D, CELLS) in cells at x (D, CELLS) [m] begin."""
        rows, n = np.arange(len(x)), np.cumsum(hits, 1)
        few = np.maximum(self.strays * n[:, -1:], LEAST_HITS)
        first, last = (n > few).argmax(1), CELLS - 1 - (n[:, -1:] - n + hits > few)[:, ::-1].argmax(1)
        some = n[:, -1] > few[:, 0]
        inwards = vector(x[rows, first] - STEP / 2 - span[:, 0], span[:, 1] - x[rows, last] - STEP / 2)
        return np.maximum(inwards - self.slack, 0.0) * some[:, None]  # (LIFE.46)


def end_on(estimate: Estimate, poses: NDArray) -> NDArray:
    """Which of S sensors at poses (S, 3) see a face, as wide as the box, wider than a side of D boxes, bool (D, S)."""
    away = to_frame(estimate.pose, poses[None, :, :2])
    return np.asarray(estimate.size[:, :1] * np.abs(away[..., 1]) < estimate.size[:, 1:] * np.sqrt(dot(away, away)))


def cells_of(length: NDArray) -> NDArray:
    """Multiple of `STEP` nearest to each length [m], within the cells."""
    return np.clip(np.rint(length / STEP), 0, CELLS - 1).astype(int)


def moved(a: NDArray, cells: int) -> NDArray:
    """The values (CELLS,) so many cells further ahead; others come in as 0."""
    k = np.arange(CELLS) - cells
    return np.where((k >= 0) & (k < CELLS), a[np.clip(k, 0, CELLS - 1)], 0.0)


def counts(cell: NDArray, there: NDArray) -> NDArray:
    """Detections (G, CELLS) in the cells (G, M) int where there (G, M) is true."""
    g, m = np.nonzero(there)
    n = np.zeros((len(cell), CELLS))
    np.add.at(n, (g, cell[g, m]), 1.0)
    return n


def shift_of(ground: Ground, estimate: Estimate) -> NDArray:
    """How far (D, 1) [m] the centres lie ahead of the origins of the cells."""
    return dot(estimate.pose[:, :2] - ground.origin, unit(estimate.pose[:, 2]))[:, None]


def piece(estimate: Estimate, span: NDArray, bare: NDArray, std: NDArray) -> Estimate:
    """The boxes cut to span (D, 2) [m] along their headings, from their centres.

    They may be shorter by bare (D, 2) [m] at both ends, and have a length that is as uncertain, and by std (D,) [m].
    """
    pose, size, size_std = estimate.pose.copy(), estimate.size.copy(), estimate.size_std.copy()
    low, high = bare.T
    pose[:, :2] += (span.mean(1) + (low - high) / 4)[:, None] * unit(pose[:, 2])
    size[:, 0] = np.maximum(np.ptp(span, axis=1) - (low + high) / 2, 1.5)  # (LIFE.47)
    size_std[:, 0] = np.maximum(0.1 * size[:, 0], 0.3)
    size_std[:, 0] = np.sqrt(size_std[:, 0] ** 2 + (bare**2).sum(1) / 4 + std**2)  # (LIFE.47)
    return estimate._replace(pose=pose, size=size, size_std=size_std, contour=None)

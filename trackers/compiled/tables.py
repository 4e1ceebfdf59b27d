"""What the compiled functions of a step take: rows of tracks, detections, and parameters as arrays."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.htg.bins import frames, log_masses
from trackers.htg.map import HTGMap, bin_moments
from trackers.htg.objective import SWITCH, information_table
from trackers.pmht.association import columns
from trackers.pmht.filter import TRUCK_ABOVE
from trackers.size.grid import Grid
from trackers.size.hidden import CELLS, DEEPER
from trackers.size.visible import shares_of_cells

# Columns of detections (G, 14): line of sight, range, range rate over ground, pose (3) and number of the sensor, noise
# along and across the line of sight as the place takes it, as range rates do, and as the size does.
UX, UY, RANGE, RATE, POSE, SENSOR = 0, 1, 2, 3, 4, 7
ALONG, ACROSS, RATE_ACROSS, RATE_STD, SIZE_ALONG, SIZE_ACROSS = range(8, 14)
UNUSABLE = 2  # of a track after the compiled update


class Rows(NamedTuple):
    """The states of T tracks; the fields of `Mixture` and `SizeState`."""

    mu: NDArray  # (T, K)
    m: NDArray  # (T, K, 7)
    P: NDArray  # (T, K, 7, 7)
    ahead: NDArray  # (T,)
    curvature: NDArray  # (T,)
    anchor: NDArray  # (T, 2)
    length: NDArray  # (T, K, N)
    width: NDArray  # (T, K', N')
    behind: NDArray  # (T, 2, D)
    bent: NDArray  # (T,)
    aside: NDArray  # (T,)
    belief: NDArray  # (T, 5, 2) size, its variance, offset, its variance, variance of the centre
    of_length: NDArray  # (T, K)
    of_width: NDArray  # (T, K')
    kind: NDArray  # (T, C)


class Found(NamedTuple):
    """What is found beside the states; first axes of 2 are the box of place and motion, and that with the size."""

    m: NDArray  # (T, 7) moments of the modes
    P: NDArray  # (T, 7, 7)
    pose: NDArray  # (2, T, 3)
    cov: NDArray  # (2, T, 4, 4)
    contour: NDArray  # (2, T, C, 2)
    velocity: NDArray  # (T, 2)
    std: NDArray  # (T, 4) of heading, yaw rate, length, width
    size: NDArray  # (2, T, 2)
    size_std: NDArray  # (T, 2)
    edge_std: NDArray  # (T, 4)
    eps: NDArray  # (T, 2) innovation
    S: NDArray  # (T, 2, 2)

    @classmethod
    def of(cls, T: int, C: int) -> "Found":
        """Space for T tracks with contours of C points."""
        shapes = (
            (T, 7),
            (T, 7, 7),
            (2, T, 3),
            (2, T, 4, 4),
            (2, T, C, 2),
            (T, 2),
            (T, 4),
            (2, T, 2),
            (T, 2),
            (T, 4),
            (T, 2),
            (T, 2, 2),
        )
        none = cls(*map(np.zeros, shapes))
        none.S[:] = np.eye(2)
        return none


class Tables(NamedTuple):
    """Parameters of a filter of the place, motion modes and a size posterior."""

    modes: NDArray  # (K, 4) speed_walk, yaw_walk, axle, lateral
    common: NDArray  # (5,) curvature, slow_yaw, fast, bound_time, told_std
    axle: NDArray  # (K,)
    onset: NDArray  # (K,)
    rates: NDArray  # (5,) see `evidence.move`
    size_walk: float
    course: float
    log_size: bool  # whether states hold the logarithms of length and width
    bins: NDArray  # (B, 22) see `htg`; without rows the place is that of a contour
    scores: NDArray  # (B, V, V, 6, 6)
    htg: NDArray
    mu: NDArray  # (Q, 2, L) of Q models
    Sigma: NDArray  # (Q, 3, L)
    visible: NDArray  # (Q, A, L)
    outline: NDArray  # (Q, C, 2)
    place_std: NDArray  # (2,)
    cover: NDArray  # (S, 2) half the opening angle and the range of each sensor; none: they see everywhere
    spline: NDArray  # (7,) see `spline.update`
    iterations: int
    truck_above: float
    grid_l: NDArray  # (8,) see `grids`, of the length and of the width
    near_l: NDArray  # (C, N) length of each cell before each end
    far_l: NDArray  # (C, K + N - 1)
    grid_w: NDArray
    near_w: NDArray
    far_w: NDArray
    shares: NDArray  # (C,) of the classes
    of_length: NDArray  # (C, K)
    of_width: NDArray  # (C, K')
    loads: NDArray  # (B, 7) of the classes with loads, see `grids.with_loads`
    bends: NDArray  # (B', 2) class and share of those with a hinge
    bend_at: NDArray  # (B', K) where on the grid a load of them ends
    enough_bent: float
    enough_aside: float
    pin: NDArray  # (6,) share, least, spread in a face, spread of the offsets (2), least of the centre
    once: bool  # as in `SizePosterior`
    insets: NDArray  # (C, 2)
    roundings: NDArray  # (3, C)
    hinges: NDArray  # (2, C)
    sheet: NDArray  # (S, 15) see `size.read`
    size: NDArray  # (9,) see `size.read`

    @classmethod
    def of(cls, place: Any, motion: Any, size: Any) -> "Tables":
        """Those of `SplinePmht` or `HTGMap`, of `MotionModes` and `SizePosterior`."""
        M, r, q = motion.modes, motion.rates, size.profiles
        bends, K = size.prior.bends, len(size.length.sizes)
        at = [X @ np.arange(K) for *_, X in bends]
        offset_std = size.length.offset_std, size.width.offset_std
        sheet = np.column_stack([
            q.max_range, q.fov, q.inside, q.grazing, q.weight, q.depth, q.rounding[:, 0], q.rounding[:, 1],
            q.least_room, q.surface_std, q.slant,
        ])  # fmt: skip
        values = (
            [[m.speed_walk, m.yaw_walk, m.axle, m.lateral] for m in M.table],
            [M.curvature, M.slow_yaw, M.fast, M.bound_time, M.told_std], M.axle,
            [m.onset for m in M.table], [r.std, r.common_std, r.clip, motion.backwards, motion.backed],
            place.size_walk, motion.course, place.log_size,
            *(_densities(place) if isinstance(place, HTGMap) else _contours(place)),
            *_axis(size.length, 0), *_axis(size.width, 1), *size.prior[:3],
            np.reshape([(c, *load[:2], *load.log_ratios.ravel()) for c, load in size.prior.loads], (-1, 7)),
            np.reshape([one[:2] for one in bends], (-1, 2)), np.reshape(at, (-1, K)),
            size.enough_bent, size.enough_aside,
            [size.pin, size.least_pin, size.face_std, *offset_std, size.centre_std], size.once, *size.prior[-3:], sheet,
            [size.outliers, size.independent, size.part_weight, size.offset_share, *offset_std, size.standing,
             size.unseen_share, size.length.birth_std, size.open_above],
        )  # fmt: skip
        return cls(*map(_plain, cls._fields, values))


def _plain(name: str, value: Any) -> Any:
    """A value as numba is to see it: one type for each field, whatever the parameters are."""
    if np.ndim(value) == 0:
        return value if name in ("iterations", "log_size", "once") else float(value)
    return np.array(value, float, order="C")


def _densities(place: HTGMap) -> tuple[Any, ...]:
    """The fields of the place, from `bins` on, of a table of densities."""
    table = place.model()
    p, (mean, cov) = table.p, bin_moments(table)
    bins = np.column_stack([p.rho, p.bounds, p.theta, p.r, log_masses(table), *frames(table), mean, columns(cov).T])
    settings = [place.alpha, place.flat, place.size_step, 1 + place.two_starts, place.rounds, place.contest,
                table.aspects, table.centred, table.above, *SWITCH]  # fmt: skip
    none = (np.zeros((1, *shape)) for shape in ((2, 0), (3, 0), (0, 0), (0, 2)))
    return bins, information_table(table), settings, *none, place.shape_std, np.zeros((0, 2)), np.zeros(7), 0, np.inf


def _contours(place: Any) -> tuple[Any, ...]:
    """The same of the models of a contour."""
    p, Sigma, visible = place.contours
    mu = np.stack([(place.N @ one).T for one in p])
    spline = [place.widened, place.unseen, place.interior, place.eps, place.lost_below, place.inflation, place.doubt]
    cover = np.reshape([(s.fov / 2, s.max_range) for s in place.sensors], (-1, 2))
    none = np.zeros((0, 22)), np.zeros((0, 1, 1, 6, 6)), np.zeros(9)
    return (*none, mu, np.stack([columns(one) for one in Sigma]), visible, place.outline(p, Sigma), place.position_std,
            cover, spline, place.iterations, TRUCK_ABOVE)  # fmt: skip


def _axis(grid: Grid, axis: int) -> tuple[Any, ...]:
    cells = CELLS[axis]
    row = [grid.first, grid.step, -grid.reach, grid.span, cells.first, cells.step, cells.number, DEEPER[axis]]
    return row, *shares_of_cells(grid, cells)

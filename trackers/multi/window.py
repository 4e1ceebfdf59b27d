"""The window: recent detections that no track explains, moved to where their vehicles should be now.

A vehicle that gives one detection a scan is born from several scans of it. Equations:
docs/methods/life-cycle-of-tracks.md, section 1.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import concatenate, keep
from trackers.geometry import dot, unit
from trackers.multi.association import SortedScan
from trackers.multi.road import RoadMap
from trackers.multi.way import Way
from trackers.parameters import check_numbers


class Unexplained(NamedTuple):
    """P detections that no track explains; the older ones first, all of them with range rate."""

    xy: NDArray  # (P, 2) [m] where it was seen, moved since
    sight: NDArray  # (P, 2) unit line of sight
    rate: NDArray  # (P,) [m/s] range rate over ground, NaN: not measured
    var_along: NDArray  # (P,) [m^2] noise along the line of sight
    var_across: NDArray  # (P,) [m^2] noise across it
    clutter: NDArray  # (P,) [1/(m^2 m/s)] intensity by the data sheet, [1/m^2] where the rate is not measured
    sensor: NDArray  # (P,) int
    place: NDArray  # (P, 2) [m] of the sensor
    course: NDArray  # (P,) [rad] direction of the lane where it was seen; off the lanes that of the way of the ego
    off_lane: NDArray  # (P,) bool, off the lanes of the map
    age: NDArray  # (P,) [s], 0: of the present scan

    @property
    def now(self) -> NDArray:
        """Mask (P,) of those of the present scan."""
        return self.age == 0

    @property
    def measured(self) -> NDArray:
        """Mask (P,) of those with a range rate."""
        return np.isfinite(self.rate)

    @property
    def filled_rate(self) -> NDArray:
        """Range rate over ground (P,) [m/s], 0 where it was not measured."""
        return np.where(self.measured, self.rate, 0.0)

    @property
    def sigma(self) -> NDArray:
        """Standard deviation (P,) [m] of the place, both axes together."""
        return np.sqrt(self.var_along + self.var_across)


NO_POINTS, NO_VALUES = np.zeros((0, 2)), np.zeros(0)
EMPTY = Unexplained(
    NO_POINTS, NO_POINTS, NO_VALUES, NO_VALUES, NO_VALUES, NO_VALUES, NO_VALUES.astype(int), NO_POINTS, NO_VALUES,
    NO_VALUES.astype(bool), NO_VALUES,
)  # fmt: skip


@dataclass(frozen=True)
class Window:
    """How long unexplained detections are remembered, and which."""

    span: float = 0.4  # [s] of what moves
    span_standing: float = 1.5  # [s] of what stands
    along_sight: float = 0.7  # least cosine of line of sight and lane: beside it a range rate gives no speed
    beyond: float = 30.0  # [m] least range: near vehicles give enough detections in one scan
    moving: float = 1.0  # [m/s] least magnitude of the ground range rate of what moves
    beside_lane: float = 1.0  # [m] a detection so near to a lane has its direction

    def __post_init__(self) -> None:
        check_numbers(self)

    def candidates(self, z: SortedScan, j: NDArray, road: RoadMap | None, way: Way) -> Unexplained:
        """The detections with rows j (P,) of a scan."""
        scan = z.scan
        course, on_lane = self.courses(z.xy[j], road, way)
        off_lane = ~on_lane & (road is not None)
        return Unexplained(
            z.xy[j], z.sight[j], z.rate[j], z.var_along[j], z.var_across[j], z.clutter[j], z.sensor[j],
            scan.pose[j, :2], course, off_lane, np.zeros(len(j)),
        )  # fmt: skip

    def predict(self, points: Unexplained, dt: float) -> Unexplained:
        """The window after dt [s]: detections move along their lanes by their own range rates; old ones go."""
        along, moving = unit(points.course), self.moves(points)
        speed = np.where(moving, points.rate / dot(points.sight, along), 0.0)
        moved = points._replace(xy=points.xy + (speed * dt)[:, None] * along, age=points.age + dt)  # (LIFE.1)
        return keep(moved, moved.age < np.where(moving, self.span, self.span_standing) + 1e-9)

    def moves(self, points: Unexplained) -> NDArray:
        """Mask (P,) of those that move."""
        return np.abs(points.rate) > self.moving

    def keep(self, points: Unexplained) -> Unexplained:
        """Those that stand, or whose motion follows from their range rate; none without one."""
        along = np.abs(dot(points.sight, unit(points.course)))
        d = points.xy - points.place
        useful = ((along > self.along_sight) | ~self.moves(points)) & (np.hypot(*d.T) > self.beyond) & points.measured
        return keep(points, useful)  # (LIFE.2)

    def courses(self, xy: NDArray, road: RoadMap | None, way: Way) -> tuple[NDArray, NDArray]:
        """Direction (P,) [rad] of the lanes at points (P, 2), off the lanes that of the way; and bool (P,) which."""
        along = way.direction(xy)
        if road is None:
            return along, np.zeros(len(xy), bool)
        depth, direction = road.locate(xy)
        on_lane = depth > -self.beside_lane
        return np.where(on_lane, direction, along), on_lane


def join(old: Unexplained, new: Unexplained) -> Unexplained:
    """Both, the older ones first."""
    return concatenate([old, new])

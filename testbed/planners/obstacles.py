"""What a planner keeps clear of, and how sure it is of that: from the belief road, or from the tracks themselves.

The belief road has the estimates of the reported tracks. The tracks have covariances and probabilities of existence
besides, and those among them that are tentative: not reported yet.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from testbed.planners.prediction import Others, others_of, things_on
from testbed.planners.track_vehicle import TrackVehicle, track_vehicles
from trackers.geometry import unit


class Obstacles(NamedTuple):
    """N vehicles and obstacles besides the ego."""

    others: Others
    existence: NDArray  # (N,) probability
    cov: NDArray  # (N, 4, 4) of x, y, vx, vy [m, m/s]
    length_std: NDArray  # (N,) [m]

    def rows(self, index: NDArray) -> "Obstacles":
        """Those at index, (N,) bool or rows."""
        return Obstacles(self.others.rows(index), *(part[index] for part in self[1:]))

    def edge_std(self, times: NDArray) -> NDArray:
        """Standard deviations (N, H) [m] of the near bumper along its course, predicted to times (H,) [s]."""
        along = unit(self.others.course)[:, None]  # (N, 1, 2)
        P = self.cov
        xx, xv, vv = ((along @ block @ along.mT)[..., 0] for block in (P[:, :2, :2], P[:, :2, 2:], P[:, 2:, 2:]))
        place = np.maximum(xx + 2 * times * xv + times**2 * vv, 0.0)
        return np.sqrt(place + (self.length_std[:, None] / 2) ** 2)  # (PLAN.3)


def on_belief_road(env: gym.Env, within: float) -> Obstacles:
    """What is on the belief road within [m], taken for certain; motion across a lane counts from 0.5 m/s on."""
    core: Any = env.unwrapped
    return _certain(things_on(core.road, core.vehicle, within))


def among_tracks(env: gym.Env, within: float, above: float) -> Obstacles:
    """The tracks within [m] whose existence is above a probability, with their uncertainty; the rest from the road.

    An environment that has no tracker, such as a deep copy, gives what is on its road, for certain.
    """
    if not env.has_wrapper_attr("current_tracks"):
        return on_belief_road(env, within)
    core: Any = env.unwrapped
    tracks = env.get_wrapper_attr("current_tracks")
    tracks = tracks.rows(tracks.existence > above)
    twins = track_vehicles(core.road, np.arange(len(tracks.id)), tracks.estimate, core.controlled_vehicles)
    twins = [v for v in twins if np.hypot(*(v.position - core.vehicle.position)) < within]
    row = np.array([v.track_id for v in twins], int)
    estimate = tracks.estimate
    certain = _certain([v for v in things_on(core.road, core.vehicle, within) if not isinstance(v, TrackVehicle)])
    parts = certain, Obstacles(others_of(twins), tracks.existence[row], estimate.cov[row], estimate.size_std[row, 0])
    others = Others(*map(np.concatenate, zip(*(part.others for part in parts))))
    return Obstacles(others, *map(np.concatenate, zip(*(part[1:] for part in parts))))


def _certain(things: list[Any]) -> Obstacles:
    n = len(things)
    return Obstacles(others_of(things, significant=0.0), np.ones(n), np.zeros((n, 4, 4)), np.zeros(n))

"""The data sheets of the sensors as arrays: what the likelihood of a detection needs of the sensor that made it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.scan import SensorModel


class Profiles(NamedTuple):
    """Data sheets and depth profiles of S sensors, or of the sensors of G detections."""

    max_range: NDArray  # (S,) [m]
    fov: NDArray  # (S,) [rad]
    inside: NDArray  # (S,)
    inside_depth: NDArray  # (S,) [m]
    depth: NDArray  # (S, 2) [m] mean and spread behind a face
    slant: NDArray  # (S,)
    grazing: NDArray  # (S,)
    surface_std: NDArray  # (S,) [m]
    weight: NDArray  # (S,)
    rounding: NDArray  # (S, 2, 2) [m] its mean and spread, along and across
    least_room: NDArray  # (S, 2) [m]
    hiding: NDArray  # (S, 2) [rad], [m] how far a detection hides to either side, and behind it

    @classmethod
    def of(cls, sensors: tuple[SensorModel, ...]) -> "Profiles":
        """Arrays of data sheets."""
        p = [s.profile for s in sensors]
        return cls(
            max_range=np.array([s.max_range for s in sensors], float),
            fov=np.array([s.fov for s in sensors], float),
            inside=np.array([q.inside for q in p], float),
            inside_depth=np.array([q.inside_depth for q in p], float),
            depth=np.array([(q.depth, q.depth_std) for q in p], float),
            slant=np.array([q.slant for q in p], float),
            grazing=np.array([q.grazing for q in p], float),
            surface_std=np.array([q.surface_std for q in p], float),
            weight=np.array([q.weight for q in p], float),
            rounding=np.array([np.stack([q.rounding, q.rounding_std], -1) for q in p], float),
            least_room=np.array([q.least_room for q in p], float),
            hiding=np.array([(q.hides_within, q.hides_behind) for q in p], float),
        )

    def at(self, sensor: NDArray) -> "Profiles":
        """Rows of the sensors (G,) int."""
        return Profiles(*(field[sensor] for field in self))

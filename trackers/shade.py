"""Shade: what of a place can be seen beside the tracks that hide others, whose own places are not certain.

Equation: docs/methods/multi-object-tracking.md, section 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.geometry import wrap_angle

NEARER = 1.0  # [m] what hides a place is this much nearer; else a duplicate would hide its twin
LEAST_STD = 1e-6  # [rad] of an edge
FAR = 9.0  # standard deviations from an edge where nothing of a box hides anything


class Shade(NamedTuple):
    """The O tracks that hide others, as S sensors see them."""

    row: NDArray  # (O,) int, of the tracks
    middle: NDArray  # (S, O) [rad] azimuths of the middles of their boxes, in the frames of the sensors
    half: NDArray  # (S, O) [rad] half of what they span
    std: NDArray  # (S, O) [rad] of the azimuths of their centres
    nearest: NDArray  # (S, O) [m] distances of their nearest corners

    def seen(
        self, sensor: NDArray, row: NDArray, azimuth: NDArray, distance: NDArray, std: NDArray | float = 0.0
    ) -> NDArray:
        """Probabilities (P, K) that nothing hides places of tracks row (P,) from sensors (P,) int.

        azimuth (P, K) [rad] and distance (P, K) or (P, 1) [m] are those of the places, std (P,) [rad] is common to the
        azimuths of each track.
        """
        middle, half, nearest = (a[sensor] for a in (self.middle, self.half, self.nearest))  # (P, O)
        about = azimuth[:, azimuth.shape[1] // 2, None]
        wide = np.abs(wrap_angle(azimuth - about)).max(-1)
        of_edge = np.maximum(np.hypot(np.reshape(std, (-1, 1)), self.std[sensor]), LEAST_STD)
        near = np.abs(wrap_angle(middle - about)) < wide[:, None] + half + FAR * of_edge
        near &= (nearest + NEARER < distance.max(-1, keepdims=True)) & (row[:, None] != self.row)
        p, o = np.nonzero(near)
        to_edge, beside, of_edge = wrap_angle(middle[p, o, None] - azimuth[p]), half[p, o, None], of_edge[p, o, None]
        hides = ndtr((to_edge + beside) / of_edge) - ndtr((to_edge - beside) / of_edge)
        seen = np.ones(azimuth.shape)
        np.multiply.at(seen, p, 1 - np.where(nearest[p, o, None] + NEARER < distance[p], hides, 0.0))  # (MOT.60)
        return seen


NO_SHADE = Shade(np.zeros(0, int), *(np.zeros((1, 0)) for _ in range(4)))
"""That of no track."""

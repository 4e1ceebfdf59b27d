"""What of a place can be seen beside the tracks that hide others; as `trackers.shade`."""

import math

from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import ndtr, wrap
from trackers.shade import Shade

NEARER, LEAST_STD, FAR = 1.0, 1e-6, 9.0  # as in `trackers.shade`


@compiled
def hides(
    shade: Shade, s: int, row: int, azimuth: NDArray, distance: NDArray, std: float, visible: NDArray
) -> None:  # fmt: skip
    """(MOT.60): visible (K,) times the probability that no other track hides azimuths (K,) [rad] of a track `row`.

    distance (K,) [m] are those of the places from the sensor s, std [rad] is common to all azimuths.
    """
    K, wide, furthest = len(azimuth), 0.0, 0.0
    about = azimuth[K // 2]
    for k in range(K):
        wide, furthest = max(wide, abs(wrap(azimuth[k] - about))), max(furthest, distance[k])
    for o in range(len(shade.row)):
        of_edge, half = max(math.hypot(std, shade.std[s, o]), LEAST_STD), shade.half[s, o]
        if shade.row[o] == row or shade.nearest[s, o] + NEARER >= furthest:
            continue
        if abs(wrap(shade.middle[s, o] - about)) >= wide + half + FAR * of_edge:
            continue
        for k in range(K):
            if shade.nearest[s, o] + NEARER < distance[k]:
                to_edge = wrap(shade.middle[s, o] - azimuth[k])
                visible[k] *= 1 - (ndtr((to_edge + half) / of_edge) - ndtr((to_edge - half) / of_edge))

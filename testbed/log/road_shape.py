"""The shape of a road on the screen, which decides about the layout and about what the overview shows."""

import numpy as np
from numpy.typing import NDArray

from testbed.log.record import RoadGeometry

STRIP = 32.0  # [m] a road that spans less than this across the screen is shown as a strip
LONG = 4.0  # least ratio of length to width of a road that runs along the screen
BEHIND, AHEAD = 97.5, 162.5  # [m] the overview of a road along the screen shows so far behind and before the ego
EDGE = 10.0  # [m] beyond the ends of a road that are shown
FITS = 80.0  # [m] a map that spans less than this in a direction is shown whole in it


def road_span(road: RoadGeometry) -> NDArray | None:
    """Least and largest x, y [m] of the road, (2, 2); None where nothing of it is known."""
    lines = [*road.edges, *road.lane_lines, *road.surface]
    if not lines:
        return None
    points = np.concatenate(lines)
    return np.stack([points.min(0), points.max(0)])


def road_shape(road: RoadGeometry) -> str:
    """Shape on the screen: "strip" is narrow enough to be shown at full width, "long" is not, else "compact"."""
    span = road_span(road)
    if span is None:
        return "strip"
    along, across = span[1] - span[0]
    if across < STRIP:
        return "strip"
    return "long" if along > LONG * across else "compact"


def strip_middle(road: RoadGeometry) -> float | None:
    """The y [m] of the middle of a strip, None where the view has to follow the ego sideways too."""
    span = road_span(road)
    return float(span[:, 1].mean()) if span is not None and road_shape(road) == "strip" else None


def overview_at(road: RoadGeometry, place: NDArray) -> tuple[float, float]:
    """The x and y [m] of the origin of the overview while the ego is at a place (2,) [m].

    It is the ego, but for the directions in which the map is shown whole, and but for the ends of a road along the
    screen, beyond which nothing is shown.
    """
    fixed, span = fixed_middle(road), road_span(road)
    x, y = (float(own) if still is None else still for own, still in zip(place, fixed, strict=True))
    if span is not None and fixed[1] is not None and fixed[0] is None and span[1, 0] - span[0, 0] > BEHIND + AHEAD:
        x = float(np.clip(x, span[0, 0] + BEHIND - EDGE, span[1, 0] - AHEAD + EDGE))
    return x, y


def fixed_middle(road: RoadGeometry) -> tuple[float | None, float | None]:
    """The x and y [m] of the middle of the map, None where it is too large to be shown whole."""
    span = road_span(road)
    if span is None:
        return None, None
    x, y = (float(m) if extent < FITS else None for m, extent in zip(span.mean(0), span[1] - span[0], strict=True))
    return x, y

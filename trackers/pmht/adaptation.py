"""Where the frame of a contour lies that is learned from the object's own track.

Equations: docs/methods/spline-pmht.md. Moving the model by o (unit frame) and the centre by -A o predicts the same
detections, whatever sides they come from (PMHT.30), so o is not observable. A convention settles it: the position is
the centre of the box. Along each axis of the body, by the ends that were seen,

- both: the box of the curve is centred;
- one: that end stays where the catalogue's contour has it, because there the filter measures, and the place of the
  other follows from size and catalogue;
- none: the control points do not move on average.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.held_gaussian import LENGTH
from trackers.motion.turn import PHI
from trackers.pmht.model import curve

FINE = 400  # points of the curve whose box is taken


def frame_shift(p: NDArray) -> NDArray:
    """Centre (..., 2) of the box around the curve of control points p (..., n_c, 2), in the unit frame.

    A wrong offline model keeps the track off by a constant offset; where all sides were seen, this is that offset.
    """
    ring = curve(p, FINE)
    return (ring.max(-2) + ring.min(-2)) / 2  # (PMHT.31)


def partial_shift(p: NDArray, off: NDArray, ends: NDArray) -> NDArray:
    """Shift (..., 2) of the frame of the contour p where not all sides were seen, (PMHT.37).

    off (..., n_c, 2) are the control points of the catalogue; ends (..., 2, 2) bool: rear and front, right and left.
    """
    ring, was = curve(p, FINE), curve(off, FINE)
    low, high = ring.min(-2) - was.min(-2), ring.max(-2) - was.max(-2)
    both, rear, front = ends.all(-1), ends[..., 0], ends[..., 1]
    one = np.where(rear, low, np.where(front, high, (p - off).mean(-2)))  # (PMHT.37)
    return np.where(both, frame_shift(p), one)


def shifted(m: NDArray, o: NDArray) -> NDArray:
    """States m (..., 7) whose model has been moved by -o (..., 2) in the unit frame."""
    return moved(m, m[..., LENGTH:] * o)  # (PMHT.31)


def moved(m: NDArray, body: NDArray) -> NDArray:
    """States m (..., 7) with body (..., 2) [m], in the axes of each, added to the centre."""
    m = m.copy()
    m[..., :2] += (rotation(m[..., PHI]) @ body[..., None])[..., 0]
    return m

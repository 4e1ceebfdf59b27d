"""Learning an object's contour from its own track: decoupled detections, and where the frame lies; card, section 8.

Which part of the frame is observable: moving the model by o (unit frame) and the centre by -A o predicts the same
detections, whatever sides they come from, so no detection tells o. What tells it is a convention: the position is the
centre of the box. Along each axis of the body, by what has been seen,

- both ends: the box of the curve is centred, the card's frame shift;
- one end: that end stays where the catalogue's contour has it, because there the filter measures, and the other is a
  guess that size and catalogue make;
- neither: the ellipses that were seen do not move on average.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.motion import PHI
from trackers.pmht.model import curve
from trackers.pmht.state import LENGTH

FINE = 400  # points of the curve whose box is taken


def decoupled(m: NDArray, xy: NDArray) -> NDArray:
    """Detections xy (..., M, 2) [m] in the unit frame of states m (..., 7), (14)."""
    body = (xy - m[..., None, :2]) @ rotation(m[..., PHI])
    return body / m[..., None, LENGTH:]


def frame_shift(p: NDArray) -> NDArray:
    """Centre (..., 2) of the box around the curve of control points p (..., n_c, 2), in the unit frame.

    A model that was off keeps the track off for ever; where all sides were seen, this is by how much.
    """
    ring = curve(p, FINE)
    return (ring.max(-2) + ring.min(-2)) / 2


def partial_shift(p: NDArray, off: NDArray, ends: NDArray) -> NDArray:
    """By how much (..., 2) the frame of the contour p has to move where not all sides were seen.

    off (..., n_c, 2) are the control points of the catalogue; ends (..., 2, 2) bool: rear and front, right and left.
    """
    ring, was = curve(p, FINE), curve(off, FINE)
    low, high = ring.min(-2) - was.min(-2), ring.max(-2) - was.max(-2)
    both, rear, front = ends.all(-1), ends[..., 0], ends[..., 1]
    one = np.where(rear, low, np.where(front, high, (p - off).mean(-2)))
    return np.where(both, frame_shift(p), one)


def shifted(m: NDArray, o: NDArray) -> NDArray:
    """States m (..., 7) whose model has been moved by -o (..., 2) in the unit frame."""
    m = m.copy()
    m[..., :2] += (rotation(m[..., PHI]) @ (m[..., LENGTH:] * o)[..., None])[..., 0]
    return m

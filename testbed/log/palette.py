"""Colours of the review log and what they mean: readable on black and for colour-blind eyes (after Okabe and Ito)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sensors.origin import KINDS

TRUTH = 0xC9CBD6FF
EGO = 0xFFFFFFFF
PLAN = 0x6488FFFF
WALL = 0x8C6D4FFF
SURFACE = 0x24262DFF
EDGE = 0xC4C4C4FF
LANE = 0x77777CFF
FOV = 0x4A4A58FF
RING = 0x3C4250FF
GROUND = 0x0E0F13FF  # behind every scene
DIM = 0.25  # strength of the outline of a vehicle of which nothing is visible
BEFORE = 0x9A9AA0FF  # a contour before it changed
DETECTION = dict(zip(KINDS, (0x43E66BFF, 0xFF5CB8FF, 0x85858AFF, 0xA8835AFF, 0x5AA9FFFF, 0xFFE14DFF), strict=True))
KIND_COLORS = ("green", "pink", "grey", "brown", "blue", "yellow")  # the same in words
KIND_NOTES = {  # of `sensors.origin.KINDS`
    "contour": "detection on the outline of a vehicle",
    "volume": "detection from inside a vehicle, or from beneath it",
    "clutter": "false alarm: nothing is there",
    "static": "standing return: guard rail, post, bridge",
    "mirror": "ghost: a vehicle seen in a mirror, such as a guard rail or the side of a truck",
    "double": "ghost: reflected twice between a vehicle and the ego",
}

_TRACKERS = (0xFFA629FF, 0x38CFFFFF, 0xB18CFFFF, 0xF5E663FF, 0xFF7361FF, 0x2FD6A5FF)
_TRACKER_NAMES = ("orange", "light blue", "violet", "yellow", "red", "turquoise")
_MODES = (0x9AA0ABFF, 0xFF7361FF, 0x2FD6A5FF, 0xF5E663FF)  # in the order of a filter's models: cv, ca, ct
_OBJECTS = np.array(
    [
        *(0xE69F00FF, 0x56B4E9FF, 0x00C795FF, 0xF0E442FF, 0x3D8BFFFF, 0xFF7A33FF),
        *(0xE07CB8FF, 0xA6D854FF, 0xB39DFFFF, 0xFFC9A3FF, 0x7FE3E3FF, 0xD9A066FF),
    ],
    np.uint32,
)
UNASSIGNED = np.uint32(0x6A6A70FF)

_ACTIONS = {
    "IDLE": 0x55585FFF,
    "FASTER": 0x2E8B45FF,
    "SLOWER": 0xC0453AFF,
    "LANE_LEFT": 0x3F6FD0FF,
    "LANE_RIGHT": 0x8F50CCFF,
}
_OTHER_ACTIONS = (0x9A7B2FFF, 0x2F8F8FFF, 0x9C4F74FF, 0x6B7F3AFF)


def tracker(index: int) -> int:
    """Colour of the index-th tracker of the command line."""
    return _TRACKERS[index % len(_TRACKERS)]


def tracker_name(index: int) -> str:
    """The same colour in words."""
    return _TRACKER_NAMES[index % len(_TRACKERS)]


def mode(index: int) -> int:
    """Colour of the index-th motion model of a tracker."""
    return _MODES[index % len(_MODES)]


def rgb(color: int) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour 0xRRGGBBAA.

    >>> rgb(0x43E66BFF)
    (67, 230, 107)
    """
    return color >> 24, color >> 16 & 255, color >> 8 & 255


def css(color: int) -> str:
    """A colour 0xRRGGBBAA as people write it.

    >>> css(0x43E66BFF)
    '#43e66b'
    """
    return f"#{int(color) >> 8:06x}"


def dimmed(color: int, visible: NDArray) -> NDArray:
    """A colour (n,) uint32 mixed with the ground, the more the smaller the visible shares (n,); lines are opaque."""
    near, far = np.array(rgb(color)), np.array(rgb(GROUND))
    share = DIM + (1 - DIM) * np.clip(visible, 0.0, 1.0)[:, None]
    mixed = np.rint(far + share * (near - far)).astype(np.uint32)
    return (mixed << np.array([24, 16, 8], np.uint32)).sum(-1, dtype=np.uint32) | np.uint32(0xFF)


def identity(number: ArrayLike) -> NDArray:
    """Colours (n,) uint32 of objects or tracks with the ids (n,), grey for -1."""
    number = np.asarray(number, int)
    return np.where(number < 0, UNASSIGNED, _OBJECTS[number % len(_OBJECTS)])


def action(name: str) -> int:
    """Colour of an action of the ego; the same name has the same colour in every log."""
    return _ACTIONS.get(name, _OTHER_ACTIONS[sum(name.encode()) % len(_OTHER_ACTIONS)])

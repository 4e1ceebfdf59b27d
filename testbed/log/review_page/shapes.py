"""Outlines as few numbers: a rigid shape is kept once, and after that only where it is and how it is turned."""

from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import to_world

SAME = 0.015  # [m] every point of a known shape lies as near as this, else the shape is a new one
CM = 100.0
MILLIRAD = 1000.0


def centimetres(xy: NDArray) -> list[int]:
    """Points (P, 2) [m] as one list x, y, x, y, ... of whole centimetres."""
    return np.rint(CM * np.asarray(xy, float)).astype(int).ravel().tolist()


class Shapes:
    """The shapes of all outlines of a run, in the order in which they were first met."""

    def __init__(self) -> None:
        self.found: list[list[int]] = []  # [cm] about the middle of the points, as x, y, x, y, ...
        self._known: dict[Hashable, tuple[int, NDArray]] = {}

    def place(self, whose: Hashable, ring: NDArray) -> list[int]:
        """Number of the shape, x, y [cm] and turn [mrad] of an outline (P, 2) [m]; `whose` had the shape before."""
        middle = ring.mean(0)
        around = ring - middle
        number, shape = self._known.get(whose, (-1, around[:0]))
        turn = 0.0
        if len(shape) == len(around):
            turn = _turn(shape, around)
            if np.abs(to_world(np.array([0.0, 0.0, turn]), shape) - around).max(initial=0.0) > SAME:
                number, turn = -1, 0.0
        else:
            number = -1
        if number < 0:
            number = len(self.found)
            self.found.append(centimetres(around))
            self._known[whose] = number, around
        return [number, *centimetres(middle), round(MILLIRAD * turn)]


def _turn(shape: NDArray, around: NDArray) -> float:
    """Angle [rad] that turns one set of points (P, 2) best into another."""
    a, b = shape[:, 0] + 1j * shape[:, 1], around[:, 0] + 1j * around[:, 1]
    return float(np.angle((a.conj() * b).sum()))


def ring_at(shape: list[int], x: int, y: int, turn: int) -> NDArray:
    """The outline (P, 2) [m] that `Shapes.place` has described."""
    points = np.reshape(shape, (-1, 2)) / CM
    return to_world(np.array([x / CM, y / CM, turn / MILLIRAD]), points)

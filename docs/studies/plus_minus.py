"""Figures of pages with half the width of their interval."""

from typing import NamedTuple


class PlusMinus(NamedTuple):
    """A figure and half the width of its 95 % interval, NaN where there is none."""

    value: float
    half: float

    @property
    def positive(self) -> bool | None:
        """Whether the figure is above zero; None where its interval holds zero."""
        return None if abs(self.value) < self.half else self.value > 0

    def text(self, digits: int) -> str:
        """The figure as people read it."""
        return f"{self.value:.{digits}f} ± {self.half:.{digits}f}"

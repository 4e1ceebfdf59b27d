"""One line of the report on a recording: what was tested, the figure, the reading that fits, and the verdict."""

from typing import NamedTuple

GOOD, OPEN, DOUBT, FAULT = "right", "nothing can be said", "doubt", "fault"
NEAR = 0.1  # share up to which a factor is that of a unit, and one reading explains as much as another


class Finding(NamedTuple):
    """One line of the report."""

    test: str
    figure: str
    fits: str
    verdict: str  # GOOD, OPEN, DOUBT or FAULT
    remedy: str = ""

    @property
    def sentence(self) -> str:
        """What is wrong and what to do, for doubts and faults."""
        return f"{self.test}: {self.fits} ({self.figure}); {self.remedy}"

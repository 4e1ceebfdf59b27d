"""Traffic out of highway-env as a stream of Scenes."""

from scenarios.contours import CONTOURS, Contour
from scenarios.registry import SCENARIOS, Scenario, find

__all__ = ["CONTOURS", "SCENARIOS", "Contour", "Scenario", "find"]

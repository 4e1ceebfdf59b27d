"""Traffic out of highway-env as a stream of Scenes."""

from scenarios.contours import CONTOURS, Contour
from scenarios.registry import SCENARIOS, Scenario, find

__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

__all__ = ["CONTOURS", "SCENARIOS", "Contour", "Scenario", "find"]

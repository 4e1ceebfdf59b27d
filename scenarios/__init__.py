"""Traffic out of highway-env as a stream of Scenes."""

from scenarios.contours import CONTOURS, Contour
from scenarios.probes import PROBES
from scenarios.record import Scenario
from scenarios.registry import SCENARIOS, find

__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

__all__ = ["CONTOURS", "PROBES", "SCENARIOS", "Contour", "Scenario", "find"]

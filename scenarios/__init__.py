"""Traffic out of highway-env as a stream of Scenes."""

from scenarios.deferred import defer

defer()  # before anything imports highway-env

from scenarios.contours import CONTOURS, Contour  # noqa: E402
from scenarios.probes import PROBES  # noqa: E402
from scenarios.record import Scenario  # noqa: E402
from scenarios.registry import SCENARIOS, find  # noqa: E402

__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

__all__ = ["CONTOURS", "PROBES", "SCENARIOS", "Contour", "Scenario", "find"]

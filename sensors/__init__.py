"""Ray-cast automotive radar: a Scene in, a Scan and its Origin out."""

from sensors.origin import KINDS, Origin
from sensors.radar import Radar, Sensor
from sensors.raycast import cast, cast_bodies
from sensors.rigs import RADARS, find
from sensors.scene import Bodies, Ego, Objects, Scene
from sensors.surroundings import Surroundings

__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

__all__ = [
    "KINDS",
    "RADARS",
    "Bodies",
    "Ego",
    "Objects",
    "Origin",
    "Radar",
    "Scene",
    "Sensor",
    "Surroundings",
    "cast",
    "cast_bodies",
    "find",
]  # fmt: skip

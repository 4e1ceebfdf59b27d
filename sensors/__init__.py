"""Ray-cast automotive radar: a Scene in, a Scan and its Source out."""

from sensors.radar import Radar, Sensor
from sensors.raycast import cast, cast_bodies
from sensors.rigs import RADARS, find
from sensors.scene import Bodies, Ego, Objects, Scene
from sensors.source import KINDS, Source

__all__ = [
    "KINDS", "RADARS", "Bodies", "Ego", "Objects", "Radar", "Scene", "Sensor", "Source", "cast", "cast_bodies", "find",
]  # fmt: skip

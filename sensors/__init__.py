"""Ray-cast automotive radar: a Scene in, a Scan and its Origin out."""

from sensors.fault_text import faults_of, parse_fault
from sensors.faults import Blindness, ClockOffset, Dropout, Fault, Interference, Misalignment, Outage
from sensors.ghosts import Ghosts
from sensors.origin import KINDS, Origin
from sensors.persistence import Persistence
from sensors.radar import Radar, Sensor
from sensors.raycast import cast, cast_bodies
from sensors.rigs import RADARS, find
from sensors.roadside import Roadside
from sensors.scene import Bodies, Ego, Objects, Scene

__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

__all__ = [
    "KINDS", "RADARS", "Blindness", "Bodies", "ClockOffset", "Dropout", "Ego", "Fault", "Ghosts", "Interference",
    "Misalignment", "Objects", "Origin", "Outage", "Persistence", "Radar", "Roadside", "Scene", "Sensor", "cast",
    "cast_bodies", "faults_of", "find", "parse_fault",
]  # fmt: skip

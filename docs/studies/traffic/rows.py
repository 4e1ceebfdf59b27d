"""What is counted of traffic: one row a vehicle and second, of recordings and of simulated drives alike."""

from math import nan
from typing import NamedTuple

EVERY = 1.0  # [s] between the rows of a vehicle
FARTHEST = 100.0  # [m] a leader farther ahead than this is none


class Row(NamedTuple):
    """One vehicle at one time."""

    source: str
    scenario: str  # or the file
    drive: int  # seed, or 0
    vehicle: str
    kind: str
    time: float  # [s] since the drive began
    length: float  # [m] of the whole vehicle
    width: float  # [m]
    speed: float  # [m/s]
    gap: float = nan  # [m] from the front bumper to the rear of the vehicle ahead in the same lane; NaN for none

"""Parameter sets of data-region association; docs/methods/data-regions.md has a table of them.

The paper's own values are in `studies.papers.xu2023.cases`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from trackers.parameters import check_numbers

MODELS = ("cv", "ca", "ct")


@dataclass(frozen=True)
class ProcessNoise:
    """Process noise of one motion model, (IMM.7); variances of a step of `Parameters.step`."""

    accel: float  # [(m/s^2)^2]
    yaw_rate: float  # [(rad/s)^2]
    vertex: float  # [m^2] of each coordinate

    def __post_init__(self) -> None:
        check_numbers(self)


@dataclass(frozen=True)
class Parameters:
    """All numbers of the filter but the sensor's."""

    cv: ProcessNoise = ProcessNoise(0.1**2, 1e-6, 1e-6)
    ca: ProcessNoise = ProcessNoise(0.1**2, 1e-4, 1e-6)
    ct: ProcessNoise = ProcessNoise(0.5**2, 1e-4, 1e-6)
    step: float = 0.1  # [s] that the noise and `stay` refer to
    stay: float = 0.98  # probability to keep the motion model for one step, (IMM.9)
    turn_jacobian: bool = True  # correlate the yaw rate with what it turns, (IMM.6); the paper does not
    swing: float = 0.0  # [rad^2] a step, of the body's direction in a model that has no yaw rate, (DRA.33)
    rotating_ca: bool = True  # CA has a yaw rate, because accelerating vehicles turn, too
    own_components: bool = True  # a model that lacks a component leaves it to the others in mixing, (IMM.11)
    gate: float = 0.3  # t of (DRA.9a): half thickness of a side's gate over twice the side's distance from the centre
    interior_gate: float = 1.0  # of (DRA.9b)
    gate_sigmas: float = 2.0  # margin in standard deviations of the measured position, (DRA.8)
    rectangle_std: float = 0.5  # [m^2] of |p1|^2 - |p2|^2, (DRA.30); inf: the body may be any parallelogram
    heading_std: float = 0.03  # [rad] of the length around the velocity's direction, (DRA.31); inf: independent
    heading_speed: float = 0.0  # [m/s] from which on (DRA.31) holds, (DRA.38); 0: always
    least_length_std: float = 0.0  # share of the length, least std of it in estimates, (DRA.39)
    independence: float = 1.0  # share of the information of detected places that counts, (DRA.18)
    near: float = 0.6  # prior of the visible sides, (DRA.13)
    far: float = 0.1  # of the hidden ones; the interior has the rest
    accel_prior_std: float = 0.5  # [m/s^2] of a new object
    shear_prior_std: float = 0.05  # [m] of each coordinate of the vertices of a new object, beside size and heading

    def __post_init__(self) -> None:
        soft = ("rectangle_std", "heading_std")  # constraints, none where infinite
        check_numbers(self, positive=("step", "independence", *soft), unlimited=soft)
        if self.near + self.far > 1:
            raise ValueError(f"near and far must be shares of at most 1 together, got {self.near} and {self.far}")


# On the road vehicles stand, and the direction of their velocity is noise: in every scan it turns the body, until front
# and sides change places and the body grows. No vehicle is a rectangle, so its length is known less well than (DRA.35)
# says.
ROAD = Parameters(heading_speed=2.0, least_length_std=0.04)

# A single model has to cover braking and turning. Its yaw rate is drawn anew in every step and explains range rates
# that differ along a turning body; certain of 0, the filter takes them for another place on the body, and bends and
# stretches it until vertices change sides.
ALONE = replace(ROAD, cv=ProcessNoise(1.5**2, 0.2**2, 1e-5), swing=0.05**2)
PARAMETERS: Mapping[str, Parameters] = MappingProxyType({"recommended": Parameters(), "road": ROAD, "alone": ALONE})


def find(parameters: str | Parameters) -> Parameters:
    """The set of that name; raises ValueError for a name that is none."""
    if isinstance(parameters, Parameters):
        return parameters
    if parameters not in PARAMETERS:
        raise ValueError(f"parameters must be one of {', '.join(PARAMETERS)} or a Parameters, got {parameters!r}")
    return PARAMETERS[parameters]

"""Parameter sets of data-region association: as printed, and the card's; card dra_imm, sections 2, 5, 9, 12 and 14."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

MODELS = ("cv", "ca", "ct")
READINGS = ("V", "S")


@dataclass(frozen=True)
class Noise:
    """Process noise of one motion model; variances, not standard deviations, for a step of `Parameters.step`."""

    accel: float  # [(m/s^2)^2]
    yaw_rate: float  # [(rad/s)^2]
    vertex: float  # [m^2] of each coordinate


@dataclass(frozen=True)
class Parameters:
    """All numbers of the filter but the sensor's."""

    cv: Noise = Noise(0.1**2, 1e-6, 1e-6)
    ca: Noise = Noise(0.1**2, 1e-4, 1e-6)
    ct: Noise = Noise(0.5**2, 1e-4, 1e-6)
    step: float = 0.1  # [s] that the noise and `stay` refer to
    stay: float = 0.98  # probability to keep the motion model for one step
    turn_jacobian: bool = True  # the yaw rate is correlated with what it turns; the paper leaves the column out
    swing: float = 0.0  # [rad^2] a step, of the body's direction in a model that has no yaw rate
    rotating_ca: bool = True  # accelerating vehicles turn, too
    own_components: bool = True  # a model that lacks the yaw rate or acceleration says nothing about it when mixing
    gate: float = 0.3  # t: half thickness of a side's region over the side's distance from the centre
    interior_gate: float = 1.0  # tt
    gate_sigmas: float = 2.0  # margin in standard deviations of the measured position
    rectangle_std: float = 0.5  # [m^2] of |p1|^2 - |p2|^2 around 0; inf: the body may be any parallelogram
    heading_std: float = 0.03  # [rad] of the length around the velocity's direction; inf: independent
    independence: float = 1.0  # of the places of detections on one body: the share of their information that counts
    near: float = 0.6  # P_near: prior of the visible sides
    far: float = 0.1  # P_far: of the others; the interior has the rest
    accel_prior_std: float = 0.5  # [m/s^2] at birth
    shear_prior_std: float = 0.05  # [m] of each coordinate of the vertices at birth, beside size and heading


PAPER = Parameters(
    cv=Noise(0.1**2, 1e-6, 1e-4),
    ca=Noise(0.1**2, 1e-6, 1e-4),
    ct=Noise(0.5**2, 1e-6, 1e-4),
    stay=0.9,  # not printed
    turn_jacobian=False,
    rotating_ca=False,
    own_components=False,
    gate=0.15,
    gate_sigmas=0.0,
    rectangle_std=float("inf"),
    heading_std=float("inf"),
)
# A single model must bear all that vehicles do: braking, and turning its body. Its yaw rate is drawn anew each step and
# explains range rates that differ along a turning body; certain that it is zero, the filter takes them for another
# place on the body, and bends and stretches it until the vertices flip.
ALONE = Parameters(cv=Noise(1.5**2, 0.2**2, 1e-5), swing=0.05**2)
PARAMETERS: Mapping[str, Parameters] = MappingProxyType(
    {
        "paper": PAPER,
        "literal": Parameters(rotating_ca=False, own_components=False, heading_std=float("inf")),
        "recommended": Parameters(),
        "alone": ALONE,
    }
)


def find(parameters: str | Parameters, reading: str) -> Parameters:
    """The set of that name; of eq. (42), reading V takes all numbers of the paper's Q as variances.

    Reading S takes those of the yaw rate and the vertices as standard deviations.
    """
    if isinstance(parameters, Parameters):
        return parameters
    if parameters not in PARAMETERS:
        raise ValueError(f"parameters must be one of {', '.join(PARAMETERS)} or a Parameters, got {parameters!r}")
    if reading not in READINGS:
        raise ValueError(f"reading must be V (variances) or S (standard deviations), got {reading!r}")
    found = PARAMETERS[parameters]
    if parameters != "paper" or reading == "V":
        return found
    return replace(found, cv=_squared(found.cv), ca=_squared(found.ca), ct=_squared(found.ct))


def _squared(noise: Noise) -> Noise:
    return replace(noise, yaw_rate=noise.yaw_rate**2, vertex=noise.vertex**2)

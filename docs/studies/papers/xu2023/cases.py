"""What is run for xu2023: the filters, the radar's courses, and what is varied because the paper does not print it.

The radar is "near", "far" or "behind"; the extent keeps its heading as Table I is printed, or "follows" the velocity.
"DRA(CV), S" and the like are the paper's filters in a reading of eq. (42), "literal" and "recommended" our parameters:
docs/methods/data-regions.md.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.papers.xu2023.enumeration import Enumeration
from studies.papers.xu2023.simulation import PRIOR_STD
from trackers.dra import DataRegion, Parameters, ProcessNoise
from trackers.dra.state import VERTICES

NEAR = (-19.3, -23.0)  # [m] of the radar from the target: 30 m away, the line of sight 50 deg from x
FAR = (-43.0, -55.0)  # 70 m
BEHIND = (-30.0, 0.0)
FEWER_RUNS = 200  # at most, of the first case under the reading that Table II fits less
SIDE_RUNS = 100  # at most, of all other cases but the recommended set's
VARIED = "not printed: "  # cases of its rows begin so
VARIED_RUNS = 16  # at most, of each variant of what is not printed

# Eq. (42) in reading V, which takes all numbers of Q as variances
VARIANCES = Parameters(
    cv=ProcessNoise(0.1**2, 1e-6, 1e-4),
    ca=ProcessNoise(0.1**2, 1e-6, 1e-4),
    ct=ProcessNoise(0.5**2, 1e-6, 1e-4),
    stay=0.9,  # not printed, as the gate and the priors of the regions
    turn_jacobian=False,
    rotating_ca=False,
    own_components=False,
    gate=0.15,
    gate_sigmas=0.0,
    rectangle_std=float("inf"),
    heading_std=float("inf"),
)


def squared(noise: ProcessNoise) -> ProcessNoise:
    """The noise whose numbers for yaw rate and vertices are taken as standard deviations."""
    return replace(noise, yaw_rate=noise.yaw_rate**2, vertex=noise.vertex**2)


STANDARD_DEVIATIONS = replace(  # reading S
    VARIANCES, cv=squared(VARIANCES.cv), ca=squared(VARIANCES.ca), ct=squared(VARIANCES.ct)
)
READINGS = {"S": STANDARD_DEVIATIONS, "V": VARIANCES}
STAY = VARIANCES.stay  # probability to keep a motion model for one step
# Ours for a body that keeps its heading while the velocity turns, as Table I is printed
LITERAL = Parameters(rotating_ca=False, own_components=False, heading_std=float("inf"))

_IMM = DataRegion(form=Enumeration(), prior="uniform")
_DRA, _EDRA = replace(_IMM, models=("cv",)), replace(_IMM, prior="rays")
METHODS = {
    **{
        f"{name}, {reading}": replace(f, parameters=numbers)
        for reading, numbers in READINGS.items()
        for name, f in (("DRA(CV)", _DRA), ("DRA-IMM", _IMM), ("EDRA-IMM", _EDRA))
    },
    "literal": DataRegion(parameters=LITERAL),
    "recommended": DataRegion(),
}
PRINTED = tuple(METHODS)[:6]


@dataclass(frozen=True)
class Variant:
    """One choice of what the paper does not print."""

    name: str
    offset: tuple[float, float] = NEAR  # [m] of the radar from the target
    blur: float = 1.0  # factor on the standard deviations of the first estimate
    vertex_std: float | None = None  # [m] of its vertices instead

    @property
    def prior_std(self) -> NDArray:
        """Standard deviations (11,) of the first estimate."""
        std = self.blur * PRIOR_STD
        if self.vertex_std is not None:
            std[VERTICES] = self.vertex_std
        return std


@dataclass(frozen=True)
class Sweep:
    """One filter over some variants, each of which is a row."""

    case: str
    filter: DataRegion
    variants: tuple[Variant, ...]
    follows: bool = False  # whether the body turns with the velocity
    most: int | None = None  # runs of each variant

    def runs(self, runs: int) -> int:
        """How many of `runs` are done."""
        return runs if self.most is None else min(runs, self.most)


def unprinted() -> Iterator[Variant]:
    """Courses of the radar, first the one of all other cases, and first estimates."""
    yield Variant("50 deg, 30 m")
    for bearing, distance in ((0, 30), (25, 30), (75, 30), (90, 30), (-50, 30), (50, 15), (50, 70), (50, 150)):
        b = np.radians(bearing)
        offset = float(-distance * np.cos(b)), float(-distance * np.sin(b))
        yield Variant(f"{bearing} deg, {distance} m", offset)
    yield Variant("P0 / 4", blur=0.5)
    yield Variant("P0 x 4", blur=2.0)
    for std in (0.1, 0.6):
        yield Variant(f"vertices {std} m", vertex_std=std)


def varied(name: str, stays: tuple[float, ...] = (), follows: bool = False) -> Iterator[Sweep]:
    """One method under everything that the paper does not print."""
    f, case = METHODS[name], f"{VARIED}{name}"
    yield Sweep(case, f, tuple(unprinted()), follows, VARIED_RUNS)
    for stay in stays:
        numbers = replace(f.numbers, stay=stay)
        yield Sweep(case, replace(f, parameters=numbers), (Variant(f"stay {stay}"),), follows, VARIED_RUNS)


def sweeps() -> Iterator[Sweep]:
    """All sweeps, in the order of the report."""
    for case, offset, follows, names, most in (
        ("near", NEAR, False, PRINTED[:3], None),
        ("near", NEAR, False, (*PRINTED[3:], "literal"), FEWER_RUNS),
        ("near, extent follows", NEAR, True, ("recommended",), None),
        ("near, extent follows", NEAR, True, ("EDRA-IMM, V",), SIDE_RUNS),
        ("far", FAR, False, (*PRINTED[3:], "literal"), SIDE_RUNS),
        ("far, extent follows", FAR, True, ("recommended",), SIDE_RUNS),
        ("behind, extent follows", BEHIND, True, ("recommended",), SIDE_RUNS),
    ):
        for name in names:
            yield Sweep(case, METHODS[name], (Variant(name, offset),), follows, most)
    yield from varied("DRA(CV), S")
    yield from varied("DRA-IMM, S", (0.8, 0.98, 0.995))
    yield from varied("recommended", (0.9, 0.995), follows=True)


SWEEPS = tuple(sweeps())

"""Populations of drivers: what each driver of traffic wants is drawn for each vehicle; docs/traffic.md.

Every trait has a median and a spread, the standard deviation of its logarithm. The unrest of Treiber, Kesting and
Helbing (2006), Physica A 360, is a sum of waves here, so that a driver stays a function of time and nothing is drawn on
the way.
"""

from dataclasses import dataclass, fields
from math import gamma, inf, pi
from numbers import Real
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.lookup import look_up
from trackers.toml_file import SUFFIX, read_table

DEFAULT = "default"  # the name of no population: all drivers of a class alike
TARGET_RATIO = 1.2  # target speed of drivers behind a leader, as a multiple of their speed
WAVES = 6  # of which an unrest is the sum
BURSTS = 1.6  # exponent of the sum: long rests and short strong pedals, as recorded
SHORTEST = 0.3  # [s] least time gap that a driver is given where its place is near another
LIMIT = 2.0  # spreads from the median beyond which no trait is drawn
TRAITS = ("speed", "time_gap", "standstill", "acceleration", "unrest", "politeness", "gain")


def steady_gap(speed: float, target: float, headway: float, standstill: float = 5.0) -> float:
    """Bumper gap [m] at which IDM drivers who want `target` [m/s] behind a leader keep `speed`."""
    return (standstill + headway * speed) / np.sqrt(1 - (speed / target) ** 4)


def balanced_target(
    speed: float, gap: float, headway: float, standstill: float = 5.0, ratio: float = TARGET_RATIO
) -> float:
    """Target speed [m/s], at most `ratio` times `speed`, of an IDM driver who keeps `speed` at this gap [m]."""
    share = min((standstill + headway * speed) / gap, 1.0) ** 2
    return speed * min((1 - share) ** -0.25 if share < 1 else ratio, ratio)


class Unrest(NamedTuple):
    """Acceleration of a driver beside that of its model."""

    rms: float  # [m/s^2]
    rate: NDArray  # (WAVES,) [rad/s]
    phase: NDArray  # (WAVES,) [rad]

    def at(self, time: float) -> float:
        """Acceleration [m/s^2] at a time [s]."""
        wave = float(np.sin(self.rate * time + self.phase).sum()) * (2 / WAVES) ** 0.5
        usual = (2**BURSTS * gamma(BURSTS + 0.5) / pi**0.5) ** 0.5  # rms of |x|^BURSTS of a standard normal x
        return self.rms * np.sign(wave) * abs(wave) ** BURSTS / usual


class Driver(NamedTuple):
    """One driver."""

    speed: float  # it wants, as a multiple of that of its flow
    time_gap: float  # [s]
    standstill: float  # [m] gap in a queue
    acceleration: float  # [m/s^2] with a free road
    unrest: float  # [m/s^2] rms
    politeness: float  # share of the loss of others that counts against a lane change
    gain: float  # [m/s^2] for which it changes lane; inf: never
    pace: float  # [rad/s] of its unrest
    median_speed: float  # of its population

    @property
    def ratio(self) -> float:
        """Speed that it wants in a queue, as a multiple of that of the queue: above 1, or it falls back."""
        return max(self.speed, 1.05)

    def gap(self, speed: float) -> float:
        """Gap [m] that it keeps in a queue at a speed [m/s]."""
        return steady_gap(speed, self.ratio * speed, self.time_gap, self.standstill)

    def target(self, speed: float, gap: float) -> float:
        """Speed [m/s] that it wants who drives with a gap [m]; on a free road its share of that of the others."""
        if gap == inf:
            return speed * self.speed / self.median_speed
        return balanced_target(speed, gap, self.time_gap, self.standstill, self.ratio)

    def within(self, gap: float, speed: float) -> "Driver":
        """The driver with no longer time gap than a gap [m] allows at a speed [m/s]."""
        most = max(gap - self.standstill, 0.0) / max(speed, 1.0)
        return self._replace(time_gap=max(min(self.time_gap, most), SHORTEST))

    def habits(self, rng: np.random.Generator) -> dict[str, Any]:
        """Constants of `SizedIDM` in its place; the waves of its unrest are drawn."""
        waves = Unrest(self.unrest, self.pace * rng.uniform(0.4, 1.6, WAVES), rng.uniform(0, 2 * pi, WAVES))
        return {
            "TIME_WANTED": self.time_gap, "DISTANCE_WANTED": self.standstill, "COMFORT_ACC_MAX": self.acceleration,
            "POLITENESS": self.politeness, "LANE_CHANGE_MIN_ACC_GAIN": self.gain, "UNREST": waves,
            "ACC_MAX": 9.0, "CLEARANCE": 60.0,
        }  # fmt: skip


@dataclass(frozen=True)
class Population:
    """Median and spread of each trait of its drivers; correlations are those of logarithms."""

    speed: tuple[float, float] = (1.2, 0.0)
    time_gap: tuple[float, float] = (1.5, 0.0)  # [s]
    standstill: tuple[float, float] = (5.0, 0.0)  # [m]
    acceleration: tuple[float, float] = (3.0, 0.0)  # [m/s^2]
    unrest: tuple[float, float] = (0.0, 0.0)  # [m/s^2]
    politeness: tuple[float, float] = (0.0, 0.0)
    gain: tuple[float, float] = (inf, 0.0)  # [m/s^2]
    pace: float = 1.0  # [rad/s] mean rate of the waves of the unrest
    speed_time_gap: float = 0.0  # correlations
    speed_unrest: float = 0.0
    time_gap_unrest: float = 0.0

    def __post_init__(self) -> None:
        for name in TRAITS:
            value = getattr(self, name)
            if not (np.shape(value) == (2,) and all(isinstance(v, Real) and float(v) >= 0 for v in value)):
                raise ValueError(f"{name} must be a median and a spread of at least 0, got {value!r}")
        if np.linalg.eigvalsh(self._correlation).min() < 0:
            raise ValueError(
                "speed_time_gap, speed_unrest and time_gap_unrest are too large together; give smaller ones"
            )

    @property
    def _correlation(self) -> NDArray:
        pairs = ("speed_time_gap", 0, 1), ("speed_unrest", 0, 4), ("time_gap_unrest", 1, 4)
        R = np.eye(len(TRAITS))
        for name, i, j in pairs:
            R[i, j] = R[j, i] = getattr(self, name)
        return R

    def draw(self, rng: np.random.Generator) -> Driver:
        """One driver."""
        w, U = np.linalg.eigh(self._correlation)
        z = np.clip(U @ (np.sqrt(np.maximum(w, 0.0)) * rng.standard_normal(len(TRAITS))), -LIMIT, LIMIT)
        median, spread = np.array([getattr(self, name) for name in TRAITS]).T
        traits = zip(TRAITS, (median * np.exp(spread * z)).tolist(), strict=True)
        return Driver(**dict(traits), pace=self.pace, median_speed=self.speed[0])


POPULATIONS = MappingProxyType({
    "recorded": Population(  # fitted to NGSIM: docs/results/drivers.json, `python -m studies drivers`
        speed=(1.3, 0.1), time_gap=(1.369, 0.69), standstill=(1.0, 0.3), acceleration=(1.5, 0.2),
        unrest=(1.1, 0.408), politeness=(0.2, 0.3), gain=(1.07, 0.3), pace=1.959, speed_unrest=0.384,
    ),
    "aggressive": Population(  # a choice
        speed=(1.35, 0.1), time_gap=(0.8, 0.25), standstill=(2.0, 0.2), acceleration=(2.5, 0.2), unrest=(0.6, 0.3),
        gain=(0.1, 0.3), pace=1.5,
    ),
    "calm": Population(  # a choice
        speed=(1.1, 0.05), time_gap=(2.2, 0.2), standstill=(4.0, 0.2), acceleration=(1.0, 0.2), unrest=(0.2, 0.3),
        politeness=(0.5, 0.2), pace=1.0,
    ),
})  # fmt: skip


def find(name: str) -> Population | None:
    """The population of that name, or of a TOML file with its fields; None for `DEFAULT`.

    Raises:
        LookupError: no such population, or the file cannot be read.
        ValueError: the file is no TOML, or has a key or value that no population has.
    """
    if not (isinstance(name, str) and name.endswith(SUFFIX)):
        return None if name == DEFAULT else look_up(name, POPULATIONS, "population of drivers")
    found = read_table(name, "drivers", "write time_gap = [1.5, 0.3], a median and a spread")
    known = [one.name for one in fields(Population)]
    if unknown := found.keys() - {*known}:
        raise ValueError(f"{name} has no key {', '.join(sorted(unknown))}; it has {', '.join(known)}")
    try:
        values: dict[str, Any] = {key: tuple(v) if isinstance(v, list) else v for key, v in found.items()}
        return Population(**values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from None


def with_drivers(scenario: str, drivers: str) -> str:
    """The name of a scenario with a population; that alone for `DEFAULT`.

    >>> with_drivers("cut-in", "calm"), with_drivers("probe-brake:gap=26", "calm")
    ('cut-in:drivers=calm', 'probe-brake:gap=26,drivers=calm')
    """
    return scenario if drivers == DEFAULT else f"{scenario}{',' if '=' in scenario else ':'}drivers={drivers}"

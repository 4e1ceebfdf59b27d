"""The fit of a population to one half of the recorded drivers, and how near it comes to both halves."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.drivers import Population
from studies.drivers.motions import QUANTITIES, Flows, Motion, of_population, per_km, values

SHOWN = (5, 25, 50, 75, 95)  # [%]
TUNED, REPORTED = range(8), range(100, 112)  # seeds of the simulation
ALLOWED = 0.1  # of a quantile, or of half of what lies between the outer two: accelerations have a median of 0
RESAMPLES, LEVEL = 400, 90
LEAST = 1.0  # [m] of a gap in a queue
ROUNDS, DAMPING = 6, 0.7  # of the fit, and the exponent of its steps
SPEED, SHORT, OTHERS = (1.3, 0.1), 0.3, (0.2, 0.3)  # desired speed, spread of standstill, politeness: choices
ACCELERATION, GAIN_SPREAD = (1.5, 0.2), 0.3  # [m/s^2] of a free road, of which queues say nothing; choices


class Row(NamedTuple):
    """A quantile, or the lane changes per km."""

    quantity: str
    level: int  # [%], 0 for a rate
    tuned: float  # of the half that it was fitted to
    held: float  # of the other half
    allowed: float  # by how much one may differ from it
    low: float  # its interval, drawing vehicles
    high: float
    simulated: float  # under seeds that nothing was fitted with
    default: float  # the same of the drivers that are all alike


def near(row: Row) -> bool:
    """Whether the population is within what is allowed of the half that nothing was fitted to, or in its interval."""
    return abs(row.simulated - row.held) <= row.allowed or row.low <= row.simulated <= row.high


def fitted(half: Sequence[Motion]) -> tuple[Population, Flows]:
    """Each figure follows the statistic that it moves most, round by round, under fixed seeds."""
    moved = [m for m in half if m.way > 0]
    rms = np.log([np.sqrt(np.mean(m.acceleration**2)) for m in moved])
    together = np.corrcoef(rms, np.log([max(float(np.mean(m.speed)), 0.5) for m in moved]))[0, 1]
    measured = np.std(rms), together, -np.mean(values(half, "acceleration"))
    unrest_spread, together, braking = (round(float(value), 3) for value in measured)
    speeds = np.quantile([float(np.mean(m.speed)) for m in moved], np.linspace(0.0, 1.0, 21)).round(2)
    flows = Flows(tuple(speeds.tolist()), braking)
    x = np.array([1.4, 0.7, 1.0, 1.1, 1.95, 1.4])  # as in `made`
    for _ in range(ROUNDS):
        population = made(x, unrest_spread, together)
        ratio = _figures(half) / _figures(simulated(population, flows, TUNED))
        x = x * np.clip(ratio, 0.5, 2.0) ** (DAMPING * np.array([1, 1, 1, 1, 1, -0.5]))
        x[2] = max(x[2], LEAST)
    return made(np.round(x, 3), unrest_spread, together), flows


def made(x: NDArray, unrest_spread: float, together: float) -> Population:
    """A population from what is fitted."""
    time_gap, spread, standstill, unrest, pace, gain = x.tolist()
    return Population(
        SPEED, (time_gap, spread), (standstill, SHORT), ACCELERATION, (unrest, unrest_spread), OTHERS,
        (gain, GAIN_SPREAD), pace, speed_unrest=together,
    )  # fmt: skip


def _figures(found: Sequence[Motion]) -> NDArray:
    """What `fitted` matches: one statistic for each figure, in the order of `made`."""
    gap, _, acceleration, jerk = (np.percentile(values(found, quantity), SHOWN) for quantity in QUANTITIES)
    wide, shaking, spread = np.ptp(acceleration), np.ptp(jerk), np.log(gap[-1] / gap[2])
    return np.array([gap[2], spread, gap[0], wide, shaking / wide, per_km(found)])


def simulated(population: Population, flows: Flows, seeds: Sequence[int]) -> list[Motion]:
    """Drivers under several seeds, a speed of the traffic each, evenly from its distribution."""
    level = (np.arange(len(seeds)) + 0.5) / len(seeds)
    speeds = np.interp(level, np.linspace(0.0, 1.0, len(flows.speeds)), flows.speeds).tolist()
    drives = zip(speeds, seeds, strict=True)
    return [motion for speed, seed in drives for motion in of_population(population, speed, flows.braking, seed)]


def statistics(found: Sequence[Motion]) -> NDArray:
    """Quantiles of all quantities, and the lane changes per km at the end."""
    quantiles = [np.percentile(values(found, quantity), SHOWN) for quantity in QUANTITIES]
    return np.array([*np.concatenate(quantiles), per_km(found)])


def allowed(aim: NDArray) -> NDArray:
    """By how much each statistic may differ."""
    q = aim[:-1].reshape(-1, len(SHOWN))
    signed = np.where(q[:, :1] < 0, (q[:, -1:] - q[:, :1]) / 2, 0.0)
    return np.array([*(ALLOWED * np.maximum(np.abs(q), signed)).ravel(), ALLOWED * aim[-1]])


def interval(found: Sequence[Motion], road: Any = lambda m: m.way > 0) -> NDArray:
    """Limits (2, statistics) by the bootstrap over the vehicles of either road."""
    rng = np.random.default_rng(0)
    roads = [[m for m in found if road(m)], [m for m in found if not road(m)]]
    drawn = [statistics([r[k] for r in roads for k in rng.integers(len(r), size=len(r))]) for _ in range(RESAMPLES)]
    return np.percentile(drawn, ((100 - LEVEL) / 2, (100 + LEVEL) / 2), axis=0)


def compared(tuned: Sequence[Motion], held: Sequence[Motion], population: Population, flows: Flows) -> list[Row]:
    """All statistics of both halves beside those of a population and of drivers that are all alike."""
    low, high = interval(held)
    alike = Population()
    columns = (
        statistics(tuned), statistics(held), allowed(statistics(held)), low, high,
        statistics(simulated(population, flows, REPORTED)), statistics(simulated(alike, flows, REPORTED)),
    )  # fmt: skip
    names = [(quantity, level) for quantity in QUANTITIES for level in SHOWN] + [("changes", 0)]
    table = np.round(np.array(columns).T, 3).tolist()
    return [Row(*name, *row) for name, row in zip(names, table, strict=True)]

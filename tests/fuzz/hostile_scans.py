"""Scans and time steps as a broken sensor, driver or conversion of units would send them, from a generator."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers import Scan
from trackers.batch import stack
from trackers.geometry import rotation, unit

ABSURD = (0.0, -0.0, 1e-300, -1e-300, 1e-9, -1.0, 1e3, -1e3, 1e6, 1e9, -1e9, 1e18, -1e18, 1e150, 1e300, -1e300)
EXTREME = (499.0, -499.0, 9.9e3, -9.9e3, 9.9e5, 9.9e6, -9.9e6)  # just within the limits of one field or another
NOT_FINITE = (np.nan, np.inf, -np.inf)
FIELDS = ("polar", "pose", "velocity", "noise", "platform")
NOISE = (0.15, 0.01, 0.1)  # [m], [rad], [m/s]
USUAL = 1 / 15  # [s]
ODD_STEPS = (0.0, -0.0, 1e-300, 1e-9, 0.5, 2.0, 60.0, 1e4, 1e12, 1e300, np.inf, np.nan, -0.1)  # [s]
PLATFORM = np.array([0.0, 0.0, 0.0, 25.0, 0.0, 0.0])


class Car(NamedTuple):
    """A car, relative to the platform."""

    x: float  # [m]
    y: float
    heading: float = 0.05  # [rad]
    speed: float = 24.0  # [m/s] over ground

    def at(self, time: float) -> "Car":
        """The car at a time [s]: it falls back a little and comes again, and stays in view."""
        return self._replace(x=self.x + 5 * float(np.sin(0.2 * time)), speed=self.speed + float(np.cos(0.2 * time)))


CARS = (Car(20.0, 3.5), Car(35.0, -3.5), Car(60.0, 0.0, np.pi, 20.0))


def clean(rng: np.random.Generator, cars: Sequence[Car], most: int = 25) -> Scan:
    """Up to `most` detections of each car by one radar on a moving platform; now and then some padding of NaN."""
    polar = np.concatenate([_of_car(rng, car, int(rng.integers(0, most))) for car in cars])
    mask = np.ones(len(polar), bool)
    if rng.random() < 0.2:
        mask = rng.random(len(polar)) < 0.7
        polar[~mask] = np.nan
    return scan_of(polar, mask)


def _of_car(rng: np.random.Generator, car: Car, M: int) -> NDArray:
    """Range, azimuth and range rate (M, 3) of points inside a car."""
    xy = np.array([car.x, car.y]) + (rng.uniform(-1, 1, (M, 2)) * [2.3, 0.9]) @ rotation(car.heading).T
    a = np.arctan2(xy[:, 1], xy[:, 0])
    rate = unit(a) @ (car.speed * unit(car.heading) - PLATFORM[3:5])
    return np.stack([np.hypot(*xy.T), a, rate], -1) + rng.standard_normal((M, 3)) * NOISE


def scan_of(polar: NDArray, mask: NDArray) -> Scan:
    """Detections polar (M, 3) of one radar in the middle of the platform."""
    M = len(polar)
    velocity, noise = np.tile(PLATFORM[3:5], (M, 1)), np.tile(NOISE, (M, 1))
    return Scan(polar, mask, np.zeros((M, 3)), velocity, noise, np.zeros(M, int), PLATFORM.copy())


def together(scans: Sequence[Scan]) -> Scan:
    """Scans (M,) of several objects as one (T, M), padded with NaN."""
    M = max(len(scan.mask) for scan in scans)

    def padded(field: NDArray) -> NDArray:
        rest = np.zeros((M - len(field), *field.shape[1:]), field.dtype)
        return np.concatenate([field, rest if field.dtype.kind in "bi" else np.full_like(rest, np.nan)])

    rows = [Scan(*(padded(field) for field in scan[:6]), scan.platform) for scan in scans]
    return stack(rows)


def time_step(rng: np.random.Generator) -> float:
    """The usual step [s], now and then none, a long one or an absurd one."""
    return USUAL if rng.random() < 0.85 else float(rng.choice(ODD_STEPS))


def spoil(scan: Scan, rng: np.random.Generator) -> Scan:
    """The scan with one thing wrong, or two."""
    for _ in range(int(rng.integers(1, 3))):
        scan = KINDS[int(rng.integers(len(KINDS)))](scan, rng)
    return scan


def a_number(scan: Scan, rng: np.random.Generator, values: tuple[float, ...] = ABSURD) -> Scan:
    """One number of a field is absurd, or a column of them."""
    name = FIELDS[int(rng.integers(len(FIELDS)))]
    field = np.array(getattr(scan, name), float)
    bad, column = float(rng.choice(values)), int(rng.integers(field.shape[-1]))
    if field.ndim == 1 or rng.random() < 0.5:
        field[..., column] = bad
    elif len(field):
        field[int(rng.integers(len(field))), column] = bad
    return scan._replace(**{name: field})


def not_a_number(scan: Scan, rng: np.random.Generator) -> Scan:
    """One number of a field is not finite, or a column of them."""
    return a_number(scan, rng, NOT_FINITE)


def an_extreme(scan: Scan, rng: np.random.Generator) -> Scan:
    """One number of a field is as large as the field allows, or a column of them."""
    return a_number(scan, rng, EXTREME)


def one_place(scan: Scan, rng: np.random.Generator) -> Scan:
    """All detections in one place, or on the sensor."""
    polar = scan.polar.copy()
    polar[:] = polar[:1] if rng.random() < 0.5 else 0.0
    return scan._replace(polar=polar)


def many(scan: Scan, rng: np.random.Generator) -> Scan:
    """Hundreds of detections on a line, without range rates."""
    M = int(rng.integers(100, 400))
    polar = np.stack([np.linspace(1.0, 100.0, M), np.zeros(M), np.full(M, np.nan)], -1)
    return scan_of(polar, np.ones(M, bool))._replace(platform=scan.platform)


def wrong_units(scan: Scan, rng: np.random.Generator) -> Scan:
    """A field times powers of ten."""
    name = FIELDS[int(rng.integers(len(FIELDS)))]
    value = np.array(getattr(scan, name), float)
    return scan._replace(**{name: value * 10.0 ** rng.uniform(-8, 8, value.shape[-1])})


def sure(scan: Scan, rng: np.random.Generator) -> Scan:
    """Noise that is stated to be next to nothing."""
    return scan._replace(noise=np.full_like(scan.noise, rng.choice([0.0, 1e-300, 1e-12, 1e-6])))


def no_rates(scan: Scan, rng: np.random.Generator) -> Scan:
    """Some range rates were not measured."""
    polar = scan.polar.copy()
    polar[rng.random(len(polar)) < rng.random(), 2] = np.nan
    return scan._replace(polar=polar)


def elsewhere(scan: Scan, rng: np.random.Generator) -> Scan:
    """The sensor has jumped, or everything has turned."""
    pose = scan.pose.copy()
    pose[:, int(rng.integers(3))] += 10.0 ** rng.uniform(0, 4)
    return scan._replace(pose=pose)


def malformed(scan: Scan, rng: np.random.Generator) -> Scan:
    """The scan with one field of another type or shape."""
    name = Scan._fields[int(rng.integers(len(Scan._fields)))]
    value = np.ones(1, bool) if name == "delivered" else getattr(scan, name)
    with np.errstate(over="ignore"):  # an absurd number may be none of float32
        single = value.astype(np.float32)
    others = (
        None,
        value.tolist(),
        value.astype(complex),
        value.astype(object),
        single,
        value.astype(str),
        value[..., :-1],
        value[None],
        np.concatenate([value, value]),
    )
    return scan._replace(**{name: others[int(rng.integers(len(others)))]})


KINDS = (
    a_number,
    a_number,
    an_extreme,
    an_extreme,
    not_a_number,
    one_place,
    many,
    wrong_units,
    sure,
    no_rates,
    elsewhere,
)

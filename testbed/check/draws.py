"""What the laws of a filter are tried on: priors and scans drawn from a generator, and the comparison of states."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate, prior
from trackers.scan import Scan


class Broken(AssertionError):
    """A law is broken; one sentence says how, and what to look at."""


def random_prior(rng: np.random.Generator, lead: tuple[int, ...] = ()) -> Estimate:
    """Objects with leading axes `lead` of 3 to 12 m length, within some 20 m of the origin, at some 10 m/s."""
    return prior(
        rng.normal(0, 20, (*lead, 3)),
        velocity=rng.normal(0, 10, (*lead, 2)),
        yaw_rate=rng.normal(0, 0.1, lead),
        size=rng.uniform([3, 1.5], [12, 2.6], (*lead, 2)),
    )


def random_scan(
    rng: np.random.Generator, centre: NDArray, M: int = 7, lead: tuple[int, ...] = (), missing: bool = False
) -> Scan:
    """Up to M detections around each centre (*lead, 2 or more) [m], with range rates.

    With `missing` the first range rate of each object was not measured.
    """
    xy = centre[..., None, :2] + rng.normal(0, 1.2, (*lead, M, 2))
    mask = rng.random((*lead, M)) < 0.7
    scan = Scan.from_xy(xy, mask, pose=(1.0, -2.0, 0.3), noise=(0.1, 0.01, 0.1))
    polar = scan.polar.copy()
    polar[..., 2] = rng.normal(0, 5, polar.shape[:-1])
    if missing:
        polar[..., 0, 2] = np.nan
    return scan._replace(polar=polar)


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, NDArray]]:
    """Arrays of a state, an estimate, a tuple of such or a plain array, with their names: "inner.P".

    What is None, and a string, has none.
    """
    if isinstance(value, tuple):
        for key, part in zip(getattr(value, "_fields", map(str, range(len(value)))), value, strict=True):
            yield from leaves(part, f"{name}.{key}" if name else key)
    elif not (value is None or isinstance(value, str)):
        yield name or "array", np.asarray(value)


def arrays(value: Any) -> list[NDArray]:
    """The arrays of `leaves` without their names."""
    return [array for _, array in leaves(value)]


def check_equal(
    got: Any, expected: Any, rtol: float = 1e-9, atol: float = 1e-9, law: str = "two states differ"
) -> None:
    """Raise `Broken` where arrays of two states, estimates or tuples of such differ by more than rtol and atol."""
    ours, theirs = list(leaves(got)), list(leaves(expected))
    if [name for name, _ in ours] != [name for name, _ in theirs]:
        raise Broken(f"{law}: one has {_names(ours)}, the other {_names(theirs)}")
    for (name, a), (_, b) in zip(ours, theirs, strict=True):
        if a.shape != b.shape:
            raise Broken(f"{law}: {name} has the shape {a.shape}, which should be {b.shape}")
        close = np.isclose(a, b, rtol, atol, equal_nan=True)
        if not close.all():
            where = np.argwhere(~close)[0]
            at = f"{name}[{', '.join(map(str, where))}]" if len(where) else name
            found, due = (float(array[tuple(where)]) for array in (a, b))
            digits = 9 if f"{found:.9g}" != f"{due:.9g}" else 17
            raise Broken(f"{law}: {at} is {found:.{digits}g}, which should be {due:.{digits}g}")


def check_finite(value: Any, law: str) -> None:
    """Raise `Broken` where an array of a state, an estimate or a tuple of such is not finite."""
    for name, array in leaves(value):
        if not np.isfinite(array).all():
            raise Broken(f"{law}: {name} is not finite, {array[~np.isfinite(array)].flat[0]}")


def _names(found: list[tuple[str, NDArray]]) -> str:
    return ", ".join(name for name, _ in found) or "no arrays"

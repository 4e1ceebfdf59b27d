"""Validation: what filters and the multi-object tracker take in, and what an update may return.

A scan is admitted once: by the multi-object tracker, or by the decorator of a filter that is used alone. Rules and
limits: docs/methods/multi-object-tracking.md, section 11. The limits are far outside what radars and vehicles do: they
find wrong units and broken drivers, they do not tell clutter from traffic.
"""

from collections.abc import Callable, Iterator
from functools import wraps
from types import MethodType
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from trackers.filter import Note
from trackers.linalg import floored
from trackers.scan import Scan

MAX_STEP = 60.0  # [s] after a minute a vehicle may be anywhere within kilometres: nothing is left of a track
MAX_RANGE = 1e4  # [m] radars of vehicles reach 300 m, those of ships and airports 10 km
MAX_SPEED = 500.0  # [m/s] of a range rate, sensor or platform; two of the fastest cars towards each other make 250
MAX_PLACE = 1e7  # [m] of a sensor: the distance from the equator to a pole; map coordinates stay below
MAX_ANGLE = 1e4  # [rad] a heading that was never wrapped has this after 1600 turns; beyond, its digits are lost
MAX_YAW_RATE = 100.0  # [rad/s] 16 turns a second
MAX_NOISE = (1e6, 1e3, 1e6)  # [m], [rad], [m/s] far beyond what is stated where nothing is known
LARGEST = 1e15  # of a state, whatever the unit: beyond, the digits of a metre are lost

MASKED = "some detections are outside what radars measure and are left out"
SKIPPED = "the update would not be finite with a definite covariance, the prediction stays"

Method = TypeVar("Method", bound=Callable[..., Any])


class Limits(NamedTuple):
    """Plausible values of the C columns of a field."""

    least: NDArray  # (C,)
    most: NDArray  # (C,)
    optional: NDArray  # (C,) bool, NaN stands for not measured or not known
    hint: str  # cause or remedy of a value that is not finite

    def known(self, value: NDArray) -> NDArray:
        """Whether each row of value (..., C) is finite, but for what is optional, (...)."""
        return np.asarray((np.isfinite(value) | np.isnan(value) & self.optional).all(-1))


def _up_to(most: tuple[float, ...], hint: str) -> Limits:
    return Limits(-np.array(most), np.array(most), np.zeros(len(most), bool), hint)


LIMITS = {
    "polar": Limits(
        np.array([0.0, -MAX_ANGLE, -MAX_SPEED]),
        np.array([MAX_RANGE, MAX_ANGLE, MAX_SPEED]),
        np.array([False, False, True]),
        "only the range rate may be NaN: set mask to false there",
    ),
    "pose": _up_to((MAX_PLACE, MAX_PLACE, MAX_ANGLE), "the mount or the motion of the sensor is missing"),
    "velocity": _up_to((MAX_SPEED, MAX_SPEED), "the motion of the sensor is missing"),
    "noise": Limits(np.zeros(3), np.array(MAX_NOISE), np.ones(3, bool), "NaN stands for noise that is not known"),
}
PLATFORM = _up_to(
    (MAX_PLACE, MAX_PLACE, MAX_ANGLE, MAX_SPEED, MAX_SPEED, MAX_YAW_RATE),
    "the ego motion is missing, or its units are not m, rad and s",
)
NUMBERS = ("fiu", "real numbers", 2)  # kinds of the type in numpy's letters and in words, axes that are no leading ones
FIELDS = (
    *(NUMBERS, ("b", "booleans", 1), NUMBERS, NUMBERS, NUMBERS),  # polar, mask, pose, velocity, noise
    *(("iu", "integers", 1), ("fiu", "real numbers", 1)),  # sensor, platform
)


class Admitted(NamedTuple):
    """A scan in which every number is plausible, padding included."""

    scan: Scan
    implausible: NDArray  # (...) int, detections that were masked


def admit(scan: Scan, lead: tuple[int, ...]) -> Admitted:
    """The scan for objects (...) with leading axes `lead`, implausible detections masked, 0 for implausible numbers.

    Padding may hold anything; in what is returned it is plausible too, so that no sum under a mask can become NaN. An
    ordinary scan is returned as it came.

    Raises:
        ValueError: a field of wrong shape or type; a number under the mask that is not finite, but for a range rate
            not measured and a noise not known; an implausible platform. The error names the field.

    """
    check_fields(scan, lead)
    if not (np.abs(scan.platform) <= PLATFORM.most).all():
        raise ValueError(f"scan.platform must be finite and plausible, got {scan.platform}; {PLATFORM.hint}")
    mask, repaired = scan.mask, {}
    for name, limits in LIMITS.items():
        value = getattr(scan, name)
        inside = (limits.least <= value) & (value <= limits.most)
        if inside.all():  # the usual case, decided at little cost
            continue
        inside |= np.isnan(value) & limits.optional
        if inside.all():
            continue
        bad = scan.mask & ~limits.known(value)
        if bad.any():
            raise ValueError(f"scan.{name} is not finite for {int(bad.sum())} detections under the mask; {limits.hint}")
        mask = mask & inside.all(-1)
        repaired[name] = np.where(inside, value, 0.0)
    if not repaired:
        return Admitted(scan, np.zeros(mask.shape[:-1], int))
    return Admitted(scan._replace(mask=mask, **repaired), (scan.mask & ~mask).sum(-1))


def check_fields(scan: Scan, lead: tuple[int, ...]) -> None:
    """Raise ValueError for fields that are no arrays of numbers, or do not fit together or to the objects."""
    if scan.delivered is not None and not (isinstance(scan.delivered, np.ndarray) and scan.delivered.dtype == bool):
        raise ValueError(f"scan.delivered must be an array of booleans or None, got {scan.delivered!r}")
    for name, value, (kinds, kind, own) in zip(scan._fields, scan, FIELDS):
        if not isinstance(value, np.ndarray) or value.dtype.kind not in kinds:
            what = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
            raise ValueError(f"scan.{name} must be an array of {kind}, got {what}; use np.asarray and astype")
        axes = value.shape[:-own]
        if axes not in ((), lead) and not _broadcasts(axes, lead):
            raise ValueError(
                f"scan.{name} has leading axes {axes}, the objects have {lead}; scans of several objects are stacked, "
                "a multi-object tracker takes one scan at a time"
            )
    M = scan.mask.shape[-1:]
    if scan.polar.shape[-2:] != (*M, 3):
        raise ValueError(
            f"scan.polar must be (..., M, 3) with mask (..., M), got {scan.polar.shape} and {scan.mask.shape}; "
            "Cartesian detections go through Scan.from_xy"
        )
    for name, width in (("pose", 3), ("velocity", 2), ("noise", 3)):
        shape = getattr(scan, name).shape
        if shape[-1:] != (width,) or shape[-2:-1] not in ((1,), M):
            raise ValueError(f"scan.{name} must be (..., M or 1, {width}) with M = {M[0]}, got {shape}")
    if scan.sensor.shape[-1:] not in ((1,), M):
        raise ValueError(f"scan.sensor must be (..., M or 1) with M = {M[0]}, got {scan.sensor.shape}")
    if scan.platform.shape[-1:] != (6,):
        raise ValueError(f"scan.platform must be (..., 6), got {scan.platform.shape}")


def _broadcasts(axes: tuple[int, ...], lead: tuple[int, ...]) -> bool:
    """Whether arrays with these leading axes broadcast to objects with leading axes `lead`."""
    return len(axes) <= len(lead) and all(a in (1, b) for a, b in zip(axes[::-1], lead[::-1]))


def check_step(dt: float) -> None:
    """Raise ValueError for a time step [s] that is not finite, negative or longer than a minute."""
    if not 0 <= dt <= MAX_STEP:
        raise ValueError(
            f"dt must be finite, >= 0 and at most {MAX_STEP:g} s, got {dt}; scans come in the order of time, "
            "and after a longer gap tracks start again"
        )


def guarded_predict(predict: Method) -> Method:
    """The method `predict` of a filter with validation: a useful time step in, a usable state out, else ValueError."""

    @wraps(predict)
    def checked(self: Any, state: Any, dt: float) -> Any:
        check_step(dt)
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # the result is checked instead
            new = predict(self, state, dt)
        good = usable(new, state, next(arrays(state)).shape[:-1])
        if not good.all():
            raise ValueError(
                f"dt = {dt:g} s leaves {int((~good).sum())} objects with a state that is not finite or beyond "
                f"{LARGEST:g}; they were predicted for too long without detections and must start again"
            )
        return new

    checked.unguarded = predict  # type: ignore[attr-defined]
    return cast(Method, checked)


def guarded_update(update: Method) -> Method:
    """The method `update` of a filter that is used alone: an admitted scan in, a usable state out.

    A state is a NamedTuple of arrays, the first a vector (..., n) for each object, its covariances called P. The
    information has notes of the objects with implausible detections, and of those that `guarded` left as they were.
    """

    @wraps(update)
    def checked(self: Any, state: Any, scan: Scan, *rest: Any) -> tuple[Any, Any]:
        lead = next(arrays(state)).shape[:-1]
        admitted, implausible = admit(scan, lead)
        new, info = guarded(MethodType(checked, self), state, admitted, *rest)
        return new, noted(info, Note("implausible", MASKED, np.broadcast_to(implausible > 0, lead)))

    checked.unguarded = update  # type: ignore[attr-defined]
    return cast(Method, checked)


def unguarded(method: Method) -> Method:
    """A method of a filter without the validation of its decorator, for a caller that has validated the scan."""
    plain: Any = getattr(method, "unguarded", None)
    if plain is None or getattr(method, "__wrapped__", None) is not plain:  # or wrapped once more by a user
        return method
    return cast(Method, MethodType(cast(Any, plain), cast(Any, method).__self__))


def guarded(update: Callable[..., tuple[Any, Any]], state: Any, scan: Scan, *rest: Any) -> tuple[Any, Any]:
    """State and information of the update of a filter by a scan that was admitted.

    An object whose update would not be usable is updated without its detections: its state stays as it was, and the
    information has a note of it. A method `update` without the decorator `guarded_update` is called as it is.
    """
    plain = unguarded(update)
    if plain is update:
        return update(state, scan, *rest)
    lead = next(arrays(state)).shape[:-1]
    new, info, good = state, None, np.zeros(lead, bool)
    try:
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # the result is checked instead
            new, info = plain(state, scan, *rest)
        new = definite(new, state)
        good = usable(new, state, lead)
    except np.linalg.LinAlgError:  # a matrix of some object is singular; each alone shows of which
        for index in np.ndindex(lead):
            one = np.zeros(lead, bool)
            one[index] = True
            good |= one & _is_usable(plain, state, scan._replace(mask=scan.mask & one[..., None]), lead, *rest)
    if good.all():
        return new, info
    new, info = plain(state, scan._replace(mask=scan.mask & good[..., None]), *rest)
    return definite(new, state), noted(info, Note("skipped", SKIPPED, ~good & scan.mask.any(-1)))


def _is_usable(update: Any, state: Any, scan: Scan, lead: tuple[int, ...], *rest: Any) -> NDArray:
    """Of which objects (...) an update would be usable; of none where a matrix is singular."""
    try:
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            return usable(definite(update(state, scan, *rest)[0], state), state, lead)
    except np.linalg.LinAlgError:
        return np.zeros(lead, bool)


def noted(info: Any, note: Note) -> Any:
    """The information of an update with one more note, if it is of any object."""
    return info._replace(notes=(*info.notes, note)) if note.where.any() else info


def arrays(state: Any) -> Iterator[NDArray]:
    """The arrays of a state, a NamedTuple that may hold others."""
    for value in state:
        if isinstance(value, tuple):
            yield from arrays(value)
        elif value is not None:
            yield value


def changed(new: Any, old: Any) -> Iterator[NDArray]:
    """The arrays of a state that are not those of an old one."""
    for value, before in zip(new, old, strict=True):
        if value is None or value is before:
            continue
        if isinstance(value, tuple):
            yield from changed(value, before)
        else:
            yield value


def usable(new: Any, old: Any, lead: tuple[int, ...]) -> NDArray:
    """Of which objects (...) with leading axes `lead` all numbers of a new state are finite and not beyond LARGEST.

    Arrays that the old state has too were tested before.
    """
    good = np.ones(lead, bool)
    values = list(changed(new, old))
    if not values:
        return good
    every = np.concatenate(values, axis=None)
    if np.abs(every).max(initial=0.0) <= LARGEST:  # the usual case, decided at little cost
        return good
    for value in values:
        good = good & (np.abs(value) <= LARGEST).all(tuple(range(len(lead), np.ndim(value))))
    return good


def definite(new: Any, old: Any) -> Any:
    """The state after an update, its covariances P definite again where rounding took that away.

    `old` is the state before: the rounding is a share of the covariance that the new one was computed from.
    """
    if new is old:
        return new
    repaired = {}
    for name, value, before in zip(new._fields, new, old, strict=True):
        sound = value
        if value is None or before is None or value is before:
            continue
        if name == "P":
            sound = floored(value, before)
            if sound is not value:  # an object without a detection keeps what it had
                sound = np.where((value != before).any((-2, -1), keepdims=True), sound, value)
        elif isinstance(value, tuple):
            sound = definite(value, before)
        if sound is not value:
            repaired[name] = sound
    return new._replace(**repaired) if repaired else new

"""Predict and update of a composed filter by the compiled functions, for the parts that have a compiled form."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import Memoised
from trackers.compiled import available
from trackers.compiled.tables import (
    ACROSS,
    ALONG,
    POSE,
    RANGE,
    RATE,
    RATE_ACROSS,
    RATE_STD,
    SENSOR,
    SIZE_ALONG,
    UNUSABLE,
    Found,
    Rows,
    Tables,
)
from trackers.estimate import Estimate
from trackers.filter import Gaussian
from trackers.geometry import dot, unit
from trackers.htg.map import HTGMap, MotionSizeState
from trackers.motion.mixture import Mixture, MotionModes
from trackers.motion.modes import Mode, Modes
from trackers.motion.rates import ScanRates
from trackers.pmht.filter import SplinePmht
from trackers.pmht.state import SplineState
from trackers.scan import Scan
from trackers.shade import NO_SHADE, Shade
from trackers.size.belief import Belief
from trackers.size.fleet import Fleet
from trackers.size.grid import Grid
from trackers.size.hits import widened
from trackers.size.likelihood import TOGETHER
from trackers.size.posterior import SizePosterior, SizeState

Place = SplineState | MotionSizeState
FLOAT, BOOL = np.dtype(float), np.dtype(bool)


class Step(NamedTuple):
    """The parts of the new state, and what is known of them."""

    parts: tuple[Mixture, Place, SizeState]
    gaussian: Gaussian  # the moments of the modes
    box: Estimate  # of place and motion
    estimate: Estimate  # with the size
    innovation: tuple[NDArray, NDArray, NDArray]  # eps (..., 2), S (..., 2, 2), lost (...)


def supported(place: Any, motion: Any, size: Any) -> bool:
    """Whether the compiled functions say the same as these parts; no part of another class does."""
    if type(place) not in (SplinePmht, HTGMap) or (type(motion), type(size)) != (MotionModes, SizePosterior):
        return False
    inner = type(motion.modes), type(motion.rates), type(size.fleet), type(size.length), type(size.width)
    return (
        inner == (Modes, ScanRates, Fleet, Grid, Grid)
        and len(motion.modes.table) > 1
        and all(type(mode) is Mode for mode in motion.modes.table)
        and (type(place) is HTGMap or (place.visibility, place.form, place.interior < 1) == ("rays", "joint", True))
        and bool(np.isinf(size.profiles.inside_depth).all() and (size.profiles.hiding[:, 0] == 0).all())
    )


class Core:
    """The compiled form of `SplinePmht` or `HTGMap`, `MotionModes` and `SizePosterior` together.

    Its methods give None for what has no compiled form: the caller goes the other way.
    """

    def __init__(self, place: Any, motion: MotionModes, size: SizePosterior) -> None:
        self.place, self.motion, self.size = place, motion, size
        self.tables = Tables.of(place, motion, size)
        self.model = Memoised(self._model)
        of_place = len(getattr(place, "sensors", ()))
        self.sheets = min(len(size.sensors), of_place or len(size.sensors))

    @classmethod
    def of(cls, place: Any, motion: Any, size: Any) -> "Core | None":
        """The core of these parts, None where they have none."""
        return cls(place, motion, size) if supported(place, motion, size) else None

    def __reduce__(self) -> tuple[Any, ...]:
        return Core.of, (self.place, self.motion, self.size)

    def predict(self, motion: Mixture, place: Place, size: SizeState, dt: float) -> Step | None:
        """The state after dt > 0 [s]."""
        which = self._which(motion, place)
        if which is None:
            return None
        from trackers.compiled.steps import predict_all

        old = rows_of(motion, size, len(which))
        x = Rows(*map(np.empty_like, old))
        K, s, found = len(self.motion.modes.table), self.size, self._found(len(which))
        kept = ((K * self.motion.stay - 1) / (K - 1)) ** (dt / self.motion.step)  # (IMM.9)
        over = (grid.transition(dt, s.offset_tau, s.lost_rate) for grid in s.grids)
        keep = float(np.exp(-dt / s.memory))
        if not predict_all(old, x, which, float(dt), kept, keep, *over, self.tables, found):
            return None
        return self._step(motion, place, size, x, found, np.zeros(len(which), int))

    def update(
        self, motion: Mixture, place: Place, size: SizeState, scan: Scan, shade: Shade | None = None
    ) -> Step | None:
        """The state after a scan, some of whose detections are under the mask; shade is what tracks (T,) hide."""
        beyond = scan.sensor.max(initial=0) >= self.sheets or scan.sensor.min(initial=0) < 0
        if beyond or scan.mask.sum(-1).max() > TOGETHER:
            return None
        start = np.zeros(motion.mu[..., 0].size + 1, int)
        np.cumsum(scan.mask.sum(-1).reshape(-1), out=start[1:])
        return self.update_rows(motion, place, size, self._detections(scan), start, shade or NO_SHADE)

    def update_rows(
        self, motion: Mixture, place: Place, size: SizeState, z: NDArray, start: NDArray, shade: Shade
    ) -> Step | None:
        """The same for detections z (G, 14), in columns as in `tables`; those of row t are start[t] to start[t + 1]."""
        before = self._which(motion, place)
        if before is None:
            return None
        from trackers.compiled.steps import update_all

        T, which = len(before), before.copy()
        x, found, state = Rows(*(a.copy() for a in rows_of(motion, size, T))), self._found(T), np.zeros(T, int)
        complete = whole(size.fully_visible, BOOL).reshape(T)
        update_all(x, which, complete, self._known(z), start, shade, self.tables, found, state)
        if (state == UNUSABLE).any():
            return None
        if (which != before).any():
            lead = motion.mu.shape[:-1]
            place = SplineState(None, None, *(a[which.reshape(lead)] for a in self.place.contours))  # type: ignore[arg-type]
        return self._step(motion, place, size, x, found, state)

    def _which(self, motion: Mixture, place: Place) -> NDArray | None:
        """The model (T,) of each contour, 0 of none; None without a track, or where a contour is another."""
        if not available() or place.m is not None or not motion.mu.size:
            return None
        return self.model(*place[2:]) if len(place) > 2 else np.zeros(motion.mu[..., 0].size, int)

    def _model(self, *contour: NDArray) -> NDArray | None:
        Q, T = len(self.place.models), int(np.prod(contour[0].shape[:-2]))
        same = np.ones((T, Q), bool)
        for a, of_models in zip(contour, self.place.contours, strict=True):
            if a.shape[-of_models.ndim + 1 :] != of_models.shape[1:]:
                return None
            same &= (a.reshape(T, 1, -1) == of_models.reshape(1, Q, -1)).all(-1)
        return same.argmax(-1) if same.any(-1).all() else None

    def _found(self, T: int) -> Found:
        return Found.of(T, self.tables.outline.shape[1])

    def _detections(self, scan: Scan) -> NDArray:
        """The detections (G, 14) under the mask; columns as in `tables`."""
        mask, z = scan.mask, np.empty((int(scan.mask.sum()), 14))
        polar, pose, velocity, noise = (
            widened(a, (*mask.shape, a.shape[-1]))[mask] for a in (scan.polar, scan.pose, scan.velocity, scan.noise)
        )
        sight = unit(polar[:, 1] + pose[:, 2])
        z[:, :2], z[:, RANGE], z[:, RATE] = sight, polar[:, 0], polar[:, 2] + dot(sight, velocity)
        z[:, POSE:SENSOR], z[:, SENSOR] = pose, widened(scan.sensor, mask.shape)[mask]
        z[:, ALONG], z[:, ACROSS], z[:, RATE_STD] = noise[:, 0], polar[:, 0] * noise[:, 1], noise[:, 2]
        z[:, RATE_ACROSS], z[:, SIZE_ALONG:] = z[:, ACROSS], z[:, ALONG:RATE_ACROSS]
        return z

    def _known(self, z: NDArray) -> NDArray:
        """The detections, in place, with the noise that each part assumes where it is not known."""
        unknown = np.isnan(z[:, ALONG:])
        if unknown.any():
            place, rates, size = self.place.sigma, self.motion.rates.sensor_std, self.size.sigma
            z[:, ALONG:] = np.where(unknown, [place, place, *rates, size, size], z[:, ALONG:])
        return z

    def _step(self, motion: Mixture, place: Place, size: SizeState, x: Rows, f: Found, state: NDArray) -> Step:
        """The new state and its estimates, with the leading axes of the old one."""
        lead, b = motion.mu.shape[:-1], x.belief

        def shaped(a: NDArray) -> NDArray:
            return a if len(lead) == 1 else a.reshape((*lead, *a.shape[1:]))

        belief = Belief(*(shaped(b[:, i]) for i in range(5)), *map(shaped, (x.of_length, x.of_width, x.kind)))
        anchor, length, width, *seen = map(shaped, x[5:11])
        new = SizeState(anchor, length, width, belief, size.fully_visible, *seen)
        yaw_rate, std = shaped(f.m[:, 4].copy()), shaped(f.std)
        outlines = iter(map(shaped, f.contour) if f.contour.size else (None, None))
        box = Estimate(shaped(f.pose[0]), shaped(f.velocity), yaw_rate, shaped(f.size[0]), shaped(f.cov[0]),
                       std[..., 2:], std[..., 0], std[..., 1], next(outlines))  # fmt: skip
        sized = Estimate(shaped(f.pose[1]), box.velocity, yaw_rate, shaped(f.size[1]), shaped(f.cov[1]),
                         shaped(f.size_std), *box[6:8], next(outlines), belief.kind.copy(),
                         shaped(f.edge_std))  # fmt: skip
        innovation = shaped(f.eps), shaped(f.S), shaped(state == 1)
        gaussian = Gaussian(shaped(f.m), shaped(f.P))
        return Step((Mixture(*map(shaped, x[:5])), place, new), gaussian, box, sized, innovation)


def rows_of(motion: Mixture, size: SizeState, T: int) -> Rows:
    """The states of T tracks, with one leading axis."""
    b, lead = size.belief, motion.mu.ndim - 1
    belief = np.concatenate(b[:5], -1).reshape(*motion.mu.shape[:-1], 5, 2)
    values = (*motion, size.anchor, size.length, size.width, size.behind, size.bent, size.aside, belief, *b[5:])
    return Rows(*(whole(a).reshape((T, *a.shape[lead:])) for a in values))


def whole(a: NDArray, kind: np.dtype = FLOAT) -> NDArray:
    """The array with this type, in one piece that may be written into: numba compiles for each layout."""
    return a if a.flags.carray and a.dtype is kind else np.array(a, kind, order="C")

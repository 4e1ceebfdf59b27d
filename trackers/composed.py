"""Composed: a filter of the place, motion modes and a size posterior as one filter of an object.

Each quantity has one owner: the place and the contour are the filter's, velocity, heading and yaw rate those of the
motion modes, length, width and class those of the size posterior, which pins its mean in the other two. One step reads
place, motion, size: `Composed.update`. Who owns what: docs/layers.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import Memoised, select
from trackers.estimate import Estimate
from trackers.filter import CONTOUR, LEARNING, SMOOTHED, Abilities, Gaussian, Note
from trackers.linalg import quadratic
from trackers.motion.mixture import ANGLES, Mixture, MotionModes, followed, resized, without_rates
from trackers.pmht.joint import notes_of
from trackers.scan import Scan, SensorModel
from trackers.shade import Shade
from trackers.size.hidden import Around
from trackers.size.posterior import Pin, SizePosterior, SizeState
from trackers.validation import definite, guarded_predict, guarded_update, unguarded

LAYERS = ("off", "ends")  # of the size


class ComposedState(NamedTuple):
    """What the parts know of each object, None where there is no such part."""

    motion: Any  # Mixture
    place: Any  # of the filter of the place; with motion its own Gaussian, the moments of the modes, is left out
    size: Any  # SizeState


class ComposedInfo(NamedTuple):
    """Information of the place filter's update, and the modes."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    nis: NDArray  # (...) normalised innovation squared, NaN without a detection
    mode: NDArray  # (..., K) probabilities of the modes
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class Composed:
    """A filter of the place with motion modes, a size posterior, or both; with motion it gets no range rates."""

    place: Any  # a Filter
    motion: Any = None  # MotionModes; None: motion is that of the filter
    size: Any = None  # SizePosterior; None: size is that of the filter
    compiled: bool = field(default=True, repr=False)  # where the extra `fast` is installed; the same to rounding

    def __post_init__(self) -> None:
        if self.motion is None and self.size is None:
            raise ValueError("Composed needs motion, size, or both; without them take the filter itself")
        if self.motion is not None and not self._can.has(*CONTOUR):
            raise ValueError(
                f"motion needs a filter of place, polar velocity and size, got {type(self.place).__name__}; "
                "take htg-map or a pmht-spline"
            )

    def on(self, sensors: Sequence[SensorModel]) -> "Composed":
        """The same with the data sheets of the sensors, by which the size reads detections."""
        place = self.place if self._can.on_sensors is None else self._can.on_sensors(sensors)
        return replace(self, place=place, size=self.size and replace(self.size, sensors=tuple(sensors)))

    @property
    def abilities(self) -> Abilities:
        """What it offers beyond the four methods: that of its parts."""
        names = ["log_spatial", "restart", "learn_where", "classes"]
        names += [] if self.motion is None else ["on_lanes"]
        sized, moving = ["reach", "update_among", "loosen", "quiet"], [*SMOOTHED, "resize", "shift"]
        names += moving if self.size is None else sized
        return Abilities(**{name: getattr(self, name) for name in names}, on_sensors=self.on)

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the motion modes."""
        return () if self.motion is None else self.motion.modes.names

    @property
    def classes(self) -> tuple[str, ...] | None:
        """Names of the classes of `Estimate.class_probability`."""
        return self._can.classes if self.size is None else self.size.fleet.names

    @property
    def angles(self) -> tuple[int, ...]:
        """Components of the Gaussian that are angles: the heading."""
        return ANGLES

    # The four methods

    def init(self, estimate: Estimate) -> ComposedState:
        """State from a prior, whose size is the first pin: the fleet is the prior of the size."""
        size = None if self.size is None else self.size.born(estimate.pose.shape[:-1])
        return self._started(self.place.init(self._prior(estimate)), size)

    @guarded_predict
    def predict(self, state: ComposedState, dt: float) -> ComposedState:
        """Time update over dt [s] >= 0; with dt = 0 nothing changes."""
        core = self.core if dt > 0 else None
        if core is not None and (found := core.predict(*state, dt)) is not None:
            return self.remembered(found)
        motion, place, size = state
        if self.motion is None:
            place = unguarded(self.place.predict)(place, dt)
        elif dt > 0:
            motion = self.motion.predicted(motion, self.place, dt)
            if self._learns:  # its past moves too
                place = unguarded(self.place.predict)(self._filled(state), dt)
            place = self._kept(motion, place)
        if self.size is not None and dt > 0:
            size = self.size.predicted(size, dt)
        return ComposedState(motion, place, size)

    @guarded_update
    def update(
        self, state: ComposedState, scan: Scan, every: Scan | None = None, owner: NDArray | None = None,
        shade: Shade | None = None,
    ) -> tuple[ComposedState, Any]:  # fmt: skip
        """Measurement update: place, then motion, then size; without a detection the state is returned as it came.

        Of tracks (T,), `every` (M,) may be the scan that their detections are from, owner (M,) the track of each, -1
        for none, and shade what tracks hide: what others hide of a track is no evidence of its size.
        """
        some = np.asarray(scan.mask.any(-1))
        core = self.core if some.any() else None
        if core is not None and (found := core.update(*state, scan, shade)) is not None:
            return self.remembered(found), informed(found, scan.mask.sum(-1))
        old, motion, size = self._filled(state), state.motion, state.size
        if self.motion is None:
            place, info = self._locate(old, scan)
            place = definite(place, old)
        else:
            place, info = self._locate(old, without_rates(scan))
            if some.any():
                motion, place, info = self._moved(motion, old, place, scan, info)
            info = ComposedInfo(info.n, info.eps, info.S, info.nis, motion.mu, getattr(info, "notes", ()))
        if not some.any():
            return state, info
        if self.size is not None:
            before, box = self.box(state).pose, self._boxed(motion, place)
            around = None if every is None or owner is None else Around(every, owner, shade)
            size, pin = self.size.corrected(size, before, box, scan, around)
            motion, place = self._pinned(motion, place, box, pin)
        if not some.all():
            motion, place = select(some, motion, state.motion), select(some, place, old)
        return ComposedState(motion, place if self._own else self._kept(motion, place), size), info

    update_among = update

    def estimate(self, state: ComposedState) -> Estimate:
        """Box, motion, contour and class."""
        box = self.box(state)
        return box if self.size is None else self._sized(state.size, box)

    def box(self, state: ComposedState) -> Estimate:
        """The estimate of place and motion alone."""
        return self._box(*state[:2])

    # What it offers beyond them, see `abilities`

    def reach(self, state: ComposedState) -> Estimate:
        """The estimate with the greatest length and width that are possible, for gates; its `size_std` is 0."""
        return self.size.reach(state.size, self.box(state))

    def log_spatial(self, state: ComposedState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        if self.size is None:
            return self._can.log_spatial(self._filled(state), scan, track, detection)
        return self.size.log_spatial(state.size, self.box(state), scan, track, detection)

    def learn_where(self, state: ComposedState, where: NDArray) -> ComposedState:
        """State whose next scan shows the complete objects where (...) is true; by default it shows all of them so."""
        if self._can.learn_where is not None:
            place = self._can.learn_where(self._filled(state), where)
            state = state._replace(place=place if self._own else self._kept(state.motion, place))
        return state if self.size is None else state._replace(size=state.size._replace(fully_visible=where))

    def on_lanes(self, state: ComposedState, curvature: NDArray) -> ComposedState:
        """State of objects whose lanes bend so, curvature (...) [1/m], positive to the left."""
        return state._replace(motion=state.motion._replace(curvature=curvature))

    def loosen(self, state: ComposedState, where: NDArray) -> ComposedState:
        """State of which the near end of the objects where (...) is true may lie elsewhere: others hide it."""
        return state._replace(size=self.size.loosened(state.size, where))

    def quiet(self, state: ComposedState, rows: NDArray, length: NDArray, log_p: NDArray) -> ComposedState:
        """State after what is so improbable, log_p (R, C), if rows (R,) have length (R, C) [m], such as silence."""
        return state._replace(size=self.size.quieted(state.size, rows, length, log_p))

    def restart(self, state: ComposedState, estimate: Estimate) -> ComposedState:
        """State that starts again from an estimate, as of the union of two tracks or of a part; the width stays."""
        size = None if self.size is None else self.size.restarted(state.size, estimate.size, estimate.size_std)
        return self._started(self._restarted(self._filled(state), estimate), size)

    def gaussian(self, state: ComposedState) -> Gaussian:
        """The moments of all modes together."""
        return self._can.gaussian(self._filled(state))

    def with_gaussian(self, state: ComposedState, gaussian: Gaussian) -> ComposedState:
        """The state with another mean and covariance, the same in every mode."""
        K = len(self.modes)
        m, P = np.stack([gaussian.m] * K, -2), np.stack([gaussian.P] * K, -3)
        return state._replace(
            motion=state.motion._replace(m=m, P=P), place=self._can.with_gaussian(state.place, gaussian)
        )

    def resize(self, state: ComposedState, size: NDArray, size_std: NDArray) -> ComposedState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m], in every mode."""
        motion, place = self._resized(state.motion, self._filled(state), size, size_std)
        return ComposedState(motion, self._kept(motion, place), None)

    def shift(self, state: ComposedState, d: NDArray) -> ComposedState:
        """State with d (..., 2) [m], in the world, added to the centre in every mode."""
        motion = self.motion.shifted(state.motion, d)
        return ComposedState(motion, self._kept(motion, self._can.shift(self._filled(state), d)), None)

    # The parts together

    def _moved(self, x: Mixture, old: Any, found: Any, scan: Scan, info: Any) -> tuple[Mixture, Any, Any]:
        """Modes, place and information after the scan.

        `old` is the place before it, `found` the one after it; of a filter that learns, which does so here, its
        Gaussian.
        """
        place, after = (old, found) if self._learns else (definite(found, old), None)
        before, after = self._can.gaussian(old), after or self._can.gaussian(place)
        motion, g, turned = self.motion.forward(self.motion.corrected(x, before, after, self.place, scan))
        if not self._learns:
            place = self._can.with_gaussian(place, g)
        else:
            place, info = self._can.learned(place, g, without_rates(scan), info)
            after = self._can.gaussian(place)
            motion = followed(motion, g, after)
            if turned.any():
                fresh = self._can.restart(place, self.place.estimate(place))  # what it saw was turned round
                place = select(turned, self._can.with_gaussian(fresh, after), place)
        some = np.asarray(scan.mask.any(-1))
        if not some.all():
            motion, place = select(some, motion, x), select(some, place, old)
        return definite(motion, x), definite(place, old), info

    def _pinned(self, motion: Any, place: Any, box: Estimate, pin: Pin) -> tuple[Any, Any]:
        """Modes and place with the size and the shift of a pin."""
        if not self._can.has("resize", "shift"):
            pose = np.concatenate([box.pose[..., :2] + pin.shift, box.pose[..., 2:]], -1)
            return motion, self._restarted(place, box._replace(pose=pose, size=pin.size))
        motion, place = self._resized(motion, place, pin.size, pin.std)
        motion = None if self.motion is None else self.motion.shifted(motion, pin.shift)
        return motion, self._can.shift(place, pin.shift)

    def _resized(self, motion: Any, place: Any, size: NDArray, std: NDArray) -> tuple[Any, Any]:
        new = self._can.resize(place, size, std)
        if self.motion is not None:
            motion = resized(motion, self._can.gaussian(place), self._can.gaussian(new))
        return motion, new

    def _started(self, place: Any, size: SizeState | None) -> ComposedState:
        """The state over that of the place, with the modes as at birth."""
        if self.motion is None:
            return ComposedState(None, place, size)
        motion = self.motion.born(self._can.gaussian(place))
        return ComposedState(motion, self._kept(motion, place), size)

    def _restarted(self, place: Any, estimate: Estimate) -> Any:
        """The place started again from an estimate."""
        pinned = self._prior(estimate)
        return self.place.init(pinned) if self._can.restart is None else self._can.restart(place, pinned)

    def _prior(self, estimate: Estimate) -> Estimate:
        """The estimate that the place starts from."""
        return estimate if self.size is None else self.size.pinned(estimate)

    def _kept(self, motion: Any, place: Any) -> Any:
        """The place as states keep it: without its Gaussian, which is that of the modes, if it is in fields m and P."""
        if self.motion is None:
            return place
        g = self._can.gaussian(place)
        if not self._own and getattr(place, "m", None) is g.m and getattr(place, "P", None) is g.P:
            return place._replace(m=None, P=None)
        return self._can.with_gaussian(place, self._moments(motion))

    def _filled(self, state: ComposedState) -> Any:
        """The place with its Gaussian."""
        if self.motion is None or self._can.gaussian(state.place).m is not None:
            return state.place
        return self._can.with_gaussian(state.place, self._moments(state.motion))

    def _boxed(self, motion: Any, place: Any) -> Estimate:
        """The estimate of place and motion."""
        place = self._filled(ComposedState(motion, place, None))
        box = self.place.estimate(place)
        return box if self.motion is None else self.motion.estimate(box, self._can.gaussian(place), motion.mu)

    @cached_property
    def _box(self) -> Memoised[[Any, Any], Estimate]:
        """`_boxed` of a state."""
        return Memoised(self._boxed)

    def remembered(self, found: Any) -> ComposedState:
        """The state of a compiled step, whose estimates are known."""
        motion, place, size = found.parts
        self._moments.keep((motion,), found.gaussian)
        self._box.keep((motion, place), found.box)
        self._sized.keep((size, found.box), found.estimate)
        return ComposedState(motion, place, size)

    @cached_property
    def core(self) -> Any:
        """The compiled form of predict and update; None where it is refused, or parts are others than it has."""
        from trackers.compiled.core import Core

        return Core.of(self.place, self.motion, self.size) if self.compiled else None

    @cached_property
    def _sized(self) -> Memoised[[Any, Any], Estimate]:
        """The estimate of a size and a box."""
        return Memoised(self.size.estimate)

    @cached_property
    def _moments(self) -> Memoised[[Any], Gaussian]:
        """The Gaussian of the modes."""
        return Memoised(Mixture.gaussian)

    @cached_property
    def _can(self) -> Any:
        """The abilities of the place."""
        return Abilities.of(self.place)

    @cached_property
    def _learns(self) -> bool:
        """Whether the place learns from moments that the modes may replace."""
        return self.motion is not None and self._can.has(*LEARNING)

    @cached_property
    def _own(self) -> bool:
        """Whether the place may have another Gaussian than the modes: learning moves it, and no pin puts it back."""
        return self.motion is None or (self._learns and self.size is None)

    @cached_property
    def _locate(self) -> Any:
        """The update of the place, without validation; of one that learns, its spatial part."""
        return self._can.located if self._learns else unguarded(self.place.update)


def informed(found: Any, n: NDArray) -> ComposedInfo:
    """The information of a compiled step with n (...) detections."""
    eps, S, lost = found.innovation
    nis = np.where(n > 0, quadratic(eps, S), np.nan)
    return ComposedInfo(n, eps, S, nis, found.parts[0].mu, notes_of(lost))


def place_of(filter: Any) -> Any:
    """The filter of the place: that of a composed filter, or else the filter itself."""
    return filter.place if isinstance(filter, Composed) else filter


def composed(filter: Any, size: str = "off", motion: bool = False, compiled: bool = True) -> Any:
    """A filter with a size posterior (size="ends"), motion modes (motion=True), both or neither, around it.

    compiled=False refuses the compiled form of the whole.
    """
    if size not in LAYERS:
        raise ValueError(f"size must be one of {', '.join(LAYERS)}, got {size!r}")
    if size == "off" and not motion:
        return filter
    ends = SizePosterior(once=any(Abilities.of(filter).position_std or ())) if size == "ends" else None
    return Composed(filter, MotionModes() if motion else None, ends, compiled)

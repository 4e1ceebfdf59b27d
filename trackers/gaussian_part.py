"""Where each kind of filter state keeps its Gaussian, so that what is true of Gaussians is written once.

A state that is new here needs no entry as long as it has fields m (..., n) and P (..., n, n); where components of m are
angles that may be wrapped, its filter is `Angular`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.state import DataRegionState
from trackers.geometry import wrap_angle
from trackers.htg.map import MotionSizeState
from trackers.htg.online import OnlineState
from trackers.imm import moments
from trackers.motion import PHI
from trackers.protocols import Angular
from trackers.random_matrix.feldmann import RMState
from trackers.random_matrix.koch import Koch, KochState, course
from trackers.random_matrix.virtual_measurements import ContourState


class Gaussian(NamedTuple):
    """N(m, P); Koch's state is two, independent of each other: one for each coordinate."""

    m: NDArray  # (..., n)
    P: NDArray  # (..., n, n)


class Extent(NamedTuple):
    """Inverse Wishart density whose mean is V / (nu - least)."""

    nu: NDArray  # (...)
    V: NDArray  # (..., 2, 2) [m^2]


@dataclass(frozen=True)
class Part:
    """How to read the Gaussian of a state, and how to put another in its place."""

    read: Callable[[Any], Gaussian]
    write: Callable[[Any, Gaussian], Any]
    angles: tuple[int, ...] = ()  # components [rad] of m that may be wrapped
    mixture: bool = False  # the Gaussian has the moments of several models'
    extent: Callable[[Any], Extent] | None = None  # of random matrices
    write_extent: Callable[[Any, Extent], Any] | None = None
    least: float = 0.0  # degrees of freedom at which nothing is known of the extent
    turns: bool = False  # the extent turns with the heading, component PHI


def part_of(filter: Any, state: Any) -> Part:
    """The entry for a state of that filter.

    Raises:
        TypeError: the state holds no Gaussian.

    """
    if type(state) in PARTS:
        return PARTS[type(state)]
    if isinstance(state, DataRegionState):
        return ONE_MODEL if state.mu.shape[-1] == 1 else MIXTURE
    if has_gaussian(state):
        return replace(PLAIN, angles=filter.angles) if isinstance(filter, Angular) else PLAIN
    raise TypeError(
        f"states of {type(filter).__name__} must hold a Gaussian m (..., n), P (..., n, n) to be smoothed, "
        f"got a {type(state).__name__}; give it these two fields"
    )


def has_gaussian(state: Any) -> bool:
    """Whether `part_of` knows the state."""
    if type(state) in PARTS or isinstance(state, DataRegionState):
        return True
    m, P = getattr(state, "m", None), getattr(state, "P", None)
    return isinstance(m, np.ndarray) and isinstance(P, np.ndarray) and P.shape == (*m.shape, *m.shape[-1:])


def _koch(state: KochState) -> Gaussian:
    """One Gaussian (..., 2, 3) of position, velocity, acceleration a coordinate, in units of the extent."""
    m = state.x.reshape(*state.x.shape[:-1], 3, 2).mT
    return Gaussian(m, np.broadcast_to(state.P[..., None, :, :], (*m.shape, 3)))


def _with_koch(state: KochState, g: Gaussian) -> KochState:
    """The heading is that of the velocity, and held at standstill, as in the filter."""
    x = g.m.mT.reshape(*g.m.shape[:-2], 6)
    moves = np.hypot(x[..., 2], x[..., 3]) > Koch.least_speed
    return state._replace(x=x, P=g.P[..., 0, :, :], heading=np.where(moves, course(x), state.heading))


def _with_contour(state: ContourState, g: Gaussian) -> ContourState:
    """The contour goes where the filter goes, as in its prediction."""
    koch = _with_koch(state.koch, g)
    turn = wrap_angle(koch.heading - state.koch.heading)
    shift = koch.x[..., :2] - state.koch.x[..., :2]
    return state._replace(koch=koch, centre=state.centre + shift, tilt=state.tilt + turn)


def _mixture(state: DataRegionState) -> Gaussian:
    return Gaussian(*moments(state.m, state.P, state.mu))


def _with_mixture(state: DataRegionState, g: Gaussian) -> DataRegionState:
    m = np.broadcast_to(g.m[..., None, :], state.m.shape)
    return state._replace(m=m, P=np.broadcast_to(g.P[..., None, :, :], state.P.shape))


PLAIN = Part(lambda s: Gaussian(s.m, s.P), lambda s, g: s._replace(m=g.m, P=g.P))
MIXTURE = Part(_mixture, _with_mixture, mixture=True)
ONE_MODEL = Part(
    lambda s: Gaussian(s.m[..., 0, :], s.P[..., 0, :, :]),
    lambda s, g: s._replace(m=g.m[..., None, :], P=g.P[..., None, :, :]),
)
PARTS: Mapping[type, Part] = MappingProxyType(
    {
        MotionSizeState: Part(PLAIN.read, PLAIN.write, (PHI,)),
        RMState: Part(
            PLAIN.read,
            PLAIN.write,
            (PHI,),
            extent=lambda s: Extent(s.nu, s.V),
            write_extent=lambda s, e: s._replace(nu=e.nu, V=e.V),
            least=6.0,
            turns=True,
        ),
        OnlineState: Part(
            lambda s: Gaussian(s.rm.m, s.rm.P),
            lambda s, g: s._replace(rm=s.rm._replace(m=g.m, P=g.P)),
            (PHI,),
            extent=lambda s: Extent(s.rm.nu, s.rm.V),
            write_extent=lambda s, e: s._replace(rm=s.rm._replace(nu=e.nu, V=e.V)),
            least=6.0,
            turns=True,
        ),
        KochState: Part(
            _koch,
            _with_koch,
            extent=lambda s: Extent(s.nu, s.X),
            write_extent=lambda s, e: s._replace(nu=e.nu, X=e.V),
            least=3.0,
        ),
        ContourState: Part(lambda s: _koch(s.koch), _with_contour),
    }
)

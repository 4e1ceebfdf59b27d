"""The four methods of a single-object filter, and one record of what it may offer beyond them."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.linalg import quadratic
from trackers.scan import Scan


class Note(NamedTuple):
    """An event of a filter for some of its objects, to be logged: `notes` of its update information."""

    kind: str  # one word
    reason: str  # one readable clause
    where: NDArray  # (...) bool
    contours: NDArray | None = None  # (..., 2, C, 2) [m] outlines on the body's axes, before and after a change


class UpdateInfo(NamedTuple):
    """The information of every update: the innovation of the centroid."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    notes: tuple[Note, ...] = ()

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        return np.where(self.n > 0, quadratic(self.eps, self.S), np.nan)  # (MET.13)


class Filter(Protocol):
    """A single-object filter; every state is a NamedTuple of arrays with any leading axes."""

    def init(self, estimate: Estimate) -> Any:
        """State from a prior."""

    def predict(self, state: Any, dt: float) -> Any:
        """Time update over dt [s]."""

    def update(self, state: Any, scan: Scan) -> tuple[Any, Any]:
        """Measurement update; without a detection the state is returned as it came."""

    def estimate(self, state: Any) -> Estimate:
        """Estimate of the object from the state."""


class Gaussian(NamedTuple):
    """N(m, P)."""

    m: NDArray  # (..., n)
    P: NDArray  # (..., n, n)


class Extent(NamedTuple):
    """Inverse Wishart density of an extent, its mean V / (nu - least)."""

    nu: NDArray  # (...)
    V: NDArray  # (..., 2, 2) [m^2]
    heading: NDArray  # (...) [rad] angle that the extent turns with; 0 where it does not turn
    least: float  # degrees of freedom at which nothing is known


Method = Callable[..., Any] | None


class Abilities(NamedTuple):
    """What a filter offers beyond the four methods, None for what it does not: its attributes of these names.

    In states and arrays the leading axes (...) are those of the objects, (T,) that of the tracks.
    """

    # Association and gates
    log_spatial: Method = None  # (state, scan, track (G,), detection (G,)): log density (G,) [1/m^2] of these pairs
    reach: Method = None  # (state): the estimate with the greatest box that is possible, its size_std 0
    update_among: Method = None  # (state, scan, every (M,), owner (M,), with `as_whole` a `Shade`): update among others
    learn_where: Method = None  # (state, where (...)): state whose next scan shows these objects completely
    quiet: Method = None  # (state, rows (R,), length (R, C) [m], log_p (R, C)): state after what is so improbable
    on_lanes: Method = None  # (state, curvature (...) [1/m]): state of objects whose lanes bend so
    loosen: Method = None  # (state, where (...)): state of which the near end of these objects may lie elsewhere

    # Another place or size, everything else kept, and a new start
    resize: Method = None  # (state, size (..., 2), size_std (..., 2)) [m]: state
    shift: Method = None  # (state, d (..., 2) [m] in the world): state, moved in all of its models and in its past
    restart: Method = None  # (state, estimate): state that keeps what an estimate does not hold

    # A Gaussian that the smoother can read and replace; of several models the moments of their mixture
    gaussian: Method = None  # (state): `Gaussian`
    with_gaussian: Method = None  # (state, gaussian): state, in all models
    angles: tuple[int, ...] | None = None  # components of m that are angles [rad] and may be wrapped
    extent: Method = None  # (state): `Extent` beside the Gaussian
    with_extent: Method = None  # (state, extent): state
    mixed: Method = None  # (state, dt): probabilities (..., K), and of each model its filter and state; None for one

    # Allowances in the covariance of its estimates
    position_std: tuple[float, float] | None = None  # shares of length and width, for outlines that it does not know

    # If that is of x = [px, py, phi, v, omega, s1, s2] as in `trackers.motion.turn`
    log_size: bool | None = None  # whether s1 and s2 are the logarithms of length and width
    size_walk: float | None = None  # random walk of s1 and s2, in their unit / sqrt(s)

    # An update in two parts, between which the Gaussian may be replaced
    located: Method = None  # (state, scan): Gaussian after the scan, and information
    learned: Method = None  # (state, gaussian, scan, info): state that has learned, and information

    # Classes, whose probabilities are `Estimate.class_probability`
    classes: tuple[str, ...] | None = None  # names
    class_size: Method = None  # (state): mean size (..., 2) [m] of the classes, std (..., 2) of its logarithms, NaN

    on_sensors: Method = None  # (sensors): the filter with the data sheets of these sensors

    @classmethod
    def of(cls, filter: Any) -> "Abilities":
        """Those of a filter: its own record `abilities`, or what it has under the names of the fields."""
        own = getattr(filter, "abilities", None)
        return own if isinstance(own, cls) else cls(*(getattr(filter, name, None) for name in cls._fields))

    def has(self, *names: str) -> bool:
        """Whether the filter offers all of these."""
        return all(getattr(self, name) is not None for name in names)


SMOOTHED = ("angles", "gaussian", "with_gaussian")  # what the smoother needs
CONTOUR = (*SMOOTHED, "log_size", "size_walk", "resize", "shift", "log_spatial")  # what motion modes need
LEARNING = ("located", "learned", "restart")  # of a filter that motion modes may take the Gaussian out of

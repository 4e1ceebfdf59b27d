"""The protocol of a single-object filter, four methods, and those of what it may offer beyond them."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
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
        d = np.linalg.solve(self.S, self.eps[..., None])[..., 0]
        return np.where(self.n > 0, (self.eps * d).sum(-1), np.nan)  # (MET.13)


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


@runtime_checkable
class Resizable(Protocol):
    """A filter whose size can be replaced, everything else kept."""

    def resize(self, state: Any, size: NDArray, size_std: NDArray) -> Any:
        """State with size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""


@runtime_checkable
class Shiftable(Protocol):
    """A filter whose objects can be moved, everything else kept."""

    def shift(self, state: Any, d: NDArray) -> Any:
        """State with d (..., 2) [m], in the world, added to the centre, in all of its models and in its past."""


@runtime_checkable
class Attentive(Protocol):
    """A filter that needs to know which scans show an object completely."""

    def learn_where(self, state: Any, where: NDArray) -> Any:
        """State whose next update is by a scan that shows the objects where (...) is true completely."""


@runtime_checkable
class Restartable(Protocol):
    """A filter whose state holds more of an object than an estimate does, such as a learned contour."""

    def restart(self, state: Any, estimate: Estimate) -> Any:
        """State that starts again from an estimate, keeping what an estimate does not hold."""


@runtime_checkable
class Classifying(Protocol):
    """A filter that compares its objects with classes; their probabilities are `Estimate.class_probability`."""

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes."""

    def learn_where(self, state: Any, where: NDArray) -> Any:
        """State whose next update learns of the objects where (...) is true, those that the scan shows completely."""

    def class_size(self, state: Any) -> tuple[NDArray, NDArray]:
        """Mean size (..., 2) [m] of the objects' classes and std (..., 2) of its logarithms; NaN where not known."""


@runtime_checkable
class Reaching(Protocol):
    """A filter whose sizes have wider tails than a Gaussian of their standard deviation."""

    def reach(self, state: Any) -> Estimate:
        """The estimate with the greatest box that is possible, for gates; its `size_std` is 0."""


@runtime_checkable
class Surveying(Protocol):
    """A filter that uses what other detections of a scan hide of its objects."""

    def update_among(self, state: Any, scan: Scan, every: Scan, owner: NDArray) -> tuple[Any, Any]:
        """Update of objects (T,) by `scan`, given the scan `every` (M,) and the rows owner (M,) of its detections."""


@runtime_checkable
class SpatialModel(Protocol):
    """A filter with its own density of detections over the body."""

    def log_spatial(self, state: Any, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""


class Gaussian(NamedTuple):
    """N(m, P)."""

    m: NDArray  # (..., n)
    P: NDArray  # (..., n, n)


@runtime_checkable
class Smoothable(Protocol):
    """A filter whose state holds a Gaussian that the smoother can read and replace."""

    @property
    def angles(self) -> tuple[int, ...]:
        """Components of m that are angles [rad] and may be wrapped."""

    def gaussian(self, state: Any) -> Gaussian:
        """The Gaussian of the state; of several models, the moments of their mixture."""

    def with_gaussian(self, state: Any, gaussian: Gaussian) -> Any:
        """The state with another Gaussian, in all of its models."""


@runtime_checkable
class ContourFilter(Filter, Smoothable, Resizable, Shiftable, SpatialModel, Protocol):
    """A filter that `trackers.motion` can take over the motion of.

    Its Gaussian is of x = [px, py, phi, v, omega, s1, s2] as in `trackers.motion`, s1 and s2 length and width or their
    logarithms.
    """

    @property
    def log_size(self) -> bool:
        """Whether s1 and s2 are logarithms."""

    @property
    def size_walk(self) -> float:
        """Random walk of s1 and s2, in their unit / sqrt(s)."""


@runtime_checkable
class Learning(ContourFilter, Restartable, Protocol):
    """A `ContourFilter` whose update is a spatial one, and then learning from the moments that a caller may replace."""

    def located(self, state: Any, scan: Scan) -> tuple[Gaussian, Any]:
        """The Gaussian after the scan, and information; the state is as it was."""

    def learned(self, state: Any, gaussian: Gaussian, scan: Scan, info: Any) -> tuple[Any, Any]:
        """State with the Gaussian after the scan, which it learns from, and information; learning may move both."""


class Extent(NamedTuple):
    """Inverse Wishart density of an extent, its mean V / (nu - least)."""

    nu: NDArray  # (...)
    V: NDArray  # (..., 2, 2) [m^2]
    heading: NDArray  # (...) [rad] angle that the extent turns with; 0 where it does not turn
    least: float  # degrees of freedom at which nothing is known


@runtime_checkable
class SmoothableExtent(Protocol):
    """A `Smoothable` filter with an extent beside its Gaussian, which the smoother can replace too."""

    def extent(self, state: Any) -> Extent:
        """The density of the extent."""

    def with_extent(self, state: Any, extent: Extent) -> Any:
        """The state with another density of its extent."""


@runtime_checkable
class Interacting(Protocol):
    """A `Smoothable` filter of several models, whose prediction begins with mixing them."""

    def mixed(self, state: Any, dt: float) -> tuple[NDArray, list[tuple[Smoothable, Any]]] | None:
        """Probabilities (..., K) of the models after dt [s], and of each its filter and the state it starts from.

        None where the filter has one model.
        """

"""What a single-object filter is: four verbs, and more that it may offer to the multi-object tracker."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.scan import Scan


class UpdateInfo(NamedTuple):
    """What every update tells: the innovation of the centroid."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        d = np.linalg.solve(self.S, self.eps[..., None])[..., 0]
        return np.where(self.n > 0, (self.eps * d).sum(-1), np.nan)


class Note(NamedTuple):
    """What a filter did with some of its objects that a reader of the run wants to know: `notes` of its information."""

    kind: str  # one word
    reason: str  # one readable clause
    where: NDArray  # (...) bool
    contours: NDArray | None = None  # (..., 2, C, 2) [m] outlines on the body's axes, before and after a change


class Filter(Protocol):
    """A single-object filter; every state is a NamedTuple of arrays with any leading axes."""

    def init(self, estimate: Estimate) -> Any:
        """State from a prior."""

    def predict(self, state: Any, dt: float) -> Any:
        """Time update over dt [s]."""

    def update(self, state: Any, scan: Scan) -> tuple[Any, Any]:
        """Measurement update; without a detection the state is returned as it came."""

    def estimate(self, state: Any) -> Estimate:
        """What the state says about the object."""


@runtime_checkable
class Resizable(Protocol):
    """A filter that takes another belief about the size and keeps everything else."""

    def resize(self, state: Any, size: NDArray, size_std: NDArray) -> Any:
        """State with size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""


@runtime_checkable
class Restartable(Protocol):
    """A filter that knows more of an object than an estimate says, such as a learned contour."""

    def restart(self, state: Any, estimate: Estimate) -> Any:
        """State that starts again from an estimate but keeps what an estimate does not say."""


@runtime_checkable
class Classifying(Protocol):
    """A filter that compares its objects with classes; their probabilities are `Estimate.class_probability`."""

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes."""

    def attend(self, state: Any, where: NDArray) -> Any:
        """State that takes the next update as a look at whole objects where (...) is true, and learns of no others."""

    def usual_size(self, state: Any) -> tuple[NDArray, NDArray]:
        """Size (..., 2) [m] that is usual for the classes and std (..., 2) of its logarithms; NaN while unknown."""


@runtime_checkable
class SpatialModel(Protocol):
    """A filter with its own density of detections over the body."""

    def log_spatial(self, state: Any, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""


@runtime_checkable
class Angular(Protocol):
    """A filter that names the angles of its state, for the smoother; its state has fields m (..., n), P (..., n, n)."""

    @property
    def angles(self) -> tuple[int, ...]:
        """Components of m that are angles [rad] and may be wrapped."""

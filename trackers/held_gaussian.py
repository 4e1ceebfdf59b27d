"""Methods of filters whose states hold N(m, P) in fields m and P, the centre first; classes assign them as theirs."""

from typing import Any

from numpy.typing import NDArray

from trackers.filter import Gaussian


def gaussian(self: Any, state: Any) -> Gaussian:
    """Mean and covariance of the state."""
    return Gaussian(state.m, state.P)


def with_gaussian(self: Any, state: Any, gaussian: Gaussian) -> Any:
    """The state with another mean and covariance."""
    return state._replace(m=gaussian.m, P=gaussian.P)


def shift(self: Any, state: Any, d: NDArray) -> Any:
    """State with d (..., 2) [m] added to the centre."""
    m = state.m.copy()
    m[..., :2] += d
    return state._replace(m=m)

"""State of `pmht-spline-adaptive`."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.pmht.learning import SplineContour
from trackers.pmht.pool import Pool
from trackers.pmht.state import SplineState
from trackers.pmht.window import Window, cleared


class AdaptiveState(NamedTuple):
    """The state of `SplinePmht`, and what class and contour are learned from."""

    m: NDArray  # (..., 7) px, py [m], phi [rad] unwrapped, v [m/s], omega [rad/s], l, w [m]
    P: NDArray  # (..., 7, 7)
    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)
    visible: NDArray  # (..., A, L)
    kind: NDArray  # (...) int, row of the contour in `Learner.offline` that the object started from
    cross: NDArray  # (..., 7, 7) cross covariance of the last scan in the window and now, (SM.9)
    window: Window
    pool: Pool
    draft: SplineContour  # the contour that is being learned
    stage: NDArray  # (...) int, of learning, see `Learner`
    fresh: NDArray  # (...) int, detections that came into the pool since a contour was learned
    probability: NDArray  # (..., C) of the classes
    complete: NDArray  # (...) bool, the next scan shows the complete object; from parts nothing is learned


def plain(state: AdaptiveState) -> SplineState:
    """The state of `SplinePmht` in it."""
    return SplineState(*state[:5])


def forgotten(state: AdaptiveState, where: NDArray) -> AdaptiveState:
    """The state with nothing to learn from where (...) is true."""
    keep = ~where
    return state._replace(
        window=cleared(state.window, where),
        pool=state.pool._replace(came=state.pool.came * keep[..., None]),
        stage=state.stage * keep,
        fresh=state.fresh * keep,
    )


def index(rows: NDArray, lead: tuple[int, ...]) -> Any:
    """Index of flat rows (A,) into arrays with leading axes; without leading axes the one object gets an axis."""
    return np.unravel_index(rows, lead) if lead else (None,)

"""What `pmht-spline-adaptive` carries from look to look."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.pmht.learning import Contour
from trackers.pmht.pool import Pool
from trackers.pmht.state import SplineState
from trackers.pmht.window import Window, cleared


class AdaptiveState(NamedTuple):
    """What `SplinePmht` carries, and what a contour is learned from."""

    m: NDArray  # (..., 7) px, py [m], phi [rad] unwrapped, v [m/s], omega [rad/s], l, w [m]
    P: NDArray  # (..., 7, 7)
    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)
    sight: NDArray  # (..., A, L)
    kind: NDArray  # (...) int, of the contours of `Learner.offline`: the one that it started from
    cross: NDArray  # (..., 7, 7) cross covariance D (11) of the last look in the window and now
    window: Window
    pool: Pool
    draft: Contour  # what is being learned
    stage: NDArray  # (...) int, of learning, see `Learner`
    fresh: NDArray  # (...) int, detections that came into the pool since a contour was learned
    probability: NDArray  # (..., C) of the classes
    whole: NDArray  # (...) bool, whether the next look is at the whole object; from parts nothing is learned


def plain(state: AdaptiveState) -> SplineState:
    """The part that `SplinePmht` knows."""
    return SplineState(*state[:5])


def forgotten(state: AdaptiveState, where: NDArray) -> AdaptiveState:
    """The state without what it would learn from, where (...) is true."""
    keep = ~where
    return state._replace(
        window=cleared(state.window, where),
        pool=state.pool._replace(came=state.pool.came * keep[..., None]),
        stage=state.stage * keep,
        fresh=state.fresh * keep,
    )


def index(rows: NDArray, lead: tuple[int, ...]) -> Any:
    """Index of flat rows (A,) of leading axes; an object alone is a row too."""
    return np.unravel_index(rows, lead) if lead else (None,)

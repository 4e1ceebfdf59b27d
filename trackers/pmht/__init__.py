"""Ellipses on a B-spline, probabilistic multi-hypothesis association, unscented filter; after Yao et al. (2021)."""

from trackers.pmht.adaptive import AdaptiveSpline
from trackers.pmht.filter import SplineInfo, SplinePmht
from trackers.pmht.learner import Learner
from trackers.pmht.model import SplineModel
from trackers.pmht.state import SplineState, Walk

__all__ = ["AdaptiveSpline", "Learner", "SplineInfo", "SplineModel", "SplinePmht", "SplineState", "Walk"]

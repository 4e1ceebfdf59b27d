"""Motion modes that share the spatial update of a contour filter, read range rates and know where a body turns about.

In: the detections of each object. Out: velocity, heading and yaw rate. Equations: docs/methods/motion-modes.md.
Imports numpy, scipy and `trackers` only.
"""

from trackers.motion.layer import SharedMotion, SharedMotionInfo, SharedMotionState
from trackers.motion.modes import FIVE, Mode, Modes
from trackers.motion.rates import ScanRates

__all__ = ["FIVE", "Mode", "Modes", "ScanRates", "SharedMotion", "SharedMotionInfo", "SharedMotionState"]

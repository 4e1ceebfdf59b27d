"""Size of each object from both of its ends: a grid Bayes filter of length and width around any single-object filter.

In: the detections of each object and where its filter has it. Out: size, its uncertainty, class, and the centre that
goes with them. Equations: docs/methods/size-from-both-ends.md. Imports numpy, scipy and `trackers` only.
"""

from trackers.size.ends import Ends, EndsState
from trackers.size.fleet import FLEET, Fleet, VehicleClass

__all__ = ["FLEET", "Ends", "EndsState", "Fleet", "VehicleClass"]

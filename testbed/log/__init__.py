"""The review log: a rerun file of everything that happened in a run, its layout in the viewer, and its reader.

In: a `Frame` and its scores for every scan, the road, the radars. Out: a .rrd file, and what `reader` reads from it.
May import rerun, which no other package does, and `testbed.frame`; rerun is loaded when a log is opened.
"""

from testbed.log.record import RoadGeometry, RunMeta
from testbed.log.writer import RunLog

__all__ = ["RoadGeometry", "RunLog", "RunMeta"]

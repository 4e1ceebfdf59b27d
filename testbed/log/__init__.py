"""The review log: rerun lives here and nowhere else, and is imported when a log is opened."""

from testbed.log.record import RoadGeometry, RunMeta
from testbed.log.writer import NullLog, RunLog

__all__ = ["NullLog", "RoadGeometry", "RunLog", "RunMeta"]

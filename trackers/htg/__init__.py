"""Hierarchical truncated Gaussian trackers: density, tables, and the filters over them.

Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from trackers.htg.bins import HTGTable, load, metric_ends
from trackers.htg.density import HTG
from trackers.htg.learned import HTGLearned
from trackers.htg.map import HTGMap
from trackers.htg.moment import HTGMoment
from trackers.htg.online import HTGOnline

__all__ = ["HTG", "HTGLearned", "HTGMap", "HTGMoment", "HTGOnline", "HTGTable", "load", "metric_ends"]

"""Planners: what chooses the ego's actions.

In: a highway-env environment whose road holds ego and tracks. Out: an action, and a planned path for the log. May
import highway-env and scenarios; no tracker, no truth.
"""

from testbed.planners.registry import PLANNERS, Planner, begin, find, settings

__all__ = ["PLANNERS", "Planner", "begin", "find", "settings"]

"""Planners: what chooses the ego's actions.

In: a highway-env environment whose road holds ego and tracks. Out: an action, and a planned path for the log. May
import highway-env and scenarios; no tracker, no truth. What is named here is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbed.planners.registry import OF_FILES, PLANNERS, Planner, begin, find, settings

__all__ = ["OF_FILES", "PLANNERS", "Planner", "begin", "find", "settings"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'testbed.planners' has no attribute {name!r}")
    return getattr(import_module("testbed.planners.registry"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

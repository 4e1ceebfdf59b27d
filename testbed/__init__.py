"""Closed-loop highway simulation testbed for extended object tracking with automotive radar.

Importing this package registers the gymnasium ids `testbed/NAME-v0`, one for every scenario. It stays light:
highway-env, rerun and what needs them are loaded when they are first used.
"""

from importlib import import_module, metadata, util
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbed.environment.wrapper import TrackedEnv as TrackedEnv
    from testbed.planners import PLANNERS as PLANNERS
    from testbed.planners import Planner as Planner

    __version__: str

_HOME = {
    "TrackedEnv": "testbed.environment.wrapper",
    "PLANNERS": "testbed.planners",
    "Planner": "testbed.planners",
}

__all__ = ["PLANNERS", "Planner", "TrackedEnv", "__version__"]


def _check_neighbours() -> None:
    """Raise ImportError unless this project's own `trackers`, `sensors` and `scenarios` lie beside this package."""
    home = Path(__file__).resolve().parent.parent
    for name in ("trackers", "sensors", "scenarios"):
        spec = util.find_spec(name)
        found = Path(spec.origin).resolve().parent if spec is not None and spec.origin else None
        if found != home / name:
            raise ImportError(
                f"testbed needs its own package {name!r} at {home / name}, but Python finds {found or 'none'}; "
                f"uninstall the other distribution that brings {name!r}, or put {home} first on the path"
            )


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return metadata.version("eot-testbed")
    if name not in _HOME:
        raise AttributeError(f"module 'testbed' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_check_neighbours()

from testbed.environment.registration import register_scenarios  # noqa: E402  (the neighbours come first)

register_scenarios()

"""Closed-loop highway simulation testbed for extended object tracking with automotive radar.

Importing this package registers the gymnasium ids `testbed/NAME-v0`, one for every scenario. It stays light:
highway-env, rerun and what needs them are loaded when they are first used.
"""

from importlib import import_module, metadata, util
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbed.environment.track_observation import TrackObservation as TrackObservation
    from testbed.environment.wrapper import TrackedEnv as TrackedEnv
    from testbed.evaluation.metric import METRICS as METRICS
    from testbed.planners import PLANNERS as PLANNERS
    from testbed.planners import Planner as Planner

    __version__: str

_HOME = {
    "TrackObservation": "testbed.environment.track_observation",
    "TrackedEnv": "testbed.environment.wrapper",
    "METRICS": "testbed.evaluation.metric",
    "PLANNERS": "testbed.planners",
    "Planner": "testbed.planners",
}

_MARK = '__distribution__ = "eot-testbed"'  # a line of every package of this project
_PIP = "python -m pip"

__all__ = ["METRICS", "PLANNERS", "Planner", "TrackObservation", "TrackedEnv", "__version__"]


def _check_neighbours() -> None:
    """Raise ImportError unless this project's own `trackers`, `sensors` and `scenarios` lie beside this package.

    Another distribution with a package of one of these names is found before ours, or is installed over it: its
    `__init__.py` replaces ours, and when it is uninstalled the file is missing. So the file itself is read.
    """
    home = Path(__file__).resolve().parent.parent
    for name in ("trackers", "sensors", "scenarios"):
        spec = util.find_spec(name)
        origin = Path(spec.origin).resolve() if spec is not None and spec.origin else None
        if origin is not None and origin.parent != home / name:
            raise ImportError(
                f"testbed needs its own package {name!r} at {home / name}, but Python finds {origin.parent}; "
                f"uninstall the other distribution that brings {name!r}, or put {home} first on the path"
            )
        if origin is None or _MARK not in origin.read_text(encoding="utf-8", errors="replace"):
            raise ImportError(_repair(name, home, missing=origin is None))


def _repair(name: str, home: Path, missing: bool) -> str:
    """What happened to a package whose `__init__.py` is not ours, and the commands that repair it."""
    others = sorted({*metadata.packages_distributions().get(name, ())} - {"eot-testbed"})
    happened = "is missing, as after uninstalling" if missing else "was overwritten by"
    culprit = " and ".join(map(repr, others)) or f"another distribution that brings a package {name!r}"
    checkout = (home / "pyproject.toml").exists()
    reinstall = f"git checkout -- {name}" if checkout else f"{_PIP} install --force-reinstall --no-deps eot-testbed"
    commands = [f"{_PIP} uninstall {' '.join(others)}"] * bool(others) + [reinstall]
    return f"{home / name / '__init__.py'} {happened} {culprit}; repair it with: {' && '.join(commands)}"


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

"""Modules that highway-env imports for its own demonstrations, run only when something in them is used.

`highway_env.vehicle.dynamics` imports pyplot for a figure that its `main` draws; that is half of the time to import
highway-env. A deferred module is the real one, executed at the first access to an attribute.
"""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

DEFERRED = ("matplotlib.pyplot",)


class DeferringFinder(MetaPathFinder):
    """Finds the modules of `DEFERRED` as usual, and has them executed late."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The specification of a deferred module, None of any other."""
        spec = PathFinder.find_spec(fullname, path, target) if fullname in DEFERRED else None
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def defer() -> None:
    """Put the finder first, once."""
    if not any(isinstance(finder, DeferringFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, DeferringFinder())

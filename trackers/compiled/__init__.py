"""Compiled kernels of the default tracker: the same equations as in numpy, one object after the other, by numba.

They are used where numba (the extra `fast`) is installed, unless the environment variable EOT_TESTBED_COMPILED is 0.
The numpy form is the reference: a kernel that cannot do an update leaves it to numpy. docs/speed.md has the gains.
This package alone imports numba, inside functions and in the modules of kernels, which are loaded when first used.
"""

import hashlib
import os
import sys
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

SWITCH = "EOT_TESTBED_COMPILED"
KERNELS = ("algebra", "ground", "sizes", "spline")  # modules
FROZEN = (  # numba keeps constants of other modules in its cache, but does not see them change
    *("unscented.py", "pmht/association.py", "pmht/joint.py", "pmht/state.py"),
    *("multi/ground.py", "multi/visibility.py", "size/likelihood.py"),
)

_loaded: dict[str, ModuleType | None] = {}


def kernels(name: str) -> ModuleType | None:
    """The kernels of that name, None where the numpy form is to be used."""
    if os.environ.get(SWITCH) == "0":
        return None
    if name not in _loaded:
        _loaded[name] = _load(name) if find_spec("numba") else None
    return _loaded[name]


def use(compiled: bool) -> None:
    """Switch to the compiled form, or to numpy's, from now on: in this process and in those that it starts."""
    os.environ[SWITCH] = str(int(compiled))


def versions() -> dict[str, str]:
    """Of numba and of the kernels where they are in use, else nothing: results of the two forms are not mixed."""
    if os.environ.get(SWITCH) == "0" or find_spec("numba") is None:
        return {}
    return {"numba": version("numba"), "trackers.compiled": _digest()}


def rows(a: NDArray, lead: tuple[int, ...], *own: int) -> NDArray:
    """An array that broadcasts to (*lead, *own) as (T, *own), in order and writable, as kernels are compiled for it."""
    if a.shape != (*lead, *own):
        a = np.broadcast_to(a, (*lead, *own))
    a = np.ascontiguousarray(a).reshape(-1, *own)
    return a if a.flags.writeable else a.copy()


def _load(name: str) -> ModuleType:
    """The module of kernels, which are compiled at their first use and then kept in the user's cache folder."""
    from numba import config

    folder = _folder()
    if not any(folder.rglob(f"{name}.*.nbi")):
        print(f"compiling trackers.compiled.{name}, once; about a minute of CPU time", file=sys.stderr)
    before = config.CACHE_DIR
    try:
        config.CACHE_DIR = str(folder)  # read where functions are decorated
        return import_module(f"trackers.compiled.{name}")
    finally:
        config.CACHE_DIR = before


def _folder() -> Path:
    """Where these very kernels are kept."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "eot-testbed" / f"kernels-{_digest()}"


def _digest() -> str:
    """Short digest of the kernels."""
    root = Path(__file__).parents[1]
    sources = [*(root / f"compiled/{name}.py" for name in KERNELS), *(root / name for name in FROZEN)]
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]

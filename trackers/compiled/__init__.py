"""The compiled form of what takes most of a step: numba compiles it, where the extra `fast` is installed.

The numpy form says the same and is the reference: it runs where numba is missing, where it is refused (`compiled=off`
of a tracker or radar, or EOT_COMPILED=off in the environment), and for all that has no compiled form. This module does
not import numba; docs/speed.md has what is compiled.
"""

import os
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

REFUSED = "EOT_COMPILED"  # environment variable; off goes without
HERE = Path(__file__).parent
CALLERS = ("__init__.py", "core.py")  # files that only call what is compiled


def available() -> bool:
    """Whether numba is installed and not refused."""
    return numba_version() is not None and os.environ.get(REFUSED) != "off"


def form() -> str:
    """Which form runs, in words: "numba 0.68.1" or "numpy"."""
    return f"numba {numba_version()}" if available() else "numpy"


@cache
def numba_version() -> str | None:
    """The installed version of numba, None where there is none."""
    try:
        return version("numba")
    except PackageNotFoundError:
        return None


@cache
def cache_folder(*folders: Path) -> Path:
    """Folder that keeps what was compiled from the files of these folders and of this one, but for `CALLERS`.

    Its name carries one digest of all these files: numba looks at the file of a function only, and would go on with
    old code of the functions that this one calls.
    """
    files = sorted(path for folder in {HERE, *folders} for path in folder.glob("*.py") if path.name not in CALLERS)
    digest = sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:12]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base) / "eot-testbed" / f"compiled-{numba_version()}-{digest}"

"""`testbed info`: versions, extras, which form of the heaviest steps runs, and where what was compiled is kept."""

import platform
import re
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path

from rich.table import Table

import sensors.compiled
import trackers.compiled.multi
from testbed.command_line.tables import filled_table
from testbed.files import versions
from trackers.compiled import REFUSED, available, cache_folder, form

HOW = f"{REFUSED}=off, or compiled=off of a tracker or radar, goes without it"


def info() -> Table:
    """What is installed, and what of it is used."""
    rows = [("Python", platform.python_version()), *versions().items()]
    rows += [(f"extra {name}", state) for name, state in extras().items()]
    rows.append(("tracker and radar", f"{form()}; {HOW}" if available() else "numpy; the extra fast compiles them"))
    if available():
        rows += [(f"cache of the {what}", kept(folder)) for what, folder in folders().items()]
    return filled_table("testbed", heads := ("what", "found"), rows, heads)


def folders() -> dict[str, Path]:
    """Where what was compiled is kept."""
    return {
        "filter": cache_folder(),
        "tracker": cache_folder(Path(trackers.compiled.multi.__file__).parent),
        "radar": cache_folder(Path(sensors.compiled.__file__).parent),
    }


def extras() -> dict[str, str]:
    """Extra -> whether all that it names is installed."""
    found = {}
    for extra in metadata("eot-testbed").get_all("Provides-Extra") or []:
        needed = [r for r in requires("eot-testbed") or [] if re.search(rf"extra == [\"']{extra}[\"']", r)]
        missing = [name for name in (re.split(r"[^\w.-]", r)[0] for r in needed) if not installed(name)]
        found[extra] = f"without {', '.join(missing)}" if missing else "installed"
    return found


def installed(name: str) -> bool:
    """Whether a distribution is installed."""
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def kept(folder: Path) -> str:
    """A folder of compiled code, and how large it is."""
    size = sum(path.stat().st_size for path in folder.glob("*/*")) if folder.is_dir() else 0
    return f"{folder}, {size / 1e6:.0f} MB" if size else f"{folder}, empty: the first use compiles"

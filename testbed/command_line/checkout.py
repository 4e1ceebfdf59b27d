"""What a checkout has beside the package: the studies of the documentation, found by name."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

STUDIES = Path(__file__).resolve().parents[2] / "docs" / "studies"


def study(name: str, command: str, folder: Path = STUDIES) -> Any:
    """A module of docs/studies, by its name in there.

    Raises LookupError, in one sentence, where the package was installed without its documentation.
    """
    if not (folder / "__init__.py").is_file():
        raise LookupError(f"`{command}` is a command of a checkout, and {folder} is not there; clone the repository")
    if str(folder.parent) not in sys.path:
        sys.path.append(str(folder.parent))
    return import_module(f"{folder.name}.{name}")

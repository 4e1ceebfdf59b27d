"""Files and folders that results go to: written atomically, or refused in one sentence."""

from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryFile

ROOM = 1 << 20  # [bytes] a log needs to begin; its layout alone is a quarter of that
PACKAGES = ("eot-testbed", "highway-env", "gymnasium", "numpy", "scipy", "rerun-sdk", "shapely")


def versions() -> dict[str, str]:
    """Installed versions of what decides about results."""
    return {name: version(name) for name in PACKAGES}


def make_directory(directory: Path) -> None:
    """Make it with its parents; raises OSError in one sentence where that cannot be."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=directory).close()
    except OSError as error:
        raise OSError(f"out: cannot write to {directory}: {error.strerror}; choose another directory") from None


def make_room(path: Path) -> None:
    """Empty the file of a log; raises OSError without room for its beginning, for which rerun would wait for ever."""
    try:
        path.write_bytes(bytes(ROOM))
        path.unlink()
    except OSError as error:
        raise OSError(f"cannot write the log {path}: {error.strerror}; choose another directory") from None


def write_whole(path: Path, text: str) -> None:
    """Write a file whole or not at all; raises OSError in one sentence."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(text)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OSError(f"cannot write {path}: {error.strerror}; choose another directory") from error

"""Files and folders that results go to: written atomically, or refused in one sentence."""

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryFile
from typing import Any, BinaryIO

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


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write to, which takes the place of `path` when the block ends.

    It lies beside `path` under a name of its own until then, so a reader, and whoever comes after a process that was
    killed, finds the old file or the complete new one. A symbolic link at `path` is replaced, not followed.

    Raises:
        OSError: it cannot be written; `path` is as it was.
    """
    part = path.with_name(f".{path.name}.{token_hex(4)}.part")  # other processes may write the same file
    try:
        with open(part, "xb") as file:
            yield file
        part.replace(path)
    except OSError as error:
        raise OSError(f"cannot write {path}: {error.strerror or error}; choose another directory") from error
    finally:
        with suppress(OSError):
            part.unlink()


def write_atomic(path: Path, content: str | bytes) -> None:
    """Write a file as `atomic_file` does; text as UTF-8."""
    with atomic_file(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON, as `atomic_file` does; raises ValueError for NaN and infinity."""
    write_atomic(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def write_figure(path: Path, figure: Any, **settings: Any) -> Path:
    """Write a matplotlib figure in the format of the suffix, as `atomic_file` does; returns the path."""
    with atomic_file(path) as file:
        figure.savefig(file, format=path.suffix[1:], **settings)
    return path

"""Files and folders of results, written atomically, and archives of arrays, read whole; or refused in one sentence."""

import json
import os
import platform
import shlex
import stat
import subprocess
import sys
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryFile
from tokenize import TokenError
from typing import IO, Any, BinaryIO
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

COLOURS = 256  # of a figure
ROOM = 1 << 20  # [bytes] of the disk that the results of a run take at most
PACKAGES = ("eot-testbed", "highway-env", "gymnasium", "numpy", "scipy", "rerun-sdk", "shapely")
COMPILED = {  # modules that are loaded where they run
    "radar": "sensors.compiled.rays",
    "tracker": "trackers.compiled.multi.steps",
    "filter": "trackers.compiled.steps",
}
OURS = ("scenarios", "sensors", "testbed", "trackers")
KINDS = {
    stat.S_IFLNK: "a symbolic link",
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}

LARGEST = 4_000_000_000  # [bytes] of all arrays of an archive; a small file can claim any size
DAMAGES = (  # what comes out of a damaged archive, depending on where it is damaged
    BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError, ValueError, LookupError, TypeError,
    SyntaxError, TokenError, OverflowError, MemoryError,
)  # fmt: skip


class LostFileWarning(UserWarning):
    """A file of a run could not be written, or not completely; the run went on."""


@contextmanager
def noting_losses(lost: list[str]) -> Iterator[None]:
    """Go on where something cannot be written: its sentence goes into `lost`, and into a `LostFileWarning`."""
    try:
        yield
    except OSError as error:
        lost.append(str(error))
        warnings.warn(str(error), LostFileWarning, stacklevel=3)


def versions() -> dict[str, str]:
    """Installed versions of what decides about results."""
    return {name: version(name) for name in PACKAGES}


def provenance() -> dict[str, Any]:
    """Date, command and class of machine of this process, digest of our files, commit and whether it was changed."""
    folder, program = Path(__file__).parent.parent, Path(sys.argv[0])
    name = program.parent.name if program.name == "__main__.py" else program.name
    state = _git(folder, "status", "--porcelain", "--untracked-files=no", "--", *OURS)
    return {
        "date": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        "command": shlex.join([name, *sys.argv[1:]]),
        "code": _digest(folder),
        "commit": None if state is None else _git(folder, "rev-parse", "HEAD"),
        "changed": None if state is None else bool(state),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "compiled": compiled(),
    }


def compiled() -> str:
    """What this process has run in its compiled form, as in "radar, tracker, filter by numba 0.68.1", or "nothing"."""
    ran = [name for name, module in COMPILED.items() if module in sys.modules]
    return f"{', '.join(ran)} by numba {version('numba')}" if ran else "nothing"


@cache
def _digest(folder: Path) -> str:
    """Short digest of the files of our packages, byte by byte."""
    files = (path for name in OURS for path in (folder / name).rglob("*") if path.suffix in (".py", ".json"))
    found = sorted((path.relative_to(folder).as_posix(), path.read_bytes()) for path in files)
    return sha256(repr([(name, sha256(content).hexdigest()) for name, content in found]).encode()).hexdigest()[:12]


def _git(folder: Path, *words: str) -> str | None:
    """What git says of the checkout in a folder; None where that is none, or there is no git."""
    with suppress(OSError, subprocess.SubprocessError):
        if (folder / ".git").exists():
            call = ["git", "-C", str(folder), *words]
            return subprocess.run(call, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    return None


def file_stem(*parts: str) -> str:
    """Stem of a file from its parts; what a file system does not take, as `/`, reads `-`, and a colon `~`."""
    return "_".join(parts).replace("/", "-").replace(":", "~")


def make_directory(directory: Path) -> None:
    """Make it with its parents; raises OSError, in one sentence, where that cannot be or where there is no `ROOM`."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        reserve(directory).close()
    except OSError as error:
        raise OSError(f"out: cannot write to {directory}: {error.strerror}; choose another directory") from None


def reserve(directory: Path) -> IO[bytes]:
    """A file without a name that keeps `ROOM` of the disk for results, until it is closed."""
    file = TemporaryFile(dir=directory)  # noqa: SIM115 - the caller closes it
    try:
        file.write(bytes(ROOM))
        file.flush()
    except OSError:
        with suppress(OSError):  # once more what could not be written
            file.close()
        raise
    return file


def check_target(path: Path) -> None:
    """Raise OSError, in one sentence, where anything but a regular file, or nothing, is at `path`.

    The target of a link and the reader of a pipe may belong to another program.
    """
    try:
        kind = stat.S_IFMT(path.lstat().st_mode)
    except FileNotFoundError:
        return
    except OSError as error:
        raise OSError(f"cannot write {path}: {error.strerror}; choose another directory") from None
    if kind != stat.S_IFREG:
        raise OSError(f"cannot write {path}: it is {KINDS.get(kind, 'no regular file')}; choose another file")


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write to, which takes the place of `path` when the block ends.

    It lies beside `path` under a name of its own until it is complete on the disk, so a reader finds the old file or
    the complete new one, also after the process was killed.

    Raises:
        OSError: it cannot be written, or `path` is not a regular file, see `check_target`; `path` is as it was.
    """
    check_target(path)
    part = path.with_name(f".{path.name}.{token_hex(4)}.part")  # other processes may write the same file
    try:
        with open(part, "xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
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


def write_figure(path: Path, figure: Any, dpi: float | str = "figure") -> Path:
    """Write a matplotlib figure as PNG of `COLOURS` colours, as `atomic_file` does; returns the path.

    A third of the size, and no difference that one sees: letters and lines keep their colours, of a shade there are
    fewer steps. The same figure gives the same file.
    """
    from PIL import Image  # with matplotlib, late as that is

    whole = BytesIO()
    figure.savefig(whole, format="png", dpi=dpi)
    image = Image.open(whole).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    with atomic_file(path) as file:
        image.save(file, format="png", optimize=True)
    return path


def read_arrays(path: Path, names: Sequence[str] | None = None) -> dict[str, NDArray]:
    """Some arrays of an archive, or all.

    Raises ValueError with the reason, which does not name the file, where it is no archive, is damaged, lacks one of
    the names, or would have to be unpickled.
    """
    if not path.is_file():
        raise ValueError("it is not a file")
    try:
        with ZipFile(path) as parts:
            size = sum(part.file_size for part in parts.infolist())
        if size > LARGEST:
            raise ValueError(f"its arrays have {size} bytes, the most is {LARGEST}")
        with np.load(path, allow_pickle=False) as archive:
            found = {name: archive[name] for name in (archive.files if names is None else names)}
    except DAMAGES as error:
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None
    if other := [name for name, array in found.items() if not isinstance(array, np.ndarray)]:
        raise ValueError(f"{other[0]} is no array")
    return found

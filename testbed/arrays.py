"""Archives of arrays (`.npz`), read without unpickling and whole, or refused in one sentence."""

import zlib
from collections.abc import Sequence
from pathlib import Path
from tokenize import TokenError
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

LARGEST = 4_000_000_000  # [bytes] of all arrays of an archive; a small file can claim any size
DAMAGES = (  # what comes out of a damaged archive, depending on where it is damaged
    BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError, ValueError, LookupError, TypeError,
    SyntaxError, TokenError, OverflowError, MemoryError,
)  # fmt: skip


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

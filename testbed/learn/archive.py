"""Arrays of `.npz` files that users bring: opened without unpickling, and checked before anything is learned from them.

The layout is described in docs/learning.md.
"""

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from zipfile import BadZipFile, is_zipfile

import numpy as np
from numpy.typing import NDArray

LAYOUTS = (("u", "aspect"), ("xy", "pose", "size", "sensor"))  # what has to be there: one or the other
TAILS: dict[str, tuple[int, ...]] = {  # axes after that of the detections
    "u": (2,),
    "aspect": (),
    "xy": (2,),
    "pose": (3,),
    "size": (2,),
    "sensor": (2,),
    "noise": (2, 2),
    "look": (),
    "kind": (),
}
TYPES = {"look": ("iu", "whole numbers"), "kind": ("US", "text")}  # kinds of dtype; real numbers without an entry
OPTIONAL = ("size", "noise", "look", "kind")
NEGATIVE = 1e-9  # rounding that an eigenvalue of a covariance may have
FAR = 2.0  # |u| beyond which more than half of the detections cannot lie: then they are not unit coordinates


def open_arrays(file: Path) -> dict[str, NDArray]:
    """Every array of an `.npz` file; raises ValueError, in one sentence, where it is no such file or is damaged."""
    if not is_zipfile(file):
        raise ValueError(f"data: {file} is not an .npz file, or is not complete; write it with numpy.savez")
    try:
        with np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, EOFError, BadZipFile, zlib.error) as error:
        raise ValueError(f"data: {file} cannot be read without unpickling, or is damaged: {error}") from None


def detection_arrays(file: Path) -> dict[str, NDArray]:
    """The arrays of a file in the documented layout.

    Raises ValueError, in one sentence, where they are not valid or not of the same length.
    """
    arrays = open_arrays(file)
    wanted = LAYOUTS[0] if "u" in arrays else LAYOUTS[1]
    layouts = "; or ".join(", ".join(names) for names in LAYOUTS)
    need(arrays, wanted, file, f"it must hold {layouts}")
    found = {name: arrays[name] for name in dict.fromkeys((*wanted, *OPTIONAL)) if name in arrays}
    n = found[wanted[0]].shape[:1]
    for name, array in found.items():
        tail = TAILS[name]
        letters, what = TYPES.get(name, ("fiu", "real numbers"))
        if array.dtype.kind not in letters:
            raise ValueError(f"data: {name} of {file} must be {what}, got an array of {array.dtype}")
        if array.shape != (*n, *tail) or not n:
            shape = f"({', '.join(map(str, ('N', *tail)))}{',' * (not tail)})"
            raise ValueError(f"data: {name} of {file} must be {shape} with N of {wanted[0]}, got {array.shape}")
        if name != "kind" and (bad := int((~np.isfinite(array)).sum())):
            raise ValueError(f"data: {name} of {file} has {bad} values that are not finite; take those detections out")
    if "size" in found and (found["size"] <= 0).any():
        raise ValueError(f"data: size of {file} must be positive, got {found['size'].min():g} m")
    if "noise" in found and (np.linalg.eigvalsh(found["noise"].astype(float)) < -NEGATIVE).any():
        raise ValueError(f"data: noise of {file} must be covariance matrices, got one with a negative variance")
    return found


def need(arrays: Mapping[str, NDArray], wanted: Sequence[str], file: Path, hint: str = "is it the right file?") -> None:
    """Raise ValueError where one of the wanted arrays is missing."""
    missing = [name for name in wanted if name not in arrays]
    if missing:
        raise ValueError(f"data: {file} lacks {', '.join(missing)}; {hint}")


def check_unit_coordinates(u: NDArray, aspect: NDArray, file: Path) -> None:
    """Raise ValueError for coordinates u (N, 2) and aspects (N,) in other than unit coordinates and radians."""
    if len(u) and np.median(np.abs(u).max(-1)) > FAR:
        raise ValueError(
            f"data: half of the detections of {file} lie more than {FAR:g} half lengths or half widths off their "
            "vehicles; are positions in metres in one frame, and u = 2 (long / length, lat / width)?"
        )
    if len(aspect) and np.abs(aspect).max() > 2 * np.pi:
        raise ValueError(f"data: aspect of {file} must be in radians, got up to {np.abs(aspect).max():g}")

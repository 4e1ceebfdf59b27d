"""Arrays of `.npz` files that users bring: opened without unpickling, and checked before anything is learned from them.

The layout is described in docs/learning.md.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.files import read_arrays

EXTRACT: dict[str, tuple[str, int, str]] = {  # arrays of the real extract: kinds of dtype, axes, what they are
    "columns": ("US", 1, "a list of names"),
    "objects": ("fiu", 2, "a table of numbers"),
    "points": ("fiu", 2, "a table of numbers"),
    "offsets": ("iu", 1, "a list of whole numbers"),
    "classes": ("US", 1, "a list of names"),
}
COLUMNS = ("frame", "class", "cx", "cy", "yaw", "length", "width", "height")  # of its objects that are used
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
HUGE = 1e9  # [m] that no number of the real extract reaches
FAR = 2.0  # |u| beyond which more than half of the detections cannot lie: then they are not unit coordinates


def open_arrays(file: Path) -> dict[str, NDArray]:
    """Every array of an `.npz` file; raises ValueError, in one sentence, where it is no such file or is damaged."""
    try:
        return read_arrays(file)
    except ValueError as error:
        raise ValueError(
            f"data: {file} is not an .npz file, cannot be read without unpickling, or is damaged: {error}; write it "
            "with numpy.savez"
        ) from None


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


class Extract(NamedTuple):
    """N annotated objects of the real extract and their M detections, in its own frame, which has y to the left."""

    objects: dict[str, NDArray]  # by the names of the columns, (N,) each
    classes: tuple[str, ...]  # names of the numbers in the column `class`
    points: NDArray  # (M, 2) [m]
    row: NDArray  # (M,) int, the object of each detection

    def of_class(self, labels: Sequence[str]) -> NDArray:
        """Which objects (N,) are of one of these classes."""
        return np.isin(self.objects["class"], [self.classes.index(label) for label in labels])


def read_extract_arrays(folder: Path, labels: Sequence[str]) -> Extract:
    """The real extract in a folder; raises ValueError, in one sentence, where it is not there, wrong or damaged.

    `labels` are the classes that are needed.
    """
    file = folder / "objects.npz"
    if not file.is_file():
        raise ValueError(f"data: there are no real detections, no objects.npz in {folder}; give the folder that has it")
    arrays = open_arrays(file)
    need(arrays, list(EXTRACT), file)
    for name, (letters, axes, what) in EXTRACT.items():
        if arrays[name].dtype.kind not in letters or arrays[name].ndim != axes:
            found = f"{arrays[name].dtype} {arrays[name].shape}"
            raise ValueError(f"data: {name} of {file} must be {what}, got an array of {found}; is it the right file?")
    objects, points, offsets = arrays["objects"].astype(float), arrays["points"].astype(float), arrays["offsets"]
    columns, classes = arrays["columns"].astype(str).tolist(), tuple(arrays["classes"].astype(str).tolist())
    if missing := [c for c in COLUMNS if c not in columns] + [c for c in labels if c not in classes]:
        raise ValueError(f"data: {file} has no column or class {', '.join(missing)}; is it the right file?")
    counts = np.diff(offsets.astype(float))
    if objects.shape[1] != len(columns) or points.shape[1] < 2 or len(offsets) != len(objects) + 1:
        raise ValueError(f"data: objects, columns, points and offsets of {file} do not fit; is it the right file?")
    if (counts < 0).any() or offsets[0] != 0 or offsets[-1] != len(points):
        raise ValueError(f"data: offsets of {file} must grow from 0 to {len(points)}, the number of points")
    table = dict(zip(columns, objects.T, strict=True))
    used = np.stack([table[name] for name in COLUMNS])
    if not ((np.abs(used) < HUGE).all() and (np.abs(points[:, :2]) < HUGE).all()):
        raise ValueError(f"data: {file} has numbers that are not finite, or beyond {HUGE:g}; is it damaged?")
    if len(objects) and min(table["length"].min(), table["width"].min()) <= 0:
        raise ValueError(f"data: lengths and widths of {file} must be positive; is it damaged?")
    return Extract(table, classes, points[:, :2], np.repeat(np.arange(len(objects)), counts.astype(int)))


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

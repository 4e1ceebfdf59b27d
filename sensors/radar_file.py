"""A radar as a TOML file: its fields by their names, a table for each sensor and for each record within one.

Units are those of the fields: metres, m/s, seconds, degrees where a name ends in `_deg`, and the mount as x, y [m] and
heading in RAD.
"""

from pathlib import Path
from typing import Any

from sensors.radar import Radar
from trackers.toml_file import lines, read_record

INNER = ("compiled",)  # fields that are no properties of a radar
HEAD = "# Units: m, m/s, 1/s; degrees where a name ends in _deg; mount = [x in m, y in m, heading in RAD]\n"


def text_of(radar: Any) -> str:
    """The file of a radar, every field written; ValueError, in one sentence, for an object of another kind."""
    if not isinstance(radar, Radar):
        raise ValueError(f"only a `sensors.Radar` is written as a file, got {type(radar).__name__}; choose of RADARS")
    return HEAD + "\n".join(lines(radar, INNER))


def read_radar(path: str) -> Radar:
    """The radar of a file.

    Raises:
        LookupError: the file cannot be read.
        ValueError: it is no TOML, or has a key or value that no radar has; one sentence names file and key.
    """
    radar: Radar = read_record(Radar, path, "radar", INNER, note=f"from {Path(path).name}")
    return radar

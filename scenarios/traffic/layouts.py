"""Layouts of recorded trajectories: which column holds what, in which unit, of which point of the vehicle.

A layout is recognised by the header of a file; capitals do not matter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from types import MappingProxyType

FOOT = 0.3048  # [m]
NEEDED = ("id", "x", "y", "length", "width")  # besides the time, or the number of the frame
KNOWN = 0.5  # share of the needed columns from which a header is taken for that of a layout


@dataclass(frozen=True)
class Layout:
    """One way to write trajectories; `columns` maps id, time or frame, x, y ... to the names in the header."""

    name: str
    columns: Mapping[str, str]
    unit: float = 1.0  # [m] of lengths
    rate: float = 1.0  # [Hz] of frames
    anchor: str = "centre"  # what x, y is of: centre, front (its middle), corner (the least x and y of the box)
    left: bool = False  # whether y is to the left of x
    degrees: bool = False  # whether headings are in degrees, else in radians

    @property
    def needed(self) -> tuple[str, ...]:
        """Columns that must be there, by the names in the header."""
        clock = "time" if "time" in self.columns else "frame"
        return tuple(self.columns[key] for key in (clock, *NEEDED))

    def places(self, header: Sequence[str]) -> dict[str, int]:
        """Index in the header of each of the columns that are there."""
        lower = [name.strip().lower() for name in header]
        return {key: lower.index(name.lower()) for key, name in self.columns.items() if name.lower() in lower}

    def missing(self, header: Sequence[str]) -> list[str]:
        """Needed columns that the header does not have."""
        lower = {name.strip().lower() for name in header}
        return [name for name in self.needed if name.lower() not in lower]


OWN = Layout(
    "own",
    MappingProxyType({
        "time": "time", "id": "id", "x": "x", "y": "y", "length": "length", "width": "width",
        "heading": "heading", "speed": "speed", "kind": "class", "lane": "lane",
    }),
    left=True,
)  # fmt: skip
LAYOUTS = (
    OWN,
    Layout(
        "NGSIM",
        MappingProxyType({
            "frame": "Frame_ID", "id": "Vehicle_ID", "x": "Local_Y", "y": "Local_X",
            "length": "v_length", "width": "v_Width", "speed": "v_Vel", "kind": "v_Class", "lane": "Lane_ID",
        }),
        unit=FOOT, rate=10.0, anchor="front",
    ),
    Layout(
        "highD",
        MappingProxyType({
            "frame": "frame", "id": "id", "x": "x", "y": "y", "length": "width", "width": "height", "lane": "laneId",
        }),
        rate=25.0, anchor="corner",
    ),
    Layout(
        "exiD",
        MappingProxyType({
            "frame": "frame", "id": "trackId", "x": "xCenter", "y": "yCenter", "length": "length", "width": "width",
            "heading": "heading",
        }),
        rate=25.0, left=True, degrees=True,
    ),
    Layout(
        "SMARTS",
        MappingProxyType({
            "time": "sim_time", "id": "vehicle_id", "x": "position_x", "y": "position_y",
            "length": "length", "width": "width", "speed": "speed", "kind": "type", "lane": "lane_id",
        }),
        left=True,
    ),
)  # fmt: skip


def other_separator(header: Sequence[str]) -> str | None:
    """What separates the columns of a header that was split at commas, where that is something else."""
    return next((mark for mark in ";\t|" if mark in header[0]), None) if len(header) == 1 else None


def recognised(header: Sequence[str], file: str) -> Layout:
    """The layout of a header; `file` is its name, for the error.

    Raises:
        ValueError: it is that of no layout, or lacks columns of the one that it is nearest to.
    """
    lacking = [len(layout.missing(header)) / len(layout.needed) for layout in LAYOUTS]
    layout = LAYOUTS[lacking.index(min(lacking))]
    if min(lacking) > KNOWN:
        if mark := other_separator(header):
            raise ValueError(f"{file} has its columns separated by {mark!r}; write it with commas and decimal points")
        names = ", ".join(other.name for other in LAYOUTS[1:])
        raise ValueError(
            f"{file} has the columns {', '.join(header) or 'none'}, which are of no known layout ({names}); "
            f"write a CSV with the columns {', '.join(OWN.needed)}"
        )
    if missing := layout.missing(header):
        close = get_close_matches(missing[0].lower(), [name.strip().lower() for name in header], n=1)
        hint = f"; is it what {close[0]!r} holds?" if close else ""
        raise ValueError(
            f"{file} looks like the layout {layout.name} but has no column {', '.join(missing)}{hint or '; add it'}"
        )
    return layout

"""What the colours of a log mean, for the pages that say so."""

from collections.abc import Iterator, Sequence

from testbed.log import palette
from testbed.log.text import markdown_table

KIND_NOTES = {  # of `sensors.origin.KINDS`
    "contour": "detection on the outline of a vehicle",
    "volume": "detection from inside a vehicle, or from beneath it",
    "clutter": "false alarm: nothing is there",
    "static": "standing return: guard rail, post, bridge",
    "mirror": "ghost: a vehicle seen in a mirror, such as a guard rail or the side of a truck",
    "double": "ghost: reflected twice between a vehicle and the ego",
}
RINGS = (25.0, 50.0, 100.0, 150.0)  # [m] around the ego


def css(color: int) -> str:
    """A colour 0xRRGGBBAA as people write it.

    >>> css(0x43E66BFF)
    '#43e66b'
    """
    return f"#{int(color) >> 8:06x}"


def legend_text(trackers: Sequence[str]) -> str:
    """Page that says what every line and dot is."""
    rings = ", ".join(f"{r:g}" for r in RINGS)
    return "\n\n".join(
        [
            "## Dots: detections by their true source",
            markdown_table(("colour", "what"), ((_NAMES[kind], note) for kind, note in KIND_NOTES.items())),
            "## Lines",
            markdown_table(("line", "what"), _lines(trackers)),
            f"Rings: {rings} m around the ego. Trackers never see sources, nor anything of the truth.",
        ]
    )


_NAMES = {
    "contour": "green", "volume": "pink", "clutter": "grey", "static": "brown", "mirror": "blue", "double": "yellow",
}  # fmt: skip


def _lines(trackers: Sequence[str]) -> Iterator[tuple[str, str]]:
    yield "white, thick", "the ego"
    yield "light grey, thin", "true outline with the vehicle's name; the dimmer the less of it is visible to the radars"
    for index, name in enumerate(trackers):
        yield (
            f"{palette.tracker_name(index)}",
            f"reported tracks of {name} with their ids; the very thin ones are not yet reported",
        )
    yield "ellipse", "where the centre of a track is with 95 % probability, by its own covariance"
    yield "blue", "where the planner means to go"
    yield "brown", "guard rails"

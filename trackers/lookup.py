"""Look-up in a catalogue, with a suggestion for a misspelt name."""

from collections.abc import Mapping
from difflib import get_close_matches
from typing import TypeVar

T = TypeVar("T")


def look_up(name: str, catalogue: Mapping[str, T], what: str) -> T:
    """The entry of that name.

    Args:
        name: as the user wrote it.
        catalogue: entries by name.
        what: one entry in a word, for the error: "tracker".

    Raises:
        LookupError: there is none; the nearest name is suggested, or all are listed where none is near.
    """
    try:
        return catalogue[name]
    except (KeyError, TypeError):  # TypeError: no name at all
        close = get_close_matches(name, catalogue, n=1) if isinstance(name, str) else []
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(catalogue)}"
        raise LookupError(f"no {what} {name!r}; {hint}") from None

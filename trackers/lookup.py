"""Look-up in a catalogue, with a suggestion for a misspelt name; entries with parameters, NAME:key=value,key=value."""

from ast import literal_eval
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, TypeVar

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


SWITCHES = {"on": True, "off": False, "none": None}


def parse(text: str) -> tuple[str, dict[str, Any]]:
    """Name and parameters of an entry; values are Python literals, on, off, none, or else text.

    >>> parse("rm-feldmann:sigma=0.3,size=off")
    ('rm-feldmann', {'sigma': 0.3, 'size': False})

    Raises:
        ValueError: a parameter without a value, or given twice.
    """
    name, colon, rest = text.partition(":")
    parameters: dict[str, Any] = {}
    for part in rest.split(",") if colon else ():
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not (key and equals and value):
            raise ValueError(f"{text!r} has {part!r} where a parameter is due; write NAME:key=value,key=value")
        if key in parameters:
            raise ValueError(f"{text!r} has the parameter {key} twice; give it once")
        parameters[key] = SWITCHES[value] if value in SWITCHES else _literal(value)
    return name, parameters


def _literal(text: str) -> Any:
    try:
        return literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text

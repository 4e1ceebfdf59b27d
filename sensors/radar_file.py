"""A radar as a TOML file: its fields by their names, a table for each sensor and for each record within one.

Units are those of the fields: metres, m/s, seconds, degrees where a name ends in `_deg`, and the mount as x, y [m] and
heading in RAD.
"""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from sensors.radar import Radar, Sensor

SUFFIX = ".toml"
INNER = ("compiled",)  # fields that are no properties of a radar
WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
HEAD = "# Units: m, m/s, 1/s; degrees where a name ends in _deg; mount = [x in m, y in m, heading in RAD]\n"


def text_of(radar: Any) -> str:
    """The file of a radar, every field written; ValueError, in one sentence, for an object of another kind."""
    if not isinstance(radar, Radar):
        raise ValueError(f"only a `sensors.Radar` is written as a file, got {type(radar).__name__}; choose of RADARS")
    return HEAD + "\n".join(_lines(radar, ""))


def _lines(record: Any, path: str) -> Iterator[str]:
    """Plain fields, then tables."""
    tables = []
    for one in fields(record):
        value = getattr(record, one.name)
        within = f"{path}{one.name}"
        if is_dataclass(value):
            tables += ["", f"[{within}]", *_lines(value, f"{within}.")]
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            tables += [line for item in value for line in ("", f"[[{within}]]", *_lines(item, f"{within}."))]
        elif value is not None and one.name not in INNER:
            yield f"{one.name} = {_text(value)}"
    yield from tables


def _text(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(float(value)) if isinstance(value, float) else str(value)


def read_radar(path: str) -> Radar:
    """The radar of a file.

    Raises:
        LookupError: the file cannot be read.
        ValueError: it is no TOML, or has a key or value that no radar has; one sentence names file and key.
    """
    try:
        found = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise LookupError(f"radar {path!r} cannot be read: {getattr(error, 'strerror', error)}") from None
    except (tomllib.TOMLDecodeError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no TOML: {error}; `testbed radar show NAME` writes one") from None
    return _record(Radar, {"name": Path(path).stem, "note": f"from {Path(path).name}"} | found, path)


def _record(kind: Any, given: Mapping[str, Any], where: str) -> Any:
    """A dataclass from a table of a file; `where` is the file and the place in it."""
    known = {name: hint for name, hint in get_type_hints(kind).items() if name not in INNER}
    for name in given:
        if name not in known:
            close = get_close_matches(name, known, 1)
            raise ValueError(f"{where} has no key {name}; {f'did you mean {close[0]}?' if close else _all(known)}")
    if missing := [one.name for one in fields(kind) if one.name not in given and needed(one)]:
        raise ValueError(f"{where} has no key {missing[0]}, which it needs; {_all(known)}")
    values = {name: _value(known[name], value, f"{where}, {name}") for name, value in given.items()}
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def needed(one: Field[Any]) -> bool:
    """Whether a field has no default."""
    return one.default is MISSING and one.default_factory is MISSING


def _all(known: Mapping[str, Any]) -> str:
    return f"it has the keys {', '.join(known)}"


def _value(hint: Any, value: Any, where: str) -> Any:
    """A value of a file as the field has it: a table as its record, a list as a tuple."""
    if hint == tuple[Sensor, ...]:
        if not (isinstance(value, list) and all(isinstance(one, Mapping) for one in value)):
            raise ValueError(f"{where} must be tables [[sensors]], got {value!r}")
        return tuple(_record(Sensor, one, f"{where} {k}") for k, one in enumerate(value, 1))
    if records := [one for one in (hint, *get_args(hint)) if is_dataclass(one)]:
        if not isinstance(value, Mapping):
            raise ValueError(f"{where} must be a table, got {value!r}")
        return _record(records[0], value, where)
    if get_origin(hint) is tuple:
        if not (isinstance(value, list) and len(value) == len(get_args(hint)) and all(map(_is_number, value))):
            raise ValueError(f"{where} must be a list of {len(get_args(hint))} numbers, got {value!r}")
        return tuple(value)
    kind = next(one for one in (hint, *get_args(hint)) if one in WORDS)
    if not (
        _is_number(value) and (kind is float or type(value) is int) if kind in (float, int) else type(value) is kind
    ):
        raise ValueError(f"{where} must be {WORDS[kind]}, got {value!r}")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)

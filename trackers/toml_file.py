"""Records as TOML files: fields of a dataclass by their names, a table for each record within it.

Every key and value is checked; what is wrong is said in one sentence that names file and key.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from difflib import get_close_matches
from inspect import isfunction
from pathlib import Path
from typing import Any, get_args, get_origin

SUFFIX = ".toml"
WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


def lines(record: Any, hidden: Sequence[str] = (), path: str = "") -> Iterator[str]:
    """The file of a record, line by line, every field but those of `hidden` written: plain fields, then tables."""
    tables = []
    for one in fields(record):
        value = getattr(record, one.name)
        within = f"{path}{one.name}"
        if is_dataclass(value):
            tables += ["", f"[{within}]", *lines(value, hidden, f"{within}.")]
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            tables += [line for item in value for line in ("", f"[[{within}]]", *lines(item, hidden, f"{within}."))]
        elif value is not None and value != () and one.name not in hidden:
            yield f"{one.name} = {_text(value)}"
    yield from tables


def _text(value: Any) -> str:
    """A value as TOML has it; a function by its name."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if isfunction(value):
        value = f"{value.__module__}:{value.__qualname__}"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(float(value)) if isinstance(value, float) else str(value)


def read_table(path: str, what: str, remedy: str) -> dict[str, Any]:
    """The table of a file that is `what` in a word; LookupError or ValueError, in one sentence, for what is none."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise LookupError(f"{what} {path!r} cannot be read: {getattr(error, 'strerror', error)}") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no TOML: {error}; {remedy}") from None


def read_record(kind: Any, path: str, what: str, hidden: Sequence[str] = (), **others: Any) -> Any:
    """The record of a file; `what` it is in a word, which is that of `testbed WHAT show`, and values of keys not given.

    Raises:
        LookupError: the file cannot be read.
        ValueError: it is no TOML, or has a key or value that no such record has; one sentence names file and key.
    """
    found = read_table(path, what, f"`testbed {what} show NAME` writes one")
    return _record(kind, {"name": Path(path).stem} | others | found, path, hidden)


def _record(kind: Any, given: Mapping[str, Any], where: str, hidden: Sequence[str]) -> Any:
    """A dataclass from a table of a file; `where` is the file and the place in it."""
    known = {one.name: one.type for one in fields(kind) if one.name not in hidden}
    for name in given:
        if name not in known:
            close = get_close_matches(name, known, 1)
            raise ValueError(f"{where} has no key {name}; {f'did you mean {close[0]}?' if close else _all(known)}")
    if missing := [one.name for one in fields(kind) if one.name not in given and needed(one)]:
        raise ValueError(f"{where} has no key {missing[0]}, which it needs; {_all(known)}")
    values = {name: _value(known[name], value, f"{where}, {name}", hidden) for name, value in given.items()}
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def needed(one: Field[Any]) -> bool:
    """Whether a field has no default."""
    return one.default is MISSING and one.default_factory is MISSING


def _all(known: Mapping[str, Any]) -> str:
    return f"it has the keys {', '.join(known)}"


def _value(hint: Any, value: Any, where: str, hidden: Sequence[str]) -> Any:
    """A value of a file as the field has it: a table as its record, a list as a tuple."""
    inner = get_args(hint)
    if get_origin(hint) is tuple and is_dataclass(inner[0]):
        if not (isinstance(value, list) and all(isinstance(one, Mapping) for one in value)):
            raise ValueError(f"{where} must be tables [[{where.rpartition(', ')[2]}]], got {value!r}")
        return tuple(_record(inner[0], one, f"{where} {k}", hidden) for k, one in enumerate(value, 1))
    if records := [one for one in (hint, *inner) if is_dataclass(one)]:
        if not isinstance(value, Mapping):
            raise ValueError(f"{where} must be a table, got {value!r}")
        return _record(records[0], value, where, hidden)
    if get_origin(hint) is tuple:
        if not (isinstance(value, list) and len(value) == len(inner) and all(map(_is_number, value))):
            raise ValueError(f"{where} must be a list of {len(inner)} numbers, got {value!r}")
        return tuple(value)
    kind = next(one for one in (hint, *inner) if one in WORDS)
    if not (
        _is_number(value) and (kind is float or type(value) is int) if kind in (float, int) else type(value) is kind
    ):
        raise ValueError(f"{where} must be {WORDS[kind]}, got {value!r}")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)

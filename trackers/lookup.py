"""Entries of the catalogues and of users, by one grammar: NAME or MODULE:OBJECT, then :key=value,key=value.

NAME is in a catalogue, or was registered by an installed package under the entry points `eot_testbed.trackers`,
`.planners`, `.radars` or `.scenarios`. MODULE:OBJECT is imported as Python does it; docs/own-code.md has an example of
each.
"""

import sys
from ast import literal_eval
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from inspect import Parameter, isclass, isroutine, signature
from numbers import Integral, Real
from pathlib import Path
from traceback import extract_tb
from typing import Any, TypeVar

T = TypeVar("T")

GROUP = "eot_testbed."  # of the entry points; then trackers, planners, radars, scenarios


def look_up(name: str, catalogue: Mapping[str, T], what: str) -> T:
    """The entry of that name; `what` is one entry in a word, for the error: "tracker".

    Raises LookupError where there is none; the nearest name is suggested, or all are listed where none is near.
    """
    try:
        return catalogue[name]
    except (KeyError, TypeError):  # TypeError: no name at all
        close = get_close_matches(name, catalogue, n=1) if isinstance(name, str) else []
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(catalogue)}"
        raise LookupError(f"no {what} {name!r}; {hint}") from None


KINDS: Mapping[str, tuple[type, str]] = {  # of parameters that say of which type they are: who goes, in words
    "float": (Real, "a number, such as 0.5"), "int": (Integral, "a whole number, such as 2"),
    "bool": (Integral, "on or off"),
}  # fmt: skip
FAULTS = (  # of a class or function of a user that is called; a ValueError is a sentence already
    ArithmeticError, AssertionError, AttributeError, ImportError, LookupError, NameError, OSError, RuntimeError,
    TypeError,
)  # fmt: skip
SWITCHES = {"on": True, "off": False, "none": None}


def parse(text: str) -> tuple[str, dict[str, Any]]:
    """Name and parameters of an entry; values are Python literals, on, off, none, or else text.

    >>> parse("rm-feldmann:sigma=0.3,size=off")
    ('rm-feldmann', {'sigma': 0.3, 'size': False})
    >>> parse("my_ekf:CentroidEKF:gain=2")
    ('my_ekf:CentroidEKF', {'gain': 2})

    Raises ValueError for a parameter without a value or given twice, and for a file in place of a module.
    """
    name, colon, rest = text.partition(":")
    item, more, parameters_of_item = rest.partition(":")
    if _is_path(name) and _is_path(item):
        name, colon, rest = f"{name}:{item}", more, parameters_of_item
    if name.endswith(".py"):
        raise ValueError(f"{text!r} names a file; start in its folder, and write {Path(name).stem}:OBJECT")
    parameters: dict[str, Any] = {}
    for part in rest.split(",") if colon else ():
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not (key and equals and value):
            raise ValueError(f"{text!r} has {part!r} where a parameter is due; write NAME:key=value,key=value")
        if key in parameters:
            raise ValueError(f"{text!r} has the parameter {key} twice; give it once")
        parameters[key] = SWITCHES[value] if value in SWITCHES else _literal(value)
    return name, parameters


def _is_path(text: str) -> bool:
    """Whether a text can be that of a module, or of an object in one: identifiers with dots between."""
    return all(part.isidentifier() for part in text.split("."))


def _literal(text: str) -> Any:
    try:
        return literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text


def is_own(name: Any, catalogue: Mapping[str, Any]) -> bool:
    """Whether a name, with or without parameters, is to be looked for outside of a catalogue."""
    return isinstance(name, str) and parse(name)[0] not in catalogue


def find_own(name: str, catalogue: Mapping[str, Any], what: str) -> Any:
    """What MODULE:OBJECT, or the name that an installed package has registered, stands for; name has no parameters.

    Raises LookupError where there is no such name, module or object, or two packages have registered the name.
    """
    if isinstance(name, str) and ":" in name:
        if (entry := name.partition(":")[0]) in catalogue:
            raise LookupError(f"{name!r} has no value for a parameter; write {entry}:key=value,key=value")
        return _load(name, what)
    found = installed(what) if isinstance(name, str) else {}
    if name not in found:
        look_up(name, {**catalogue, **found}, what)
    return _load(found[name].value, what)


def entry_of(name: str, catalogue: Mapping[str, Any], what: str) -> Any:
    """That of a catalogue, or what `find_own` finds; name has no parameters."""
    return catalogue[name] if name in catalogue else find_own(name, catalogue, what)


def installed(what: str) -> dict[str, EntryPoint]:
    """What installed packages have registered, by name; LookupError where two have taken one name."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=f"{GROUP}{what}s"):
        if point.name in found and found[point.name].value != point.value:
            both = f"{found[point.name].value} and {point.value}"
            raise LookupError(f"two packages have registered the {what} {point.name!r}: {both}; write one of these")
        found[point.name] = point
    return found


def home(name: str, what: str) -> str | None:
    """MODULE:OBJECT of what is not in a catalogue; None for a name that nobody has registered."""
    if ":" in name:
        return name
    point = installed(what).get(name)
    return None if point is None else point.value


def search_here() -> None:
    """Let Python look for modules in the current directory, after all other places."""
    if "" not in sys.path:  # Python takes "." for the directory that was current when it first looked there
        sys.path.append("")


def _load(path: str, what: str) -> Any:
    """The object of MODULE:OBJECT; a module is looked for as Python does, and last in the current directory."""
    module_name, _, item = path.partition(":")
    found = imported(module_name, path, what)
    for part in item.split("."):
        if not hasattr(found, part):
            names = {n: None for n in vars(found) if not n.startswith("_")} if hasattr(found, "__dict__") else {}
            close = get_close_matches(part, names, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(names)}"
            raise LookupError(f"{what} {path!r}: {module_name} has no {part!r}; {hint}")
        found = getattr(found, part)
    return found


def imported(module_name: str, path: str, what: str) -> Any:
    """A module of users, for what `path` names; LookupError, in one sentence, where it cannot be imported."""
    search_here()
    try:
        return import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module_name}.".startswith(f"{error.name}."):
            raise LookupError(f"{what} {path!r}: {module_name} imports {error.name}, which is not installed") from None
        raise LookupError(
            f"{what} {path!r}: there is no module {module_name!r} here or on PYTHONPATH; "
            "start in its folder, or install its package"
        ) from None
    except (ImportError, SyntaxError, NameError, AttributeError, TypeError, ValueError) as error:
        raise LookupError(
            f"{what} {path!r}: importing {module_name} fails with {type(error).__name__}: {error}"
        ) from error


def made(text: str, catalogue: Mapping[str, Any], what: str) -> Any:
    """The entry of a catalogue or of a user with the parameters of the text; arguments and errors as in `find_own`.

    Raises also ValueError: a text that does not read like an entry, or a parameter that it does not have.
    """
    if not isinstance(text, str):
        return look_up(text, catalogue, what)
    name, parameters = parse(text)
    return with_parameters(entry_of(name, catalogue, what), name, parameters)


def parameters_of(made_by: Any) -> tuple[str, ...]:
    """Names of the parameters that a class or function, or the class of a dataclass instance, takes."""
    if is_dataclass(made_by):
        return tuple(field.name for field in fields(made_by) if field.init)
    if isclass(made_by) or isroutine(made_by):
        kinds = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
        return tuple(p.name for p in signature(made_by).parameters.values() if p.kind in kinds)
    return ()


def check_types(made_by: Any, name: str, parameters: Mapping[str, Any]) -> None:
    """Raise ValueError for a value that is no number, no whole number or no switch, where the parameter says so.

    A parameter of made_by, a class, a function or an instance of a dataclass, says so by its annotation float, int or
    bool; name stands in the error.
    """
    if is_dataclass(made_by):
        said: dict[str, Any] = {field.name: field.type for field in fields(made_by)}
    else:
        said = {key: p.annotation for key, p in signature(made_by).parameters.items()}
    for key, value in parameters.items():
        kind, words = KINDS.get(getattr(said[key], "__name__", said[key]), (object, ""))
        if not isinstance(value, kind) or (isinstance(value, bool) and words and "off" not in words):
            raise ValueError(f"{name}: {key} must be {words}, got {value!r}")


def with_parameters(found: Any, name: str, parameters: Mapping[str, Any]) -> Any:
    """An object of a class or function called with these parameters, or a dataclass instance with them replaced.

    Raises ValueError for a parameter that it does not have, one that it needs and does not get, one of another type,
    and where the class or function fails.
    """
    known = parameters_of(found)
    if unknown := parameters.keys() - {*known}:
        raise ValueError(f"{name} has no parameter {', '.join(sorted(unknown))}; it has {', '.join(known) or 'none'}")
    if parameters:
        check_types(found, name, parameters)
    if not (isclass(found) or isroutine(found)):
        return replace(found, **parameters) if parameters else found
    taken = signature(found).parameters.values()
    needed = [p.name for p in taken if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    if missing := [key for key in needed if key not in parameters]:
        raise ValueError(f"{name} needs a value of {', '.join(missing)}; write {name}:{missing[0]}=VALUE")
    try:
        return found(**parameters)
    except FAULTS as error:
        at = extract_tb(error.__traceback__)[-1]
        what = f"making it fails with {type(error).__name__}: {error}"
        raise ValueError(f"{name}: {what} ({Path(at.filename).name}:{at.lineno}, in {at.name})") from error

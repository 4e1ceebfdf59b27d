"""Which code made a run: digests that tell when results must not be mixed.

What all runs share (scenarios, sensors, the multi-object tracker, the scores) has one digest. Each tracker has its own,
of its parameters and of the modules behind its filter, so that a new or changed tracker leaves the runs of the others
valid.
"""

import ast
import hashlib
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from trackers import find

SHARED = ("scenarios", "sensors")  # whole packages
ROOTS = ("trackers.multi.tracker",)  # modules that count with all of `trackers` that they import
SCORES = (  # modules of testbed that decide about rows
    "belief", "car_following", "closed_loop", "env", "evaluation", "foresight", "guard", "histories", "idm",
    "metrics", "observation", "pair_errors", "perception", "planners",
    "compare.recording", "compare.replay", "compare.rows", "compare.runs",
)  # fmt: skip
TABLES = {"trackers.htg.bins": "htg/tables", "trackers.pmht.model": "pmht/models"}  # by the module that reads them


def shared_digest() -> str:
    """Short digest of the code behind every run, whatever the tracker."""
    whole = [path for package in SHARED for path in sorted(_root(package).rglob("*.py"))]
    modules = [_file(f"testbed.{name}") for name in SCORES]
    return _digest([*whole, *modules, *map(_file, closure(ROOTS))])


def tracker_digest(name: str) -> str:
    """Short digest of a tracker: its parameters, and all of `trackers` that the modules of its filter import."""
    filter = find(name)
    modules = closure(sorted({type(part).__module__ for part in _parts(filter)}))
    folders = [_root("trackers") / folder for module, folder in TABLES.items() if module in modules]
    tables = [path for folder in folders for path in sorted(folder.rglob("*.json"))]
    return _digest([*map(_file, modules), *tables], repr(filter))


def closure(modules: Iterable[str]) -> list[str]:
    """Modules of `trackers` that these import, directly or not, themselves included, in alphabetical order."""
    found, todo = set[str](), set(modules)
    while todo:
        name = todo.pop()
        found.add(name)
        todo |= _imports(_file(name)) - found
    return sorted(found)


@cache
def _imports(path: Path) -> frozenset[str]:
    """Modules of `trackers` that a module imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return frozenset(n for n in names if n.startswith("trackers.") and _file(n).is_file())


def _parts(value: Any) -> Iterable[Any]:
    """A filter and the filters and parameters that it is made of."""
    if is_dataclass(value):
        yield value
        for field in fields(value):
            yield from _parts(getattr(value, field.name))
    elif isinstance(value, tuple):
        for item in value:
            yield from _parts(item)


def _root(package: str) -> Path:
    return Path(str(files(package)))


def _file(module: str) -> Path:
    package, *inner = module.split(".")
    return _root(package).joinpath(*inner).with_suffix(".py")


def _digest(paths: Iterable[Path], text: str = "") -> str:
    digest = hashlib.sha256(text.encode())
    for path in paths:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]

"""Which code made a run: results of different digests must not be mixed.

What all runs share (scenarios, sensors, the multi-object tracker, the scores) has one digest. Each tracker has its own,
of its parameters and of the modules behind its filter, so that a new or changed tracker leaves the runs of the others
valid. A digest counts what runs: the syntax of a module, not its words, its layout, its name or its place.
"""

import ast
import hashlib
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from trackers import SensorModel, build

PACKAGES = ("scenarios", "sensors", "testbed", "trackers")  # ours; their modules may be renamed and moved
SHARED = ("scenarios", "sensors")  # whole packages
ROOTS = ("trackers.multi.tracker",)  # modules that count with all of `trackers` that they import
SCORES = (  # modules of testbed that decide about rows
    "frame",
    "environment.belief", "environment.observation", "environment.perception", "environment.wrapper",
    "planners.car_following", "planners.collision", "planners.idm", "planners.prediction", "planners.registry",
    "evaluation.driving", "evaluation.ends", "evaluation.histories", "evaluation.metrics", "evaluation.pair_errors",
    "evaluation.tracking",
    "compare.runs.recording", "compare.runs.replay", "compare.runs.rows", "compare.runs.tasks",
)  # fmt: skip
TABLES = {"trackers.htg.bins": "htg/tables", "trackers.pmht.model": "pmht/models"}  # by the module that reads them


def shared_digest() -> str:
    """Short digest of the code behind every run, whatever the tracker."""
    whole = [path for package in SHARED for path in sorted(_root(package).rglob("*.py"))]
    modules = [_file(f"testbed.{name}") for name in SCORES]
    return code_digest([*whole, *modules, *map(_file, closure(ROOTS))])


def modules_digest(modules: Iterable[str]) -> str:
    """Short digest of modules, and of all modules of packages, by their full names."""
    paths = [_file(name) for name in modules]
    whole = [path.parent.rglob("*.py") if path.name == "__init__.py" else [path] for path in paths]
    return code_digest(path for group in whole for path in group)


def project_digest() -> str:
    """Short digest of all our code and data but those of `testbed regress`, which hold results of runs."""
    held = _root("testbed") / "regress"
    paths = [p for package in PACKAGES for p in _root(package).rglob("*") if p.suffix in (".py", ".json")]
    return code_digest(path for path in paths if held not in path.parents)


def tracker_digest(name: str) -> str:
    """Short digest of a tracker: its parameters, and all of `trackers` that the modules of its filter import."""
    tracker = build(name, (SensorModel(),))
    modules = closure(sorted({type(part).__module__ for part in parts(tracker)}))
    folders = [_root("trackers") / folder for module, folder in TABLES.items() if module in modules]
    tables = [path for folder in folders for path in sorted(folder.rglob("*.json"))]
    return code_digest([*map(_file, modules), *tables], repr(tracker))


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


def parts(value: Any) -> Iterable[Any]:
    """A filter and the filters and parameters that it is made of."""
    if is_dataclass(value):
        yield value
        for field in fields(value):
            yield from parts(getattr(value, field.name))
    elif isinstance(value, tuple):
        for item in value:
            yield from parts(item)


def _root(package: str) -> Path:
    return Path(str(files(package)))


def _file(module: str) -> Path:
    """The file of a module, or of a package; it need not be there."""
    package, *inner = module.split(".")
    path = _root(package).joinpath(*inner)
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def code_digest(paths: Iterable[Path], text: str = "") -> str:
    """Short digest of modules and data files (`.json`), whatever their names and order, and of a text beside them."""
    digest = hashlib.sha256(text.encode())
    for part in sorted(hashlib.sha256(_content(path)).digest() for path in paths):
        digest.update(part)
    return digest.hexdigest()[:12]


def _content(path: Path) -> bytes:
    return syntax(path.read_text(encoding="utf-8")).encode() if path.suffix == ".py" else path.read_bytes()


@cache
def syntax(source: str) -> str:
    """What a module does, as text: its syntax tree without docstrings, comments, positions and type hints.

    Imports count by the names that they bring, in alphabetical order; which module of ours a name comes from does not
    count, because that module is digested itself.
    """
    tree = ast.parse(source)
    imported = sorted({name for node in ast.walk(tree) for name in _imported_names(node)})
    return "\n".join([*imported, ast.dump(_Stripped().visit(tree))])


def _imported_names(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [f"{_foreign(alias.name)} as {alias.asname}" for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        return [f"{_foreign(node.module or '')}.{alias.name} as {alias.asname}" for alias in node.names]
    return []


def _foreign(module: str) -> str:
    """The name of another project's module; nothing for one of ours."""
    return "" if module.split(".")[0] in PACKAGES else module


class _Stripped(ast.NodeTransformer):
    """Drops from a syntax tree what does not run, and imports, which `syntax` lists by themselves."""

    def visit_Import(self, node: ast.Import) -> ast.Pass:
        return ast.Pass()

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.Pass:
        return ast.Pass()

    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.annotation = None
        return node

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            node.returns = None
        for block in ("body", "orelse", "finalbody"):
            statements = getattr(node, block, None)
            if isinstance(statements, list):
                setattr(node, block, [s for s in statements if not _is_silent(s)])
        return node


def _is_silent(statement: ast.stmt) -> bool:
    """True for a docstring, or another constant without effect, and for what does nothing."""
    return isinstance(statement, ast.Pass) or (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    )

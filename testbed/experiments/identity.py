"""Which code made a run: results of different digests must not be mixed.

What all runs share (scenarios, sensors, the multi-object tracker, the scores) has one digest. Each tracker has its own,
of its parameters and of the modules behind its filter, so that a new or changed tracker leaves the runs of the others
valid. A digest counts what runs: the syntax of a module, not its words, its layout, its name or its place.
"""

import ast
import hashlib
import re
import sys
from collections.abc import Callable, Container, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from scenarios import PROBES, SCENARIOS
from scenarios.native import module_of_id
from scenarios.traffic.scenario import FAMILY, is_replay, replay_of
from sensors import RADARS
from sensors import find as find_radar
from testbed import planners
from testbed.environment.registration import scenario_of
from testbed.frame import TRUTH
from trackers import TRACKERS, SensorModel, build
from trackers.lookup import home, parse, search_here
from trackers.toml_file import SUFFIX

PACKAGES = ("scenarios", "sensors", "testbed", "trackers")  # ours; their modules may be renamed and moved
SHARED = ("scenarios", "sensors")  # whole packages
ROOTS = ("trackers.multi.tracker",)  # modules that count with all of `trackers` that they import
SCORES = (  # modules of testbed that decide about rows
    "frame",
    "environment.belief", "environment.episode", "environment.observation", "environment.perception",
    "environment.wrapper",
    "planners.car_following", "planners.collision", "planners.idm", "planners.prediction", "planners.registry",
    "planners.track_vehicle",
    "evaluation.drive_evaluator", "evaluation.driving", "evaluation.ends", "evaluation.histories",
    "evaluation.identities", "evaluation.metric", "evaluation.metrics", "evaluation.pair_errors", "evaluation.span",
    "evaluation.tracking",
    "experiments.episode", "experiments.rows", "experiments.run", "replay.recording", "replay.rescan",
)  # fmt: skip
CATALOGUES: Mapping[str, Callable[[], Container[str]]] = {
    "tracker": lambda: {*TRACKERS, TRUTH},
    "planner": lambda: planners.PLANNERS,  # loads highway-env
    "radar": lambda: RADARS,
    "scenario": lambda: {**SCENARIOS, **PROBES},
}
ADDRESS = re.compile(r" at 0x[0-9a-f]+")  # in the text of an object that is no dataclass
TABLES = {"trackers.htg.bins": "htg/tables", "trackers.pmht.model": "pmht/models"}  # by the module that reads them


def shared_digest() -> str:
    """Short digest of the code behind every run, whatever the tracker."""
    return code_digest([*_world(), *map(_file, closure(ROOTS))])


def world_digest(scenarios: Iterable[str]) -> str:
    """The same without any tracker: of scenarios, sensors, planners and measures.

    Where none of the scenarios is a probe, the table of the probes and what builds only them do not count.
    """
    builders, probing = ({str(s.builder).partition(":")[0] for s in table.values()} for table in (SCENARIOS, PROBES))
    idle = set() if PROBES.keys() & set(scenarios) else {"scenarios.probes", *probing} - builders
    left_out = set(map(_file, idle))
    return code_digest(path for path in _world() if path not in left_out)


def _world() -> list[Path]:
    whole = [path for package in SHARED for path in sorted(_root(package).rglob("*.py"))]
    return [*whole, *(_file(f"testbed.{name}") for name in SCORES)]


def modules_digest(modules: Iterable[str]) -> str:
    """Short digest of modules, and of all modules of packages, by their full names."""
    paths = [_file(name) for name in modules]
    whole = [path.parent.rglob("*.py") if path.name == "__init__.py" else [path] for path in paths]
    return code_digest(path for group in whole for path in group)


def project_digest() -> str:
    """Short digest of all our code and data but the baselines of `testbed regress`, which are results of runs."""
    held = _root("testbed") / "experiments" / "baselines.json"
    paths = [p for package in PACKAGES for p in _root(package).rglob("*") if p.suffix in (".py", ".json")]
    return code_digest(path for path in paths if path != held)


def tracker_digest(name: str) -> str:
    """Short digest of a tracker: its parameters, and all of `trackers` that the modules of its filter import.

    Of a user's tracker also the modules of the user, see `own_modules`.
    """
    tracker, own = build(name, (SensorModel(),)), own_module(name, "tracker")
    kinds = {type(part) for part in (tracker, *parts(tracker))}
    modules = {kind.__module__ for kind in kinds}
    bases = {base.__module__ for kind in kinds for base in kind.__mro__}
    used = set(closure(sorted(m for m in bases if m.startswith("trackers."))))
    files: dict[str, Path] = {}
    for module in sorted({m for m in modules if not m.startswith("trackers.")} | ({own} if own else set())):
        files |= own_modules(module)
    used |= {name for path in files.values() for name in closure(_imports(path))}
    folders = [_root("trackers") / folder for module, folder in TABLES.items() if module in used]
    tables = [path for folder in folders for path in sorted(folder.rglob("*.json"))]
    return code_digest([*map(_file, used), *files.values(), *tables], ADDRESS.sub("", repr(tracker)))


def own_names(
    scenarios: Iterable[str] = (), radars: Iterable[str] = (), planners: Iterable[str] = ()
) -> list[tuple[str, str]]:
    """Those of the names that are not in the catalogues, each as (what it is, name)."""
    given = {"scenario": scenarios, "radar": radars, "planner": planners}
    return [(what, name) for what, names in given.items() for name in names if own_module(name, what)]


def own_code(names: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Digests of what users have given as (what, name), of its code and parameters, under `code of WHAT NAME`."""
    find: dict[str, Callable[[str], Any]] = {"scenario": scenario_of, "radar": find_radar, "planner": planners.find}
    return {
        f"code of {what} {name}": code_digest(
            own_modules(own_module(name, what) or "").values(), ADDRESS.sub("", repr(find[what](name)))
        )
        for what, name in names
    }


def own_module(name: str, what: str) -> str | None:
    """The module of a user behind a name, with or without parameters; None for one of a catalogue, or of a file.

    Recorded traffic has its file, as `replay:FILE`.
    """
    if what == "planner" and name.startswith(planners.OF_FILES):
        return None
    if what == "scenario" and is_replay(name):
        return f"{FAMILY}{replay_of(name).file}"
    if what == "scenario" and (module := module_of_id(name)):
        return None if module.startswith("highway_env.") else module
    entry = parse(name)[0]
    if entry.endswith(SUFFIX):
        builder = getattr(scenario_of(name), "builder", "") if what == "scenario" else ""
        return builder.partition(":")[0] or name
    path = None if entry in CATALOGUES[what]() else home(entry, what)
    return None if path is None else path.partition(":")[0]


def own_modules(module: str) -> dict[str, Path]:
    """A module that is not ours and what it imports of the same package, or folder, directly or not: name -> file.

    A module without a source file, and one of ours or of the standard library, has none. Recorded traffic has its file.
    """
    if is_replay(module):
        return {module: Path(replay_of(module).file)}
    top = _source(module.partition(".")[0])
    if top is None or module.partition(".")[0] in {*PACKAGES, *sys.stdlib_module_names}:
        return {}
    folder, found, todo = top.parent, dict[str, Path](), {module}
    while todo:
        name = todo.pop()
        path = _source(name)
        if path is not None and path.is_relative_to(folder) and name.partition(".")[0] not in PACKAGES:
            found[name] = path
            todo |= {n for n in _names(path) if n not in found and _within_reach(n, module, top)}
    return found


def _within_reach(name: str, module: str, top: Path) -> bool:
    """Whether a module is of the same package as `module`, or where that is a file alone, a file beside it."""
    if top.name == "__init__.py" or "site-packages" in top.parts:
        return name.partition(".")[0] == module.partition(".")[0]
    return name.partition(".")[0] not in sys.stdlib_module_names


def _source(module: str) -> Path | None:
    """The source file of an importable module, None where there is none."""
    search_here()
    with suppress(ImportError, ValueError, AttributeError):  # its package is none, or has no such module
        spec = find_spec(module)
        if spec is not None and spec.origin is not None and spec.origin.endswith(".py"):
            return Path(spec.origin).resolve()
    return None


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
    return frozenset(n for n in _names(path) if n.startswith("trackers.") and _file(n).is_file())


@cache
def _names(path: Path) -> frozenset[str]:
    """Full names of all that a module imports, of modules and of what is in them."""
    names = set[str]()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return frozenset(names)


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
    return "\n".join([*imported, _dumped(_Stripped().visit(tree))])


def _dumped(node: Any) -> str:
    """A syntax tree as text, the same of every version of Python: what is empty, which some leave out, is left out."""
    if isinstance(node, ast.AST):
        parts = (f"{name}={_dumped(value)}" for name, value in ast.iter_fields(node) if value not in (None, []))
        return f"{type(node).__name__}({', '.join(parts)})"
    return f"[{', '.join(map(_dumped, node))}]" if isinstance(node, list) else repr(node)


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

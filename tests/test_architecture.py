"""The arrows of the project and its few outright bans, read off the source of every module."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("trackers", "sensors", "scenarios", "testbed", "studies")
FOLDERS = {package: ROOT / ("docs" if package == "studies" else "") / package for package in PACKAGES}

# Package -> what its modules may import besides themselves and the standard library; testbed may import everything.
FLOORS = {
    "trackers": ("numpy", "scipy", "numba"),
    "sensors": (
        "numpy",
        "trackers.compiled",
        "trackers.geometry",
        "trackers.lookup",
        "trackers.scan",
        "trackers.toml_file",
    ),
    "scenarios": (
        "numpy",
        "highway_env",
        "gymnasium",
        "sensors.scene",
        "trackers.geometry",
        "trackers.lookup",
        "trackers.toml_file",
    ),
}
# Rooms of testbed, modules and folders directly in it, by floor from the ground up; a room imports lower floors only.
ROOMS = (
    ("frame", "files", "limits"),
    ("evaluation", "planners"),
    ("log", "metrics"),
    ("environment", "command_line"),
    ("replay", "check", "learn", "bench", "__init__"),
    ("experiments",),
    ("cli",),
)
# Library -> modules, or packages, that may import it.
HOMES = {
    "highway_env": (
        "scenarios",
        "testbed.environment",
        "testbed.planners",
        "testbed.bench",
    ),
    "gymnasium": ("scenarios.highway", "scenarios.adapter", "scenarios.native", "testbed", "studies"),
    "rerun": ("testbed.log",),
    "numba": ("trackers.compiled.jit",),
}
LEAVES = ("studies",)  # beside the documentation and out of the wheel: nothing else may import it
FIGURES = re.compile(r"^(?:testbed|studies)\.(?:\w+\.)*\w*figures?\w*$")  # modules that may draw with matplotlib
CATCHES_ALL = {
    "testbed.experiments.run",  # one failed run of thousands is reported, and must not stop the others
    "testbed.check.report",  # so is one law that the code of a user does not get through
}
SEEDED = {"Generator", "SeedSequence", "BitGenerator", "PCG64", "default_rng"}

# Hosts of package registries and paths of one machine; the brackets keep these lines from matching themselves.
REGISTRY = re.compile(
    r"https?://[\w.-]*(?:py[p]i|python[h]osted|np[m]js|ana[c]onda|crate[s]\.io|artifac[t]ory)|-[-](?:extra-)?index-url"
)
MACHINE_PATH = re.compile(r"(?<![\w.~:/-])/(?:ho[m]e|roo[t]|wor[k]|User[s])/\w|\b[A-Z]:\\User[s]")


def source_files() -> dict[str, Path]:
    """Module name -> file, over the four packages and the studies of the documentation."""
    files = [file for package in FOLDERS.values() for file in sorted(package.rglob("*.py"))]
    return {module_name(file): file for file in files}


def module_name(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    parts = parts[1:] if parts[0] == "docs" else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def within(module: str, homes: tuple[str, ...]) -> bool:
    return any(module == home or module.startswith(home + ".") for home in homes)


def imports(tree: ast.AST) -> Iterator[str]:
    """Full names of all that is imported, at the top or inside functions; `from a import b` gives a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" if not node.level else "." for alias in node.names)


def allowed(name: str, package: str) -> bool:
    library = name.split(".")[0]
    own = library == package or library in sys.stdlib_module_names
    return own or package not in FLOORS or within(name, FLOORS[package])


def import_faults(module: str, tree: ast.AST) -> Iterator[str]:
    package = module.split(".")[0]
    for name in imports(tree):
        library = name.split(".")[0]
        if library == "":
            yield f"{module}: a relative import; write it absolute"
        elif not allowed(name, package):
            yield f"{module} imports {name}; {package} may import {', '.join(FLOORS[package])}"
        if library in HOMES and not within(module, HOMES[library]):
            yield f"{module} imports {library}, which belongs in {', '.join(HOMES[library])}"
        if within(name, LEAVES) and not within(module, LEAVES):
            yield f"{module} imports {name}, which only makes pages; move what is shared below it"
        if library == "matplotlib" and not FIGURES.match(module):
            yield f"{module} imports matplotlib; figures are drawn in modules named so"
        if library == "random":
            yield f"{module} imports random, whose state is global; take an np.random.Generator"


def is_numpy_random(node: ast.AST) -> bool:
    return ast.unparse(node) in ("np.random", "numpy.random")


def is_default_rng(node: ast.AST) -> bool:
    return ast.unparse(node).rpartition(".")[2] == "default_rng"


def ban_faults(module: str, tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr not in SEEDED and is_numpy_random(node.value):
            yield f"{module}:{node.lineno} uses the global np.random.{node.attr}; take a Generator"
        if isinstance(node, ast.Call) and not (node.args or node.keywords) and is_default_rng(node.func):
            yield f"{module}:{node.lineno} makes a generator without a seed"
        if isinstance(node, ast.ExceptHandler):
            caught = "everything" if node.type is None else ast.unparse(node.type)
            if module not in CATCHES_ALL and re.search(r"\b(?:everything|Exception|BaseException)\b", caught):
                yield f"{module}:{node.lineno} catches {caught}; name the errors that can be handled"


def text_faults(name: str, text: str) -> list[str]:
    lines = enumerate(text.splitlines(), 1)
    return [
        f"{name}:{i} {m[0]!r}" for i, line in lines for m in [REGISTRY.search(line) or MACHINE_PATH.search(line)] if m
    ]


def faults(module: str, source: str) -> list[str]:
    tree = ast.parse(source)
    return [*import_faults(module, tree), *ban_faults(module, tree)]


def import_graph(sources: dict[str, str]) -> dict[str, set[str]]:
    """Module -> modules of ours that it imports; a name of a package's own counts as the package."""
    graph: dict[str, set[str]] = {}
    for module, source in sources.items():
        names = (name if name in sources else name.rpartition(".")[0] for name in imports(ast.parse(source)))
        graph[module] = {name for name in names if name in sources and name != module}
    return graph


def find_cycle(sources: dict[str, str]) -> list[str]:
    """A circle of imports, or nothing."""
    try:
        TopologicalSorter(import_graph(sources)).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def room_of(module: str) -> str:
    """The room of testbed that a module lies in; what starts the command line belongs to it."""
    room = module.split(".")[1] if "." in module else "__init__"
    return "cli" if room == "__main__" else room


def floor_faults(sources: dict[str, str]) -> list[str]:
    """Imports within testbed that do not run downwards, and rooms that stand on no floor."""
    floors = {room: floor for floor, rooms in enumerate(ROOMS, 1) for room in rooms}
    found = []
    for module, names in import_graph(sources).items():
        room = room_of(module)
        if not within(module, ("testbed",)):
            continue
        if room not in floors:
            found.append(f"{module} is in a room that stands on no floor; give {room} one")
            continue
        for name in sorted(names):
            other = room_of(name)
            beside = not within(name, ("testbed",)) or other == room
            if not beside and floors[room] <= floors.get(other, 0):
                found.append(f"{module}, floor {floors[room]}, imports {name}, floor {floors[other]}")
    return found


def own_sources() -> dict[str, str]:
    return {module: file.read_text(encoding="utf-8") for module, file in source_files().items()}


def test_imports_run_downwards_and_libraries_stay_in_their_homes():
    sources = own_sources()
    assert {module.split(".")[0] for module in sources} == set(PACKAGES)
    assert [fault for module, source in sources.items() for fault in faults(module, source)] == []


def test_modules_do_not_import_each_other_in_circles():
    assert find_cycle(own_sources()) == []


def test_rooms_of_testbed_import_lower_floors_only():
    sources = own_sources()
    assert floor_faults(sources) == []
    there = {room_of(module) for module in sources if within(module, ("testbed",))}
    assert there == {room for rooms in ROOMS for room in rooms}
    assert [len(rooms) for rooms in ROOMS] == [3, 2, 2, 2, 5, 1, 1]


@pytest.mark.parametrize(
    ("module", "source", "words"),
    [
        ("testbed.log.writer", "def f():\n    from testbed.environment.wrapper import TrackedEnv", "floor 3, imports"),
        ("testbed.replay.command", "import testbed.check.laws", "floor 5, imports testbed.check.laws, floor 5"),
        ("testbed.bench", "from testbed.cli import main", "floor 5, imports testbed.cli, floor 7"),
        ("testbed.attic.store", "import numpy", "on no floor; give attic one"),
    ],
)
def test_an_import_of_the_same_or_a_higher_floor_and_a_room_of_no_floor_are_caught(module, source, words):
    (fault,) = floor_faults({**own_sources(), module: source})
    assert words in fault


def test_tests_draw_seeded_numbers_and_catch_named_errors():
    files = sorted((ROOT / "tests").rglob("*.py"))
    assert [
        f for file in files for f in ban_faults(module_name(file), ast.parse(file.read_text(encoding="utf-8")))
    ] == []


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="asks git for the files; this is no checkout")
def test_no_file_names_a_package_registry_or_a_path_of_one_machine():
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listing, cwd=ROOT, capture_output=True, check=True, text=True).stdout.split("\0")
    found = []
    for file in (ROOT / name for name in names if name):
        content = file.read_bytes() if file.is_file() else b""
        if b"\0" not in content:
            found += text_faults(str(file.relative_to(ROOT)), content.decode("utf-8", "replace"))
    assert found == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("trackers.filter", "import shapely"),
        ("trackers.filter", "from sensors.scene import Scene"),
        ("trackers.filter", "def f():\n    from testbed import metrics"),
        ("trackers.imm", "from numba import njit"),
        ("sensors.radar", "import scipy.stats"),
        ("sensors.radar", "from trackers.estimate import Estimate"),
        ("sensors.radar", "from trackers import TRACKERS"),
        ("scenarios.roads", "from sensors import RADARS"),
        ("scenarios.courses", "import gymnasium"),
        ("scenarios.courses", "from .roads import road"),
        ("testbed.evaluation.metrics", "import highway_env"),
        ("testbed.evaluation.metrics", "import rerun as rr"),
        ("testbed.evaluation.metrics", "import matplotlib.pyplot as plt"),
        ("testbed.evaluation.metrics", "import random"),
        ("testbed.bench.chosen", "from studies.page import frame"),
        ("testbed.cli", "import studies"),
        ("testbed.evaluation.metrics", "import numpy as np\nnp.random.seed(0)"),
        ("testbed.evaluation.metrics", "import numpy as np\nx = np.random.rand(3)"),
        ("testbed.evaluation.metrics", "import numpy as np\nrng = np.random.default_rng()"),
        ("testbed.evaluation.metrics", "try:\n    f()\nexcept Exception:\n    pass"),
        ("testbed.evaluation.metrics", "try:\n    f()\nexcept (ValueError, BaseException):\n    pass"),
        ("testbed.evaluation.metrics", "try:\n    f()\nexcept:\n    pass"),
    ],
)
def test_an_offending_module_is_caught(module, source):
    assert len(faults(module, source)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("trackers.filter", "import numpy as np\nfrom scipy.special import erf\nfrom trackers.linalg import outer"),
        ("sensors.radar", "from dataclasses import dataclass\nfrom trackers.scan import Scan"),
        ("scenarios.highway", "import gymnasium\nfrom highway_env import utils\nfrom sensors.scene import Scene"),
        ("testbed.log.writer", "import rerun as rr"),
        ("trackers.compiled.jit", "from numba import njit"),
        ("studies.papers.figures", "import matplotlib.pyplot as plt"),
        ("studies.modes.page", "from studies.page import frame"),
        (
            "testbed.experiments.single",
            "import numpy as np\nrng = np.random.default_rng(3)\ntry:\n    f()\nexcept OSError:\n    pass",
        ),
    ],
)
def test_an_innocent_module_passes(module, source):
    assert faults(module, source) == []


def test_a_circle_is_caught_also_through_a_package():
    circle = {"a": "from a.b import f", "a.b": "import a.c", "a.c": "from a import f"}
    assert set(find_cycle(circle)) == {"a", "a.b", "a.c"}
    assert find_cycle({**circle, "a.c": "import numpy"}) == []


@pytest.mark.parametrize(
    "line",
    [
        "see https://" + "py" + "pi.org/project/numpy",
        "pip install --extra" + "-index-url somewhere",
        "data lies in " + "/ho" + "me/user/data",
        "open('" + "/wor" + "k/runs')",
        "C:" + "\\Users\\name",
    ],
)
def test_a_registry_or_machine_path_in_a_text_is_caught(line):
    assert len(text_faults("README.md", f"fine\n{line}\n")) == 1


@pytest.mark.parametrize("line", ["https://github.com/home/page", "runs/work/x", "a rooted /work", "numpy>=2"])
def test_ordinary_text_passes(line):
    assert text_faults("README.md", line) == []

import ast
import inspect
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.experiments import identity
from trackers import TRACKERS, find
from trackers.random_matrix import koch

SOURCE = inspect.getsource(koch)
TREE = ast.parse(SOURCE)
CONSTANTS = [n for n in ast.walk(TREE) if isinstance(n, ast.Constant) and isinstance(n.value, float | int)]


def reworded(source: str) -> str:
    """The same code with other docstrings, no comments, other line breaks and a note at the end."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Expr(ast.Constant("Other words."))
    return ast.unparse(tree) + "\n\n# a note at the end\n"


def test_every_tracker_has_a_digest_of_its_own():
    digests = {name: identity.tracker_digest(name) for name in TRACKERS}
    assert len(set(digests.values())) == len(TRACKERS)
    assert all(len(digest) == 12 for digest in digests.values())


def test_a_digest_stays():
    assert identity.shared_digest() == identity.shared_digest()
    assert identity.tracker_digest("htg-map") == identity.tracker_digest("htg-map")


def test_the_modules_of_a_filter_are_those_that_it_imports():
    found = identity.closure(["trackers.random_matrix.feldmann"])
    assert "trackers.linalg" in found
    assert "trackers.motion.turn" in found
    assert not any(name.startswith(("trackers.htg", "trackers.multi")) for name in found)


def test_the_catalogue_itself_counts_for_nobody():
    everything = identity.closure([*identity.ROOTS, *(type(entry.filter).__module__ for entry in TRACKERS.values())])
    assert "trackers.registry" not in everything


def test_what_builds_probes_alone_counts_only_where_a_scenario_is_a_probe(monkeypatch):
    counted = []
    monkeypatch.setattr(identity, "code_digest", lambda paths: counted.append({path.stem for path in paths}))
    identity.world_digest(["cut-in", "merge"])
    identity.world_digest(["cut-in", "probe-merge"])
    assert counted[1] - counted[0] == {"encounters", "probes"}
    assert {"registry", "junctions", "longitudinal", "driving", "rescan"} < counted[0]


def test_a_reworded_and_moved_module_keeps_its_digest(tmp_path):
    (tmp_path / "koch.py").write_text(SOURCE)
    (tmp_path / "filters").mkdir()
    moved = tmp_path / "filters" / "koch_rm.py"
    moved.write_text(reworded(SOURCE).replace("from trackers.", "from trackers.filters."))
    assert moved.read_text() != SOURCE
    assert identity.code_digest([moved]) == identity.code_digest([tmp_path / "koch.py"])


@given(st.sampled_from(CONSTANTS))
def test_a_changed_constant_loses_the_digest(constant):
    lines = SOURCE.splitlines()
    row, start, end = constant.lineno - 1, constant.col_offset, constant.end_col_offset
    lines[row] = lines[row].encode()[:start].decode() + "(17.25)" + lines[row].encode()[end:].decode()
    assert identity.syntax("\n".join(lines)) != identity.syntax(SOURCE)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("x = 1\ny = 2", "y = 2\nx = 1"),
        ("def f(a=1):\n    return a", "def f(a=2):\n    return a"),
        ("from numpy import sin", "from scipy.special import sin"),
        ("from trackers.linalg import outer", "from trackers.linalg import cross as outer"),
        ("class A:\n    x: int = 1", "class A:\n    x: int = 2"),
        ("@property\ndef f(self):\n    return 1", "def f(self):\n    return 1"),
    ],
)
def test_what_runs_counts(one, other):
    assert identity.syntax(one) != identity.syntax(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("from trackers.a import f\nfrom trackers.b import g", "from trackers.b import g\nfrom trackers.c import f"),
        ("def f(a: int) -> int:\n    'Doc.'\n    return a", "def f(a):\n    return a"),
        ("class A:\n    'Doc.'", "class A:\n    pass"),
        ("if x:\n    import trackers.a\n    y()", "import trackers.a\nif x:\n    y()"),
    ],
)
def test_what_does_not_run_does_not_count(one, other):
    assert identity.syntax(one) == identity.syntax(other)


def test_data_files_count(tmp_path):
    for name, text in (("a", "[1]"), ("b", "[2]")):
        (tmp_path / f"{name}.json").write_text(text)
    assert identity.code_digest([tmp_path / "a.json"]) != identity.code_digest([tmp_path / "b.json"])


def test_filters_inside_of_filters_count():
    modules = {type(part).__module__ for part in identity.parts(find("rm-vmm"))}
    assert {
        "trackers.random_matrix.virtual_measurements",
        "trackers.random_matrix.koch",
        "trackers.random_matrix.adaptation",
    } <= modules


def test_parameters_count():
    filter = find("rm-feldmann")
    assert repr(replace(filter, sigma=0.3)) != repr(filter)  # the text that goes into the digest


@pytest.mark.parametrize("name", TRACKERS)
def test_no_place_on_this_machine_is_part_of_a_digest(name):
    assert not re.search(r"[/\\]", repr(find(name)))


def test_learned_models_of_contours_count():
    assert set(identity.TABLES) & set(identity.closure(["trackers.pmht.filter"])) == {"trackers.pmht.model"}
    assert set(identity.TABLES) & set(identity.closure(["trackers.htg.map"])) == {"trackers.htg.bins"}


@pytest.fixture
def user(tmp_path, monkeypatch):
    """A folder of a user on the path, with two modules of which one imports the other."""
    (tmp_path / "my_helper.py").write_text("RATE = 5.0\n")
    (tmp_path / "my_rigs.py").write_text(
        "from dataclasses import replace\nfrom my_helper import RATE\nfrom sensors import RADARS\n"
        "from trackers import RandomMatrix\n\n"
        "slow = replace(RADARS['front'], rate=RATE)\nfast = replace(slow, rate=9.0)\n"
        "tuned = RandomMatrix(sigma=0.4)\n\n\n"
        "class Mine:\n    def act(self, env):\n        return 1\n\n\nmine = Mine()\n"
    )
    monkeypatch.setattr("sys.path", [*identity.sys.path, str(tmp_path)])
    yield tmp_path
    for name in ("my_rigs", "my_helper"):
        identity.sys.modules.pop(name, None)


def test_two_radars_of_one_module_are_told_apart_and_those_of_the_catalogue_have_no_code_of_their_own(user):
    names = identity.own_names(["cut-in"], ["surround", "my_rigs:slow", "my_rigs:fast"], ["idm", "learned:x.npz"])
    assert names == [("radar", "my_rigs:slow"), ("radar", "my_rigs:fast")]
    digests = identity.own_code(names)
    assert list(digests) == ["code of radar my_rigs:slow", "code of radar my_rigs:fast"]
    assert len(set(digests.values())) == 2


def test_the_code_of_a_user_counts_with_what_it_imports_from_its_folder(user):
    assert set(identity.own_modules("my_rigs")) == {"my_rigs", "my_helper"}
    before = identity.own_code([("planner", "my_rigs:mine")]), identity.tracker_digest("my_rigs:tuned")
    assert before == (identity.own_code([("planner", "my_rigs:mine")]), identity.tracker_digest("my_rigs:tuned"))
    (user / "my_helper.py").write_text("# a comment\nRATE = 5.0\n")
    identity._names.cache_clear()
    assert before == (identity.own_code([("planner", "my_rigs:mine")]), identity.tracker_digest("my_rigs:tuned"))
    (user / "my_helper.py").write_text("RATE = 6.0\n")
    after = identity.own_code([("planner", "my_rigs:mine")]), identity.tracker_digest("my_rigs:tuned")
    assert before[0] != after[0]
    assert before[1] != after[1]


def test_parameters_and_the_filters_of_the_project_count_too(user):
    digests = {identity.tracker_digest(f"my_rigs:tuned{p}") for p in ("", ":sigma=0.5", ":rho=0.3")}
    assert len(digests) == 3
    assert digests.isdisjoint({identity.tracker_digest("rm-feldmann:sigma=0.4")})


def test_the_standard_library_and_the_project_are_nobodys_own():
    assert identity.own_modules("dataclasses") == identity.own_modules("trackers.imm") == {}
    assert identity.own_modules("no_such_module") == {}

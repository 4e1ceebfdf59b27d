"""What a wheel carries besides modules, and the version that it says."""

import tomllib
from fnmatch import fnmatch
from itertools import chain
from pathlib import Path

import pytest
from packaging.version import Version

import testbed
from tests.lowest import constraints, floors

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGES = ("trackers", "sensors", "scenarios", "testbed")


def requirements() -> list[str]:
    """All that we ask for, with the extras."""
    extras = PROJECT["project"]["optional-dependencies"].values()
    wanted = chain(PROJECT["project"]["dependencies"], *extras)
    return [name for name in wanted if not name.startswith("eot-testbed")]


def dependencies() -> set[str]:
    """Their names in lower case; brackets stay."""
    return {name.partition(">")[0].lower() for name in requirements()}


def pins() -> dict[str, str]:
    """Name in lower case -> version in constraints.txt."""
    return dict(line.lower().split("==") for line in (ROOT / "constraints.txt").read_text().splitlines())


def carried(file: Path) -> bool:
    """Whether [tool.setuptools.package-data] names the file."""
    known = PROJECT["tool"]["setuptools"]["package-data"].items()
    patterns = [f"{package.replace('.', '/')}/{pattern}" for package, found in known for pattern in found]
    return any(fnmatch(file.relative_to(ROOT).as_posix(), pattern) for pattern in patterns)


def test_data_files_of_the_packages_travel_with_them():
    """On failure: add the file to [tool.setuptools.package-data] in pyproject.toml."""
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*") if file.is_file()]
    data = [file for file in files if file.suffix not in (".py", ".pyc", ".md")]
    assert len(data) > 20
    assert [str(file) for file in data if not carried(file)] == []


def test_type_checkers_of_users_see_our_types():
    assert all((ROOT / package / "py.typed").is_file() for package in PACKAGES)


def test_the_version_is_that_of_the_project():
    assert testbed.__version__ == PROJECT["project"]["version"]


def test_the_pins_are_plain_and_cover_what_we_ask_for():
    assert {name.partition("[")[0] for name in dependencies()} <= set(pins())


def test_every_dependency_has_a_floor_at_or_below_its_pin():
    pinned = pins()
    for name, floor in floors(requirements()).items():
        assert Version(floor) <= Version(pinned[name]), name
    with pytest.raises(ValueError, match="'numpy' has no floor; write NAME>=VERSION"):
        floors(["numpy"])


def test_the_oldest_environment_has_our_floors_and_the_pins_of_the_tools():
    oldest, project, tools = constraints(), PROJECT["project"], ("pytest", "hypothesis")
    asked = floors([*project["dependencies"], *project["optional-dependencies"]["dask"]])
    assert {name: oldest[name] for name in asked} == asked
    assert {name: oldest[name] for name in tools} == {name: pins()[name] for name in tools}


def test_every_dependency_has_a_reason():
    page = (ROOT / "docs" / "dependencies.md").read_text()
    assert [name for name in dependencies() if f"| {name} |" not in page] == []

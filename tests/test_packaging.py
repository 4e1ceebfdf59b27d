"""What a wheel carries besides modules, and the version that it says."""

import tomllib
from fnmatch import fnmatch
from itertools import chain
from pathlib import Path

import testbed

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGES = ("trackers", "sensors", "scenarios", "testbed")


def dependencies() -> set[str]:
    """Names of all that we ask for, in lower case; brackets stay."""
    extras = PROJECT["project"]["optional-dependencies"].values()
    wanted = chain(PROJECT["project"]["dependencies"], *extras)
    return {name.partition(">")[0].lower() for name in wanted if not name.startswith("eot-testbed")}


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
    pins = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines())
    assert {name.partition("[")[0] for name in dependencies()} <= {name.lower() for name in pins}


def test_every_dependency_has_a_reason():
    page = (ROOT / "docs" / "dependencies.md").read_text()
    assert [name for name in dependencies() if f"| {name} |" not in page] == []

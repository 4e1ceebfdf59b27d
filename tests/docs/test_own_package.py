"""docs/examples as a package that pip installs: its entries have names of their own in every command."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"
NAMES = {"trackers": ["centroid"], "radars": ["double"], "scenarios": ["escape", "narrow"], "planners": ["gap"]}


def call(*words, **options):
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def by_pip(source, site):
    """As a user installs it, without a network; skipped where pip has nothing to build with."""
    pytest.importorskip("wheel", reason="a package is built with setuptools and wheel, which are not installed")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--target", str(site)]
    call("pip", "install", *options, str(source))


def by_hand(source, site):
    """What pip writes: the modules, and the entry points of the package."""
    project = tomllib.loads((source / "pyproject.toml").read_text())
    for module in project["tool"]["setuptools"]["py-modules"]:
        site.mkdir(exist_ok=True)
        shutil.copy(source / f"{module}.py", site)
    about, groups = project["project"], project["project"]["entry-points"]
    metadata = site / f"{about['name'].replace('-', '_')}-{about['version']}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n")
    lines = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in own.items()) for group, own in groups.items()]
    (metadata / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture(scope="module", params=[by_hand, by_pip])
def installed(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("package")
    source = folder / "source"
    source.mkdir()
    for file in [EXAMPLES / "pyproject.toml", *EXAMPLES.glob("own_*.py")]:
        shutil.copy(file, source)
    request.param(source, folder / "site")
    (folder / "elsewhere").mkdir()
    path = os.pathsep.join([str(folder / "site"), str(ROOT)])
    return {"cwd": folder / "elsewhere", "env": {**os.environ, "PYTHONPATH": path}}


def test_the_catalogues_show_its_entries(installed):
    shown = call("testbed", "list", **installed)
    for names in NAMES.values():
        assert all(name in shown for name in names)
    assert shown.count("my-entries 0.1.0") == 5


def test_its_names_stand_where_those_of_the_catalogue_do(installed):
    for scenario in NAMES["scenarios"]:
        options = [
            "--tracker",
            "centroid",
            "--radar",
            "double",
            "--planner",
            "gap",
            "--duration",
            "0.4",
            "--log",
            "off",
        ]
        call("testbed", "run", scenario, *options, **installed)
        (written,) = (installed["cwd"] / "runs").glob(f"{scenario}_centroid_double_gap_*.json")

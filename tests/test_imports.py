"""What starts quickly: which libraries an import or a command leaves alone."""

import subprocess
import sys

import pytest

DRAWING = ("matplotlib.pyplot", "rerun", "scipy.stats")
HEAVY = (
    *DRAWING,
    "scipy",
    "pandas",
    "pyarrow",
    "pygame",
    "shapely",
    "highway_env",
    "dask",
    "joblib",
    "jinja2",
    "PIL",
    "numba",
)
LOADED = """
import sys
{code}
for name in {names}:
    if name in sys.modules:
        print(name)
"""
HELP = "from testbed.cli import app\napp(['--help'], standalone_mode=False)\nprint('---')"


def loaded(code, names):
    """Those of some modules that are executed by a piece of code in a fresh process."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(code=code, names=names)], capture_output=True, text=True, check=True
    )
    return done.stdout.rpartition("---\n")[2].split()


@pytest.mark.parametrize("code", ["import testbed", "import testbed.cli", HELP, "import trackers", "import sensors"])
def test_what_only_names_things_loads_no_heavy_library(code):
    assert loaded(code, HEAVY) == []


def test_a_run_loads_the_simulator_when_its_environment_is_made():
    needed = ("scipy", "shapely")
    late = (*(name for name in HEAVY if name not in needed), "matplotlib", "scipy.optimize")
    assert loaded("import testbed.experiments.single", late) == []
    code = "from testbed.experiments import single\nsingle.planners.find('idm')"  # highway-env brings pyplot
    assert loaded(code, ("highway_env", *DRAWING)) == ["highway_env", "matplotlib.pyplot"]

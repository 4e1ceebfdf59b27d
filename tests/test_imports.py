"""What starts quickly: which libraries an import or a command leaves alone."""

import subprocess
import sys

import pytest

DRAWING = ("matplotlib.pyplot", "rerun", "scipy.stats")
HEAVY = (*DRAWING, "scipy", "pandas", "pyarrow", "pygame", "shapely", "highway_env", "dask", "joblib", "jinja2", "PIL")
LOADED = """
import sys
{code}
for name in {names}:
    module = sys.modules.get(name)
    if module is not None and "_LazyModule" not in str(type(module)):
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


def test_a_run_draws_nothing_and_needs_no_statistics():
    assert loaded("import testbed.run", (*DRAWING, "scipy.optimize")) == []


def test_the_check_sees_what_is_loaded():
    assert loaded("import testbed.run, scipy.stats, matplotlib.pyplot as plt; plt.rc", DRAWING) == [
        "matplotlib.pyplot",
        "scipy.stats",
    ]


def test_a_deferred_module_is_the_real_one_at_first_use():
    code = "import testbed.run\nimport matplotlib.pyplot as plt\nassert plt.figure and plt.__file__"
    assert loaded(code, DRAWING[:1]) == ["matplotlib.pyplot"]

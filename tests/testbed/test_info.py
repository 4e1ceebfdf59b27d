"""`testbed info` and results say which form ran; a home that cannot be written to stops nothing."""

import os
import subprocess
import sys

import pytest

from testbed.command_line.info import extras, info
from trackers.compiled import REFUSED, available, cache_folder, form

FORM = """
from testbed.environment.registration import make
from testbed.files import provenance
env = make("cut-in", tracker="imm-spline{options}", radar="surround{options}", warm_up=0.3)
env.reset(seed=0)
print(provenance()["compiled"])
"""
COMPILED = pytest.mark.skipif(not available(), reason="needs the extra `fast`")


def cells(table):
    return dict(zip(*(column.cells for column in table.columns), strict=True))


def test_info_names_versions_extras_form_and_cache(monkeypatch):
    assert cells(info())["Python"] == sys.version.split()[0]
    assert {"dask", "dev"} <= {*extras()}
    if available():
        assert cells(info())["tracker and radar"].startswith(form())
        assert str(cache_folder()) in cells(info())["cache of the filter"]
    monkeypatch.setenv(REFUSED, "off")
    assert cells(info())["tracker and radar"].startswith("numpy")
    assert form() == "numpy"


def run(options, **environment):
    done = subprocess.run(
        [sys.executable, "-c", FORM.format(options=options)],
        capture_output=True, text=True, check=True, env=os.environ | environment,
    )  # fmt: skip
    return done.stdout.strip(), done.stderr


@COMPILED
def test_results_say_which_form_ran():
    assert run("")[0] == f"radar, tracker, filter by {form()}"
    assert run(":compiled=off")[0] == "nothing"
    assert run("", EOT_COMPILED="off")[0] == "nothing"


@COMPILED
@pytest.mark.slow
def test_a_home_that_cannot_be_written_to_compiles_without_a_cache_and_says_so():
    out, err = run("", NUMBA_CACHE_DIR="/dev/null")
    assert out == f"radar, tracker, filter by {form()}"
    assert err.count("is not writable: what is compiled is not kept\n") == 3  # one sentence for each cache
    assert err.count("compiling the ") == err.count("compiled the ") == 8

"""Settings of every test run, before numpy is imported, and what tests of several commands share."""

import os
import resource
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import settings

# Tests run on all cores already (`pytest -n auto`): threads of the linear algebra would only wait for each other.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# Programs that tests start find the studies of the documentation, as tests do by pytest's `pythonpath`.
STUDIES = str(Path(__file__).resolve().parents[1] / "docs")
os.environ["PYTHONPATH"] = os.pathsep.join([STUDIES, *filter(None, [os.environ.get("PYTHONPATH")])])

# Properties draw the same examples in every run; with EXPLORE=N (`make explore`) N new ones each.
settings.register_profile("repeated", derandomize=True, database=None, deadline=None, max_examples=20)
settings.register_profile("explored", database=None, deadline=None, max_examples=int(os.environ.get("EXPLORE", 20)))
settings.load_profile("explored" if "EXPLORE" in os.environ else "repeated")


class Done(NamedTuple):
    """What a command leaves on its streams."""

    status: int
    out: str
    err: str


@pytest.fixture
def limit_files():
    """Inside `with limit_files(n)` no file of this process may be larger than n bytes, as on a disk that is full.

    It ends before pytest says how the test ended, in what may be a larger file.
    """

    @contextmanager
    def limit(size):
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limit


@pytest.fixture
def command(monkeypatch, capsys):
    """`testbed ARGS` in this process, on a plain terminal of 80 columns."""

    from testbed import cli  # after the threads are set

    def call(*args):
        monkeypatch.setattr(sys, "argv", ["testbed", *map(str, args)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return Done(ended.value.code or 0, *capsys.readouterr())

    for name, value in {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}.items():
        monkeypatch.setenv(name, value)
    return call

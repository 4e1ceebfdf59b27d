"""What tests of several commands share."""

import resource
import sys
from typing import NamedTuple

import pytest

from testbed import cli


class Done(NamedTuple):
    """What a command leaves on its streams."""

    status: int
    out: str
    err: str


@pytest.fixture
def limit_files():
    """limit_files(n): from now on no file of this process may be larger than n bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def command(monkeypatch, capsys):
    """`testbed ARGS` in this process, on a plain terminal of 80 columns."""

    def call(*args):
        monkeypatch.setattr(sys, "argv", ["testbed", *map(str, args)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return Done(ended.value.code or 0, *capsys.readouterr())

    for name, value in {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}.items():
        monkeypatch.setenv(name, value)
    return call

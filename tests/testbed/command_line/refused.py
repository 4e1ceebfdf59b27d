"""Command lines as a user types them."""

from typing import Any

from typer.testing import CliRunner

from testbed.cli import app


def refused(*args: Any) -> str:
    """The one sentence with which a command line is refused."""
    done = CliRunner().invoke(app, [str(arg) for arg in args])
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith("testbed: ")
    assert done.stderr.count("\n") == 1
    return done.stderr

"""docs/own-tracks.md: the walk from a recording over a tracker in C to a scored table, in at most ten commands."""

import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.command_line import reviewing

DOCS = Path(__file__).parents[2] / "docs"
PROGRAM = DOCS / "examples" / "tracker.c"
COMMANDS = re.search(r"```bash\n(.*?)```", (DOCS / "own-tracks.md").read_text(), re.S).group(1).splitlines()


def test_the_walk_is_short():
    assert len(COMMANDS) <= 10
    assert len(PROGRAM.read_text().splitlines()) <= 70


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_the_commands_of_the_page_work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(PROGRAM, tmp_path)
    pages = []
    monkeypatch.setattr(reviewing, "show", lambda paths, options, console: pages.extend(paths))  # has tests of its own
    for line in COMMANDS:
        if not line.startswith("testbed"):
            strict = line.replace("cc ", "cc -std=c99 -Wall -Wextra -Werror -pedantic ")
            subprocess.run(["sh", "-c", strict], check=True, env=os.environ, timeout=60)
            continue
        if line.startswith("testbed compare"):
            continue  # its report takes long; tests/testbed/experiments/test_recorded.py has comparisons
        done = CliRunner().invoke(app, shlex.split(line)[1:])
        assert done.exit_code == 0, done.output
        if " score " in line:
            assert re.search(r"GOSPA \[m\] +[\d.]+ +[\d.]+ *\n", done.output)
    assert len(list(Path("mine").iterdir())) == 4
    assert [path.is_file() for path in pages] == [True]

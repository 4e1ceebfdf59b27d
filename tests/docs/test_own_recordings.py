"""docs/own-recordings.md: its commands and its program work, one after the other."""

import re
import shlex
from pathlib import Path

from typer.testing import CliRunner

from testbed.cli import app

PAGE = (Path(__file__).parents[2] / "docs" / "own-recordings.md").read_text()


def block(language):
    return re.search(rf"```{language}\n(.*?)```", PAGE, re.S).group(1)


def test_the_commands_and_the_program_of_the_page_work(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for line in block("bash").splitlines():
        program, *arguments = shlex.split(line)
        assert program == "testbed"
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    assert {path.suffix for path in tmp_path.glob("runs/cut-in_rm-surface+rm-koch_replay.*")} == {
        ".parquet",
        ".rrd",
        ".json",
    }
    exec(compile(block("python"), "own-recordings.md", "exec"), {})
    assert re.search(r"runs/cut-in_rm-koch_replay\.parquet \d+", capsys.readouterr().out)

"""docs/real-traffic.md: its commands work on a recording, its tables have the columns and parameters that are read."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scenarios.traffic.layouts import LAYOUTS, OWN
from scenarios.traffic.scenario import KEYS
from testbed.cli import app
from tests.scenarios.traffic.recorded import own, traffic

PAGE = (Path(__file__).parents[2] / "docs" / "real-traffic.md").read_text()
COMMANDS = re.search(r"```bash\n(.*?)```", PAGE, re.S).group(1).splitlines()


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=[pytest.mark.slow] if c.split()[1] == "compare" else []) for c in COMMANDS]
)
def test_the_command_works(command, tmp_path, monkeypatch):
    own(tmp_path / "recording.csv", traffic(seconds=1.2))
    monkeypatch.chdir(tmp_path)
    program, *arguments = shlex.split(command)
    assert program == "testbed"
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output


def test_the_page_names_all_columns_and_parameters():
    rows = dict(re.findall(r"^\| (\w+) \| (.*?) \| ", PAGE, re.M))
    for layout in LAYOUTS[1:]:
        for column in layout.needed:
            assert f"`{column}`" in rows[layout.name]
    first = {name for cell in re.findall(r"^\| (`[^|]*) \|", PAGE, re.M) for name in re.findall(r"`(\w+)", cell)}
    assert first == {*OWN.columns.values(), *KEYS}

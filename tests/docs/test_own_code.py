"""docs/own-code.md: every command of the page works in the folder of the examples."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbed.cli import app

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "own-code.md").read_text()
COMMANDS = [line for block in re.findall(r"```bash\n(.*?)```", PAGE, re.S) for line in block.splitlines()]
CONFIG = re.search(r"such as `(\{.*?\})`", PAGE).group(1)
SLOW = {"bench", "compare", "regret"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for file in [*(DOCS / "examples").glob("own_*.py"), DOCS / "examples" / "whole_tracker.py"]:
        shutil.copy(file, tmp_path)
    (tmp_path / "cfg.json").write_text(CONFIG)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_page_has_a_command_for_each_kind_of_entry():
    for example in (
        "own_filter:Kalman",
        "whole_tracker:Nearest",
        "own_planner:act",
        "own_radar:double",
        "own_scenario:scenario",
    ):
        assert any("check" in c and example in c for c in COMMANDS)
        assert any(" run " in c and example in c for c in COMMANDS)


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=[pytest.mark.slow] if c.split()[1] in SLOW else []) for c in COMMANDS]
)
def test_the_command_works(command, folder):
    program, *arguments = shlex.split(command)
    assert program == "testbed"
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    if arguments[0] == "run":
        results = [path.name for path in folder.glob("runs/*.json")]
        assert len(results) == 1
        own = [name for name in arguments if name.startswith(("own_", "whole_"))]
        assert all(name.replace(":", "~") in results[0] for name in own)


def test_a_filter_of_stone_soup_in_a_whole_tracker_keeps_all_laws(folder):
    pytest.importorskip("stonesoup", reason="Stone Soup is no dependency; docs/own-code.md says what was measured")
    done = CliRunner().invoke(app, ["check", "tracker", "whole_tracker:Nearest:filter=StoneSoup"])
    assert done.exit_code == 0, done.output

"""docs/own-code.md: every command of the page works in the folder of the examples."""

import json
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
    for file in (DOCS / "examples").glob("*.py"):
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


@pytest.mark.parametrize(("library", "tracker"), [("filterpy", "Points"), ("stonesoup", "Soup")])
def test_a_tracker_over_another_library_keeps_all_laws_and_repeats(library, tracker, folder):
    pytest.importorskip(library, reason=f"{library} is no dependency; docs/examples needs it")
    name = f"{library}_tracker:{tracker}"
    done = CliRunner().invoke(app, ["check", "tracker", name])
    assert done.exit_code == 0, done.output
    runs = []
    for _ in range(2):
        made = CliRunner().invoke(app, ["run", "passed", "--tracker", name, "--duration", "2", "--log", "off"])
        assert made.exit_code == 0, made.output
        (file,) = folder.glob("runs/*.json")
        runs.append(json.loads(file.read_text())["trackers"][name])
        file.unlink()
    assert runs[0] == runs[1]
    assert runs[0]["missed_percent"] < 100

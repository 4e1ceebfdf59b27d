"""docs/comparing.md: its examples run on a real folder."""

import re
from pathlib import Path

import pytest

from testbed.experiments.command import execute
from testbed.experiments.compare import Comparison, Settings, write_runs
from testbed.experiments.engine import Engine
from testbed.experiments.store import Results
from testbed.replay.recording import load
from testbed.replay.rescan import write_log

PAGE = Path(__file__).parents[2] / "docs" / "comparing.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    home = tmp_path_factory.mktemp("comparing")
    out = home / "runs" / "compare"
    comparison = Comparison(("xia2020-lane",), ("rm-feldmann",), (0, 1), Settings(duration=1.0), out=str(out))
    assert execute(comparison, Engine()).done == 2
    write_runs(Results.read(comparison))
    for seed in (0, 1):
        recording = load(out / "recordings" / f"xia2020-lane_seed{seed}.npz", "xia2020-lane", seed, "surround")
        write_log(recording, ("rm-feldmann",), out / "logs")
    return home


@pytest.mark.parametrize("code", re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S), ids=lambda c: c.split()[1])
def test_the_examples_run(code, folder, monkeypatch, capsys):
    if "polars" in code:
        pytest.importorskip("polars", reason="polars is not installed")
    monkeypatch.chdir(folder)
    exec(compile(code, PAGE.name, "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out.strip()

"""The README: short, every figure is that of a committed result, its program runs, its pictures are there."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from studies.comparison.publish import read
from testbed.evaluation.metric import METRICS
from testbed.experiments.statistics import cells
from trackers import DEFAULT

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
PROSE = re.sub(r"```.*?```|Python >= [\d.]+", "", README, flags=re.S)
MEASURES = {  # first cell of a row -> measure
    "GOSPA": "gospa",
    "position": "rmse_position",
    "velocity": "rmse_velocity",
    "length": "rmse_length",
    "NEES": "nees_position",
}


@pytest.fixture(scope="module")
def results():
    return read(ROOT / "docs" / "results")[0]


@pytest.fixture(scope="module")
def figures(results):
    """(tracker, measure) -> mean, low, high as printed, of the trackers that the README names."""
    named = tuple(t for t in results.study.trackers if f"`{t}`" in PROSE)
    spans = results.spans[results.spans["tracker"].isin(named)]
    comparison = replace(results.study, trackers=named)
    found = cells(replace(results, study=comparison, spans=spans), tuple(MEASURES.values()))
    return {
        (c.tracker, c.measure): tuple(
            f"{x:.{METRICS[c.measure].digits}f}" for x in (c.mean.value, c.mean.low, c.mean.high)
        )
        for c in found
    }


def test_the_readme_is_short():
    assert len(README.encode()) <= 6000


def test_the_table_holds_the_default_tracker(figures):
    rows = {
        cells[0]: cells[1]
        for line in PROSE.splitlines()
        if (cells := line.strip("| ").split(" | ")) and len(cells) == 3
    }
    for name, measure in MEASURES.items():
        mean, low, high = figures[DEFAULT, measure]
        unit = METRICS[measure].unit.replace("1", "")
        assert rows[name] == f"{mean} {unit}".strip() + f" [{low}, {high}]"


def test_every_decimal_figure_comes_from_the_results(figures):
    assert set(re.findall(r"\d+\.\d+", PROSE)) <= {x for found in figures.values() for x in found}


def test_the_table_says_what_was_run(results):
    comparison = results.study
    assert (
        f"over {len(comparison.scenarios)} scenarios and {len(comparison.seeds)} seeds "
        f"(each {comparison.settings.length}, radar `{comparison.settings.radar}`)"
    ) in PROSE


def test_the_program_runs(tmp_path):
    code = re.search(r"```python\n(.*?)```", README, re.S).group(1)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "track at" in done.stdout

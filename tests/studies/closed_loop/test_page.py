"""Trackers side by side: the page from results, and a short run through the command."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import typer

from studies.closed_loop.page import MEANS, TOTALS, by_scenario, files, main, overview, render, run_all
from testbed.run import RunConfig

COMMAND = [sys.executable, "-m", "studies", "closed-loop"]
NAMES = ("rm-feldmann", "rm-surface")


def result(scenario, **gospa):
    """What a run leaves behind, as far as the page shows it: length error 2 x GOSPA, ms a scan 10 x, totals 3."""
    rest = dict.fromkeys(key for key, _, _ in MEANS[1:-2]) | dict.fromkeys(TOTALS, 3)
    return {
        "run": {
            "scenario": scenario,
            "radar": "r",
            "planner": "p",
            "trackers": list(gospa),
            "versions": {"numpy": "2"},
        },
        "drive": {"collisions": 1, "elapsed": 5.0},
        "trackers": {n: {**rest, "gospa": g, "rmse_length": 2 * g} for n, g in gospa.items()},
        "timing": {
            "wall": 2.0,
            "cpu": 1.0,
            "trackers": {n: {"ms_per_scan": 10 * g, "us_per_update": None} for n, g in gospa.items()},
        },
    }


def cells(table):
    head, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return {row[0]: dict(zip(head[1:], row[1:], strict=True)) for row in rows}


def test_the_overview_has_means_and_totals_and_a_dash_for_what_was_not_measured():
    table = cells(overview([result("x", a=1.0, b=4.0), result("y", a=2.0, b=6.0)]))
    assert set(table) == {"`a`", "`b`"}
    picked = ("GOSPA [m]", "length [m]", "ms a scan", "us an update", "lost")
    assert [table["`a`"][key] for key in picked] == ["1.50", "3.00", "15.0", "–", "6"]
    assert table["`b`"]["GOSPA [m]"] == "5.00"


def test_gospa_by_scenario_is_the_mean_over_its_seeds():
    table = cells(by_scenario([result("x", a=1.0), result("x", a=2.0), result("y", a=4.0)]))
    assert table == {"x": {"a": "1.50"}, "y": {"a": "4.00"}}


def test_the_page_says_what_was_run():
    said = render([result("x", a=1.0)] * 2)
    for part in ("2 runs, 10 simulated", "in all runs: 2", "50 % of a core", "numpy 2"):
        assert part in said


def test_a_short_run_through_the_command_leaves_page_figure_and_results(tmp_path):
    options = [
        "--out",
        str(tmp_path),
        "--docs",
        str(tmp_path),
        "--scenario",
        "cut-in",
        "--duration",
        "1",
        "--tracker",
        NAMES[0],
        "--tracker",
    ]
    done = subprocess.run([*COMMAND, *options, NAMES[1]], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "cut-in, seed 0: GOSPA rm-feldmann" in done.stderr
    assert (tmp_path / "pictures" / "length-error.png").is_file()
    config = RunConfig("cut-in", NAMES, duration=1.0, out=str(tmp_path), log="off")
    results, lengths = files(config)
    costs = json.loads(results.read_text())["timing"]["trackers"]
    assert set(costs) == set(NAMES)
    assert all(cost["us_per_update"] > 0 and cost["ms_per_scan"] > 0 for cost in costs.values())
    with np.load(lengths) as arrays:
        assert set(arrays) == set(NAMES)
        assert np.array_equal(arrays[NAMES[0]][:2], arrays[NAMES[1]][:2])  # the same vehicles, the same shares
    table = cells((tmp_path / "closed-loop.md").read_text().partition("by scenario")[2].split("\n\n")[2])
    assert set(table["cut-in"]) == set(NAMES)

    before = lengths.stat().st_mtime_ns
    (again,) = run_all([config], reuse=True)
    assert lengths.stat().st_mtime_ns == before
    assert again.result == json.loads(results.read_text())
    assert set(again.lengths) == set(NAMES)
    (short,) = run_all([replace(config, duration=0.2)], reuse=True)
    assert short.result["drive"]["elapsed"] == pytest.approx(0.2)  # another duration is another run
    assert lengths.stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("option", "message"),
    [({"tracker": ["htg-mapp"]}, "did you mean 'htg-map'"), ({"seed": [0, -1]}, "seed must not be negative, got -1")],
)
def test_what_cannot_be_run_is_refused_before_anything_is_run(tmp_path, capsys, option, message):
    with pytest.raises(typer.Exit) as stop:
        main(docs=tmp_path, out=tmp_path / "runs", **option)
    assert stop.value.exit_code == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.json"))

"""Trackers side by side: the page from results, and a short run through the command."""

import numpy as np
import pytest
import typer

from studies.closed_loop.page import MEANS, RESULTS, TOTALS, Family, by_scenario, lengths, main, overview, render
from testbed.experiments.run import Run
from testbed.experiments.store import Results

NAMES = ("rm-feldmann", "rm-surface")


def result(**gospa):
    """What a run leaves behind, as far as the page shows it: length error 2 x GOSPA, ms a scan 10 x, totals 3."""
    rest = dict.fromkeys(MEANS[1:-2]) | dict.fromkeys(TOTALS, 3)
    return {
        "drive": {"collisions": 1, "elapsed": 5.0},
        "trackers": {
            n: {**rest, "gospa": g, "rmse_length": 2 * g, "ms_per_scan": 10 * g, "us_per_update": None}
            for n, g in gospa.items()
        },
    }


def cells(table):
    head, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return {row[0]: dict(zip(head[1:], row[1:], strict=True)) for row in rows}


def test_the_overview_has_means_and_totals_and_a_dash_for_what_was_not_measured():
    table = cells(overview([result(a=1.0, b=4.0), result(a=2.0, b=6.0)]))
    assert set(table) == {"`a`", "`b`"}
    picked = ("GOSPA [m]", "length RMSE [m]", "cost of a scan [ms]", "cost of an update [us]", "lost")
    assert [table["`a`"][key] for key in picked] == ["1.50", "3.00", "15.0", "–", "6"]
    assert table["`b`"]["GOSPA [m]"] == "5.00"


def test_gospa_by_scenario_is_the_mean_over_its_seeds():
    table = by_scenario([("x", result(a=1.0)), ("x", result(a=2.0)), ("y", result(a=4.0))])
    assert table == "scenario,a\nx,1.50\ny,4.00\n"


def test_the_page_says_what_was_run():
    meta = {"result": result(a=1.0), "seconds": {"wall": 2.0, "cpu": 1.0}}
    said = render({Run("cut-in", 0): meta, Run("cut-in", 1): meta}, ["a"])
    for part in ("2 runs, 10 simulated", "in all runs: 2", "50 % of a core", "numpy 2"):
        assert part in said


def test_a_short_run_through_the_command_leaves_page_figure_and_results_and_is_not_repeated(tmp_path, capsys):
    out = str(tmp_path / "runs")
    options = {"docs": tmp_path, "out": out, "scenario": ["cut-in"], "duration": 1.0, "tracker": list(NAMES)}
    main(**options)
    assert (tmp_path / "pictures" / "length-error.png").is_file()
    run = Run("cut-in", 0, NAMES[0], duration=1.0)
    results = Results.read(Family(trackers=NAMES, asked=(run,), out=out))
    found = results.metas[run]["result"]
    assert set(found["trackers"]) == set(NAMES)
    assert found["drive"]["elapsed"] == pytest.approx(1.0)
    assert all(row["us_per_update"] > 0 and row["ms_per_scan"] > 0 for row in found["trackers"].values())
    samples = lengths(results)
    assert set(samples) == set(NAMES)
    for one, other in zip(samples[NAMES[0]][:2], samples[NAMES[1]][:2], strict=True):
        assert np.array_equal(one, other)  # the same vehicles, the same shares
    head, row = (tmp_path / "results" / RESULTS).read_text().splitlines()
    assert head == ",".join(("scenario", *NAMES))
    assert row.startswith("cut-in,")
    assert "1 runs made, 0 found" in capsys.readouterr().out
    main(**options)
    assert "0 runs made, 1 found" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("option", "message"),
    [({"tracker": ["htg-mapp"]}, "did you mean 'htg-map'"), ({"seed": [0, -1]}, "seed must not be negative, got -1")],
)
def test_what_cannot_be_run_is_refused_before_anything_is_run(tmp_path, capsys, option, message):
    with pytest.raises(typer.Exit) as stop:
        main(docs=tmp_path, out=str(tmp_path / "runs"), **option)
    assert stop.value.exit_code == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.json"))

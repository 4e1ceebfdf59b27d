"""The search for the hardest setting: bisection, quantiles over seeds, and the command."""

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.record import Parameter
from testbed.cli import app
from testbed.experiments.probe import accepted, find_probe, limit, limits, parameter_of

GAP = Parameter("gap", 30.0, 60.0, 6.0, "m", "between the bumpers")
WEAVE = Parameter("weave", 0.5, 0.0, 1.0, "m", "towards the lane of the ego")


@pytest.mark.parametrize(("easy", "hard"), [(60.0, 6.0), (0.0, 1.0)])
@pytest.mark.parametrize("share", [0.2, 0.77])
def test_the_limit_is_survived_and_a_little_more_is_not(easy, hard, share):
    edge = easy + share * (hard - easy)
    found = limit(lambda value: abs(value - easy) <= abs(edge - easy), easy, hard, resolution=0.01)
    assert abs(found - easy) <= abs(edge - easy) <= abs(found - easy) + 0.01


def test_where_everything_or_nothing_is_survived_there_is_no_search():
    tried = []
    assert limit(lambda value: tried.append(value) or True, 60.0, 6.0, 0.5) == 6.0
    assert np.isnan(limit(lambda value: tried.append(value) or False, 60.0, 6.0, 0.5))
    assert tried == [6.0, 6.0, 60.0]


def test_the_cost_of_tracking_is_the_difference_of_the_settings_that_19_of_20_seeds_survive():
    truth = np.arange(11.0, 31.0)  # seed k survives a gap of 11 + k m
    found = limits(truth, truth + 3.0, GAP)
    assert [found.truth.value, found.tracks.value, found.cost.value, found.mean_cost.value] == [29.0, 32.0, 3.0, 3.0]
    assert found.cost.low == found.cost.high == 3.0  # every seed costs as much, and the seeds stay together
    assert found.truth.low < 29.0 <= found.truth.high


def test_a_parameter_that_is_harder_when_greater_costs_when_it_must_be_less():
    truth = np.linspace(0.8, 0.42, 20)
    found = limits(truth, truth - 0.1, WEAVE)
    assert [found.truth.value, found.tracks.value] == pytest.approx([0.44, 0.34])
    assert found.cost.value == pytest.approx(0.1)
    assert found.truth.low <= found.truth.value <= found.truth.high


def test_two_of_twenty_seeds_that_survive_nothing_leave_no_limit():
    tracks = np.append(np.full(18, 10.0), [np.nan, np.nan])
    assert limits(np.full(20, 9.0), tracks, GAP).tracks.value == np.inf
    assert limits(np.full(20, 9.0), np.append(tracks[:18], [10.0, np.nan]), GAP).tracks.value == 10.0


def test_the_first_parameter_is_the_default_and_others_are_named():
    assert parameter_of("probe-cutin", None).name == "gap"
    with pytest.raises(LookupError, match="no parameter of probe-cutin 'slow'; did you mean 'slower'"):
        parameter_of("probe-cutin", "slow")


def call(tmp_path, *options):
    return CliRunner().invoke(app, ["probe", *options, "--out", str(tmp_path)])


def test_the_command_finds_limits_and_finds_them_again(tmp_path):
    options = ("probe-brake", "--tracker", "rm-feldmann", "--seeds", "0", "--resolution", "20")
    first = call(tmp_path, *options)
    assert first.exit_code == 0, first.output
    assert "hardest that 95% of the seeds survive, on the truth" in first.stdout
    files = {file.name: file.stat().st_mtime_ns for file in (tmp_path / "rows").iterdir()}
    assert len(files) == 2
    again = call(tmp_path, *options)
    assert "0 runs made, 2 found" in again.stdout
    assert again.stdout.partition("probe-brake, planner")[2] == first.stdout.partition("probe-brake, planner")[2]
    assert {file.name: file.stat().st_mtime_ns for file in (tmp_path / "rows").iterdir()} == files


ROW = {"collisions": 0, "deceleration_max": 3.0, "ttc_min": 2.0, "ttc_plane_min": 10.0, "progress": 100.0}


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, True),
        ({"collisions": 1}, False),
        ({"ttc_min": 3.5}, False),
        ({"ttc_min": 3.5, "ttc_plane_min": 2.9}, True),
        ({"ttc_plane_min": 1.0}, False),
    ],
)
def test_a_probe_is_accepted_where_it_is_neither_easy_nor_hopeless(changes, answer):
    assert accepted(find_probe("probe-brake"), [ROW | changes] * 3, [ROW | {"collisions": 1}] * 3) is answer


def test_a_probe_in_which_nothing_calls_for_braking_is_accepted_where_nobody_brakes():
    assert not accepted(find_probe("probe-passing"), [ROW], [ROW])
    assert accepted(find_probe("probe-passing"), [ROW | {"deceleration_max": 0.5}], [ROW])
    assert not accepted(find_probe("probe-passing"), [ROW | {"deceleration_max": 0.5, "collisions": 1}], [ROW])


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, False),  # it drives as on the truth
        ({"progress": 300.0}, False),  # farther than on the truth earns nothing, and costs nothing
        ({"collisions": 1}, True),
        ({"progress": 70.0}, True),  # 30 % of 5 in 12 parts of the score: 0.125
        ({"progress": 80.0}, False),  # 0.083
        ({"off_road": 0.1}, True),
    ],
)
def test_a_probe_that_a_blind_planner_passes_is_not_accepted(changes, answer):
    truth = ROW | {"progress": 100.0}
    assert (
        accepted(find_probe("probe-brake"), [truth] * 3, [truth | {"collisions": 1}] * 2 + [truth | changes]) is answer
    )


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("probe-brak",), "did you mean 'probe-brake'"),
        (("highway-v0",), "highway-v0 is an environment of highway-env"),
        (("highwy-v0",), "did you mean 'highway-v0'"),
        (("docs.examples.own_scenario:scenario",), "no parameter that can be made harder"),
        (("probe-brake", "--search", "gab"), "did you mean 'gap'"),
        (("probe-brake", "--tracker", "truth"), "the truth is what a tracker is compared with"),
        (("probe-brake", "--resolution", "0"), "resolution must be positive"),
    ],
)
def test_a_wrong_command_line_is_one_sentence(tmp_path, options, sentence):
    done = call(tmp_path, *options)
    assert done.exit_code == 2
    assert sentence in done.output

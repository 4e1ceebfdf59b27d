"""The cost of a frame with what a user names."""

import pytest

from testbed.bench.chosen import Choice, Spent, measure, table
from trackers import DEFAULT


def cells(shown):
    return [list(column.cells) for column in shown.columns]


def test_times_are_medians_a_frame_and_ratios_those_of_one_decision():
    # The second decision was disturbed: everything took ten times as long, which is in no ratio.
    spent = [Spent(0.03 * k, (0.06 * k, 0.12 * k), 0.03 * k) for k in (1.0, 10.0, 1.0)]
    names, times, first, simulation = cells(table("cut-in, radar front", ("a", "b"), spent, 3.0))
    assert names == ["a", "b", "scene and radar", "simulation, planner"]
    assert times == ["20.00", "40.00", "10.00", "10.00"]
    assert first == ["1.00", "2.00", "0.50", "0.50"]
    assert simulation == ["2.00", "4.00", "1.00", "1.00"]


def test_what_is_not_named_is_what_a_run_has():
    assert Choice.of(None, ["rm-koch"], None, True) == Choice(["cut-in"], ["rm-koch"], ["surround"], 3)
    assert Choice.of(["merge"], None, ["front"], False) == Choice(["merge"], [DEFAULT], ["front"], 10)


@pytest.mark.parametrize("scenario", ["lone-leader", "highway-v0:vehicles_count=3,duration=1"])
def test_all_that_a_run_takes_can_be_measured_also_beyond_its_end(scenario):
    steps = []
    (shown,) = measure(Choice([scenario], ["rm-koch"], ["front"], 2), lambda *step: steps.append(step))
    assert [float(x) > 0 for x in cells(shown)[1]] == [True] * 3
    assert steps == [(0, 1, scenario), (1, 1, "done")]


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        (Choice(["cut-inn"], ["rm-koch"], ["front"]), "did you mean 'cut-in'"),
        (Choice(["cut-in"], ["rm-koch"], ["sonar"]), "radar 'sonar'"),
        (Choice(["cut-in"], ["rm-koch", "rm-koch"], ["front"]), "different names"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_is_measured(choice, words):
    with pytest.raises((LookupError, ValueError), match=words):
        choice.check()

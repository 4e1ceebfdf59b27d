"""The laws over every registered filter, and for each law a filter that breaks it."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbed.check import examine_filter, laws, tracker_laws
from testbed.check.report import FILTER_LAWS, ONCE, OPTIONAL, TRACKER_LAWS, verdict
from testbed.check.tracker_laws import RADAR
from tests.testbed.check import broken
from trackers import TRACKERS, build, find, prior
from trackers.protocols import Shiftable

FILTERS = pytest.mark.parametrize("name", tuple(TRACKERS))


@FILTERS
@pytest.mark.parametrize("lead", [(), (1,), (3, 2)])
def test_a_batch_equals_the_loop(name, lead):
    laws.a_batch_equals_the_loop(find(name), lead=lead)


@FILTERS
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_order_and_padding_do_not_matter(name, seed):
    laws.order_and_padding_do_not_matter(find(name), seed)


@FILTERS
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-3, 3))
def test_turning_the_world_turns_the_answer(name, seed, turn):
    laws.turning_the_world_turns_the_answer(find(name), seed, turn)


@FILTERS
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), tiny=st.sampled_from([1e-6, 1e-3, 1.0]))
def test_covariances_stay_symmetric_and_positive(name, seed, tiny):
    laws.covariances_stay_symmetric_and_positive(find(name), seed, tiny)


DRAWN = (
    laws.a_batch_equals_the_loop,
    laws.order_and_padding_do_not_matter,
    laws.turning_the_world_turns_the_answer,
    laws.covariances_stay_symmetric_and_positive,
)


@FILTERS
@pytest.mark.parametrize(
    ("law", "cases"), [(law, ONCE if law is laws.without_a_detection_the_prediction_stands else cases)
                       for law, cases in FILTER_LAWS if law not in DRAWN], ids=lambda x: getattr(x, "__name__", "")
)  # fmt: skip
def test_the_other_laws_hold(name, law, cases):
    for case in cases:
        law(find(name), **case)


@FILTERS
def test_every_filter_can_be_shifted(name):
    assert isinstance(find(name), Shiftable)
    laws.a_shift_moves_the_estimate_and_nothing_else(find(name))


def test_resizing_changes_the_size_and_nothing_else():
    laws.a_resize_changes_the_size_and_nothing_else(find("rm-feldmann"))


@FILTERS
@pytest.mark.parametrize("law", TRACKER_LAWS, ids=lambda law: law.__name__)
def test_the_laws_of_a_tracker_hold(name, law):
    law(build(name, (RADAR,)))


# -- negative twins ---------------------------------------------------------------------------------------------------

TWINS = {
    laws.states_have_leading_axes: ((broken.SharedRow, "own row"), (broken.PlainTuple, "must be a NamedTuple")),
    laws.there_may_be_no_object: ((broken.NeedsOne, "zero-size array"),),
    laws.init_then_estimate_returns_the_prior: ((broken.Shifted, "is not the prior"),),
    laws.a_zero_time_step_changes_nothing: ((broken.GrowsWithoutTime, r"P\[0, 0, 0\] is 0.26, which should be 0.25"),),
    laws.a_prediction_moves_by_the_velocity: ((broken.StandsStill, "6.00 m from where the velocity leads"),),
    laws.without_a_detection_the_prediction_stands: ((broken.MovesBlind, "without a detection changes the state: m"),),
    laws.detections_draw_the_estimate: ((broken.Deaf, "still 1.00 m off"),),
    laws.a_batch_equals_the_loop: ((broken.MeanOfAll, r"in a batch \(1,\) is not what it is alone: m"),),
    laws.order_and_padding_do_not_matter: (
        (broken.FirstCounts, "another order"),
        (broken.PaddingLeaks, "is nan, which should be"),
    ),
    laws.turning_the_world_turns_the_answer: ((broken.AlongX, "not the answer turned"),),
    laws.covariances_stay_symmetric_and_positive: (
        (broken.Unsymmetric, "not symmetric"),
        (broken.Overdone, "not positive definite"),
    ),
    laws.all_detections_at_one_point_leave_a_finite_state: (
        (broken.FromSpread, "m is not finite, nan"),
        (broken.Faint, r"ZeroDivisionError: division by zero \(broken.py:\d+, in update\)"),
    ),
    laws.missing_range_rates_do_no_harm: ((broken.NeedsRates, "leave such out"),),
    laws.arguments_are_left_as_they_were: ((broken.WritesIntoState, "update writes into its argument"),),
    laws.a_filter_remembers_nothing: ((broken.Counts, "keeps nothing between calls"),),
    laws.states_can_be_chosen_and_stacked: ((broken.KeepsDict, "TypeError"),),
    laws.a_shift_moves_the_estimate_and_nothing_else: ((broken.HalfShift, r"pose\[0, 1\]"),),
    laws.a_resize_changes_the_size_and_nothing_else: ((broken.ResizeForgets, "its spread"),),
}


def test_a_filter_of_fifty_lines_keeps_all_laws():
    verdicts = examine_filter(broken.Centroid())
    assert len(verdicts) == len(FILTER_LAWS) + len(OPTIONAL) + len(TRACKER_LAWS)
    assert [v for v in verdicts if not v.holds] == []


def test_each_law_has_a_twin():
    assert TWINS.keys() == {law for law, _ in FILTER_LAWS} | {law for _, law in OPTIONAL}


@pytest.mark.parametrize(
    ("law", "twin", "sentence"),
    [(law, twin, sentence) for law, twins in TWINS.items() for twin, sentence in twins],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_a_broken_filter_is_caught_and_told_why(law, twin, sentence):
    cases = {**dict(FILTER_LAWS), **dict.fromkeys((law for _, law in OPTIONAL), ONCE)}
    found = verdict(law, twin(), cases[law])
    assert not found.holds
    assert re.search(sentence, found.fault)


class Restless:
    """A tracker that reports a new track a scan, at the origin."""

    def start(self):
        return build("rm-feldmann", (RADAR,)).start()

    def step(self, tracks, scan, dt):
        one = np.ones(1)
        estimate = prior(np.zeros((1, 3)))
        new = tracks._replace(id=np.full(1, tracks.next_id), existence=one, hits=one, age=0 * one, confirmed=one > 0)
        return new._replace(state=None, estimate=estimate, next_id=tracks.next_id + 1), None


class Forgetful:
    """A tracker that numbers its tracks beside them, and does not let them die."""

    def __init__(self):
        self.inner, self.last = build("rm-feldmann", (RADAR,)), 0
        self.start = self.inner.start

    def step(self, tracks, scan, dt):
        self.last += 1
        new, info = self.inner.step(tracks, scan, dt) if scan.mask.any() else (tracks, None)
        return new._replace(next_id=self.last), info


@pytest.mark.parametrize(
    ("law", "twin", "sentence"),
    [
        (tracker_laws.nothing_seen_is_nothing_tracked, Restless, "empty scans have made 1 tracks"),
        (tracker_laws.a_car_in_plain_view_becomes_one_track, Restless, r"is 34.0 m and 10.0 m/s off"),
        (tracker_laws.a_car_that_is_gone_loses_its_track, Forgetful, "1 tracks are still reported 2 s after"),
        (tracker_laws.a_tracker_remembers_nothing, Forgetful, "next_id is 30, which should be 15"),
    ],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_a_broken_tracker_is_caught_and_told_why(law, twin, sentence):
    found = verdict(law, twin())
    assert re.search(sentence, found.fault), found

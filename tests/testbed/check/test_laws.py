"""The laws over every registered filter, and for each law a filter that breaks it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios import PROBES, SCENARIOS, Scenario
from scenarios import find as find_scenario
from sensors import RADARS
from sensors import find as find_radar
from testbed.check import entry_laws, examine_filter, laws, tracker_laws
from testbed.check.draws import Broken, check_equal
from testbed.check.report import (
    FILTER_LAWS,
    ONCE,
    OPTIONAL,
    PLANNER_LAWS,
    RADAR_LAWS,
    SCENARIO_LAWS,
    TRACKER_LAWS,
    examine,
    examine_tracker,
    law_result,
)
from testbed.check.tracker_laws import RADAR
from testbed.planners import find as find_planner
from testbed.planners.idm import Choice
from tests.parameters import PROBE, rest_slow
from tests.testbed.check import broken
from trackers import TRACKERS, Tracks, build, find, prior
from trackers.composed import place_of
from trackers.filter import Abilities

FILTERS = pytest.mark.parametrize("name", tuple(TRACKERS))


@FILTERS
@pytest.mark.parametrize("lead", [(), (1,), (3, 2)])
def test_a_batch_equals_the_loop(name, lead):
    laws.a_batch_equals_the_loop(find(name), lead=lead)


@FILTERS
@given(seed=st.integers(0, 2**32 - 1))
def test_order_and_padding_do_not_matter(name, seed):
    laws.order_and_padding_do_not_matter(find(name), seed)


@FILTERS
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-3, 3))
def test_turning_the_world_turns_the_answer(name, seed, turn):
    laws.turning_the_world_turns_the_answer(find(name), seed, turn)


@FILTERS
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
    ("law", "cases"),
    [(law, cases) for law, cases in FILTER_LAWS if law not in DRAWN],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_the_other_laws_hold(name, law, cases):
    for case in cases:
        law(place_of(find(name)), **case)


@FILTERS
def test_every_filter_can_be_shifted(name):
    place = place_of(find(name))
    assert Abilities.of(place).has("shift")
    laws.a_shift_moves_the_estimate_and_nothing_else(place)


def test_resizing_changes_the_size_and_nothing_else():
    laws.a_resize_changes_the_size_and_nothing_else(find("rm-feldmann"))


@FILTERS
@pytest.mark.parametrize("law", TRACKER_LAWS, ids=lambda law: law.__name__)
def test_the_laws_of_a_tracker_hold(name, law):
    law(build(name, (RADAR,)))


@pytest.mark.parametrize("name", RADARS)
def test_the_laws_of_a_radar_hold(name):
    assert [v for v in examine(RADAR_LAWS, find_radar(name)) if not v.holds] == []


@pytest.mark.parametrize("name", ["idm", "idle", "mpc", "truth"])
def test_the_laws_of_a_planner_hold(name):
    assert [v for v in examine(PLANNER_LAWS, find_planner(name)) if not v.holds] == []


@pytest.mark.parametrize("name", rest_slow([*SCENARIOS, *PROBES], "cut-in", "roundabout", "articulated-turn", PROBE))
def test_the_laws_of_a_scenario_hold(name):
    assert [v for v in examine(SCENARIO_LAWS, find_scenario(name)) if not v.holds] == []


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
    results = examine_filter(broken.Centroid())
    assert len(results) == len(FILTER_LAWS) + len(OPTIONAL) + len(TRACKER_LAWS)
    assert [v for v in results if not v.holds] == []


def test_each_law_has_a_twin():
    assert TWINS.keys() == {law for law, _ in FILTER_LAWS} | {law for _, law in OPTIONAL}


@pytest.mark.parametrize(
    ("law", "twin", "sentence"),
    [(law, twin, sentence) for law, twins in TWINS.items() for twin, sentence in twins],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_a_broken_filter_is_caught_and_told_why(law, twin, sentence):
    cases = {**dict(FILTER_LAWS), **dict.fromkeys((law for _, law in OPTIONAL), ONCE)}
    found = law_result(law, twin(), cases[law])
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
    """A tracker that numbers its tracks beside them, also over a start, and does not let them die."""

    def __init__(self):
        self.inner, self.last = build("rm-feldmann", (RADAR,)), 0
        self.start = self.inner.start

    def step(self, tracks, scan, dt):
        self.last += 1
        new, info = self.inner.step(tracks, scan, dt) if scan.mask.any() else (tracks, None)
        return new._replace(next_id=self.last), info


class Spoilt:
    """A whole tracker around one of ours that spoils what it returns; a function of (tracks, scan) says how."""

    def __init__(self, spoil):
        self.inner, self.spoil = build("rm-feldmann", (RADAR,)), spoil
        self.start = self.inner.start

    def step(self, tracks, scan, dt):
        new, info = self.inner.step(tracks, scan, dt)
        return self.spoil(new, scan), info


def spoilt(**change):
    """Fields of the estimate, or of the tracks, changed by functions of their values."""

    def spoil(tracks, scan):
        e = tracks.estimate
        of = {name: work(getattr(e, name)) for name, work in change.items() if hasattr(e, name)}
        rest = {name: work(getattr(tracks, name)) for name, work in change.items() if not hasattr(e, name)}
        return tracks._replace(estimate=e._replace(**of), **rest)

    return lambda: Spoilt(spoil)


def renumbered():
    return Spoilt(lambda tracks, scan: tracks._replace(id=tracks.id + 7 * int(tracks.age.max(initial=0) * 10)))


def leaky():
    """A tracker that counts rows of the scan, whether they are detections or not."""
    return Spoilt(lambda tracks, scan: tracks._replace(hits=tracks.hits + len(scan.mask)))


class InPlace:
    """A tracker that hands out its own arrays, and goes on in them."""

    def __init__(self):
        self.inner = build("rm-feldmann", (RADAR,))
        self.start = self.inner.start

    def step(self, tracks, scan, dt):
        new, info = self.inner.step(tracks, scan, dt)
        tracks.estimate.pose[...] += 1.0
        return new, info


class KeepsObjects:
    """A whole tracker that keeps its state in itself, and a mere object in the tracks; it keeps all laws."""

    def start(self):
        self.inner = build("rm-feldmann", (RADAR,))
        self.mine = self.inner.start()
        return self.mine._replace(state=object())

    def step(self, tracks, scan, dt):
        self.mine, info = self.inner.step(self.mine, scan, dt)
        own = Tracks(*self.mine[:5], [object()] * len(self.mine.id), self.mine.estimate)
        return own, info


def test_a_whole_tracker_may_keep_its_state_in_itself():
    assert [v for v in examine_tracker(KeepsObjects()) if not v.holds] == []


def jagged(tracks, scan):
    contour = np.full((len(tracks.id), 5, 2), np.nan)
    return tracks._replace(estimate=tracks.estimate._replace(contour=contour))


SOUND = tracker_laws.every_step_returns_what_can_be_tracks


def nan_of(value):
    return value * np.nan


@pytest.mark.parametrize(
    ("law", "twin", "sentence"),
    [
        (SOUND, Restless, "step must return a tuple of Tracks and StepInfo, got .*NoneType"),
        (
            SOUND,
            spoilt(size=np.negative),
            r"^tracker Spoilt, step 1: length of track 0 is -.*positive",
        ),
        (
            SOUND,
            spoilt(pose=lambda p: p + np.array([0, 0, 90])),
            "heading of track 0 is .*np.radians",
        ),
        (SOUND, spoilt(pose=nan_of), "x of track 0 is nan; it must be finite"),
        (SOUND, spoilt(existence=lambda p: 100 * p), "existence of track 0 is .*a probability within 0 and 1"),
        (SOUND, spoilt(existence=np.negative), "existence of track 0 is -.*a probability within 0 and 1"),
        (SOUND, spoilt(age=nan_of), "age of track 0 is nan"),
        (SOUND, spoilt(yaw_rate=lambda w: w + np.inf), "yaw_rate of track 0 is inf"),
        (SOUND, spoilt(heading_std=lambda s: -1 - s), "heading_std of track 0 is -.*not negative"),
        (SOUND, spoilt(cov=np.negative), "cov of track 0 has the eigenvalue -"),
        (SOUND, spoilt(cov=nan_of), "cov of track 0 is not finite"),
        (SOUND, spoilt(cov=lambda P: P + np.eye(4, k=1)), r"cov of track 0 is not symmetric, by 1; return \(P"),
        (
            SOUND,
            spoilt(size=lambda s: s[:, :1]),
            r"size must be an array .* \(\d, 2\), got .* \(\d, 1\)",
        ),
        (SOUND, spoilt(velocity=lambda v: v.tolist()), "velocity must be an array .*, got list"),
        (SOUND, spoilt(contour=lambda c: np.zeros((1, 5))), r"contour must have the shape \(T, C, 2\)"),
        (SOUND, lambda: Spoilt(jagged), "contour has a point that is not finite"),
        (SOUND, spoilt(id=lambda i: i[:, None]), r"id has the shape \(\d, 1\)"),
        (tracker_laws.a_car_keeps_its_id, renumbered, "a car in plain view has the ids"),
        (tracker_laws.padding_does_not_matter, leaky, r"mask is false change the tracks.*hits\[0\]"),
        (tracker_laws.a_start_begins_anew, InPlace, r"step writes into tracks .*pose"),
        (tracker_laws.nothing_seen_is_nothing_tracked, Restless, "empty scans have made 1 tracks"),
        (tracker_laws.a_car_in_plain_view_becomes_one_track, Restless, r"is 34.0 m and 10.0 m/s off"),
        (tracker_laws.a_car_that_is_gone_loses_its_track, Forgetful, "1 tracks are still reported 2 s after"),
        (tracker_laws.a_start_begins_anew, Forgetful, "next_id is 30, which should be 15"),
    ],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_a_broken_tracker_is_caught_and_told_why(law, twin, sentence):
    found = law_result(law, twin())
    assert re.search(sentence, found.fault), found


class Noisy:
    """A radar with a generator of its own, or with one fault more."""

    def __init__(self):
        self.rng = np.random.default_rng(0)
        self.models, self.rate = RADARS["front"].models, None

    def scan(self, scene, rng):
        return self.spoilt(*RADARS["front"].scan(scene, self.rng))

    def spoilt(self, scan, origin):
        return scan, origin


class SecondSensor(Noisy):
    def spoilt(self, scan, origin):
        return scan._replace(sensor=np.ones(len(scan.mask), int)), origin


class Blind(Noisy):
    def spoilt(self, scan, origin):
        return scan, origin._replace(object=np.full(len(origin.object), -1))


class TooFar(Noisy):
    def spoilt(self, scan, origin):
        polar = scan.polar.copy()
        polar[:1, 0] = 500.0
        return scan._replace(polar=polar), origin


class Backwards(Noisy):
    def __init__(self):
        super().__init__()
        self.rate = -1.0


def mounted_at(*mount):
    radar = Noisy()
    radar.models = (replace(radar.models[0], mount=mount),)
    return radar


class Restive:
    """A planner that counts on through all episodes, or does what else it must not."""

    knows_truth, calls = False, 0

    def choose(self, env):
        self.calls += 1
        return Choice(self.calls % 4, np.zeros((0, 2)))


class Wild(Restive):
    def choose(self, env):
        return Choice(99, np.zeros((0, 2)))


class Silent(Restive):
    def choose(self, env):
        return Choice(None, np.zeros((0, 2)))


class Pushes(Restive):
    def choose(self, env):
        env.unwrapped.road.vehicles[-1].position += 1.0
        return Choice(1, np.zeros((0, 2)))


def scenario_with(change):
    """The cut-in with a change of its world, which is made from the generator and a number that grows."""
    counter = iter(range(1000))
    built = find_scenario("cut-in")

    def build(rng):
        world = built.build(rng)
        return change(world, next(counter)) or world

    return Scenario("spoilt", "A cut-in that is not right.", build, built.vehicles)


def drifts(world, count):
    world.road.vehicles[1].speed += count


def loses_one(world, count):
    world.road.vehicles.pop()


def piles_up(world, count):
    world.road.vehicles[1].position = world.road.vehicles[2].position.copy()


def begins_late(world, count):
    return world._replace(phases=world.phases[1:])


@pytest.mark.parametrize(
    ("law", "twin", "sentence"),
    [
        (
            entry_laws.mounts_lie_on_a_vehicle,
            mounted_at(2.35, 0.0, 180.0),
            "sensor 0 has the heading 180 rad, more than",
        ),
        (entry_laws.mounts_lie_on_a_vehicle, mounted_at(2350.0, 0.0, 0.0), "mount of sensor 0 is 2350 m, 0 m from"),
        (entry_laws.a_scan_fits_the_data_sheets, SecondSensor(), "sensor must index the 1 models"),
        (entry_laws.a_scan_fits_the_data_sheets, TooFar(), "a detection at 500.0 m is beyond max_range"),
        (entry_laws.a_scan_fits_the_data_sheets, Backwards(), "rate must be positive, in scans a second"),
        (entry_laws.the_same_generator_gives_the_same_scan, Noisy(), "draw from the generator that scan gets"),
        (entry_laws.a_car_in_view_is_detected_and_an_empty_road_has_none, Blind(), "have no detection of any"),
        (entry_laws.every_action_is_in_the_action_space, Wild(), "InvalidAction: action 99"),
        (entry_laws.every_action_is_in_the_action_space, Silent(), "the action is None.*is a return missing"),
        (entry_laws.every_action_is_in_the_action_space, Pushes(), "moves vehicles of the road that it reads"),
        (entry_laws.the_same_drive_has_the_same_actions, Restive(), "has other actions the second time"),
        (entry_laws.a_world_repeats_under_its_seed, scenario_with(drifts), "two worlds of one seed differ"),
        (
            entry_laws.it_has_the_vehicles_that_it_promises,
            scenario_with(loses_one),
            "vehicles is 9, and the road has 8",
        ),
        (entry_laws.nobody_starts_in_a_collision, scenario_with(piles_up), "vehicles 1 and 2 of the road overlap"),
        (entry_laws.phases_follow_each_other_from_the_start, scenario_with(begins_late), "from 0 s on"),
    ],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_a_broken_radar_planner_or_scenario_is_caught_and_told_why(law, twin, sentence):
    found = law_result(law, twin)
    assert re.search(sentence, found.fault), found


def test_two_numbers_that_differ_are_told_with_digits_that_differ():
    with pytest.raises(Broken, match=r"array\[0\] is 0\.30000000000000004, which should be 0\.2999999999999999"):
        check_equal(np.array([0.1 + 0.2]), np.array([0.3]), 0, 0)

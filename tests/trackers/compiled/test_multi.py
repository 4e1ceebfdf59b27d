"""One step of the multi-object tracker in its compiled form is one of the numpy form, over any of the usual filters."""

import pickle
from contextlib import closing
from copy import deepcopy
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios import SCENARIOS
from tests.trackers.compiled.states import NAMES, RADAR, STATES, assert_same
from trackers import build
from trackers.batch import concatenate, take
from trackers.compiled import REFUSED, available
from trackers.compiled.multi import supported
from trackers.estimate import prior
from trackers.geometry import rotation
from trackers.multi.exclusion import Exclusion
from trackers.multi.road import RoadMap
from trackers.scan import Scan
from trackers.validation import admit

pytestmark = pytest.mark.skipif(not available(), reason="needs the extra `fast`")


class Listening:
    """A tracker that keeps the arguments of its steps."""

    def __init__(self, name):
        self.inner, self.steps = build(name, RADAR.models), []

    def start(self):
        return self.inner.start()

    def step(self, tracks, scan, dt):
        self.steps.append((tracks, scan, dt))
        return self.inner.step(tracks, scan, dt)


def recorded(name, scenario, most, seed=0):
    """Arguments (tracks, scan, dt) of at most so many steps of a tracker in a closed loop; and the tracker."""
    listening = Listening(name)
    with closing(gym.make(f"testbed/{scenario}-v0", tracker=listening, radar="surround")) as env:
        env.reset(seed=seed)
        while len(listening.steps) < most and not any(env.step(1)[2:4]):
            pass
    return listening.inner, listening.steps[:most]


def check(tracker, steps, monkeypatch):
    """Both forms from each state."""
    new = [tracker.step(*step) for step in steps]
    with monkeypatch.context() as without:
        without.setenv(REFUSED, "off")
        for found, step in zip(new, steps, strict=True):
            assert_same(found, tracker.step(*step))
    return new


@pytest.mark.parametrize(
    ("name", "scenario"),
    [("imm-spline", "cut-in"), ("imm-spline", "truck-convoy"), ("imm-htg", "merge"), ("rm-koch", "dense-traffic")],
)
def test_a_step_from_each_state_of_a_scenario_is_the_same(name, scenario, monkeypatch):
    tracker, steps = recorded(name, scenario, 36)
    assert tracker._compiled is not None
    check(tracker, steps, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_step_from_states_of_every_scenario_is_the_same(name, scenario, monkeypatch):
    """From each of 20 states; STATES=2000 takes as many of several seeds."""
    left, seed = STATES, 0
    while left > 0:
        tracker, steps = recorded(name, scenario, left, seed)
        check(tracker, steps, monkeypatch)
        left, seed = left - len(steps), seed + 1


def changed(rng, tracks, scan):
    """Rare states and scans: tracks beside themselves, unsure, hidden, divided; silent, blind and disturbed sensors."""
    T, M = len(tracks.id), len(scan.mask)
    if rng.random() < 0.3 and T:
        twin = take(tracks._replace(next_id=None, memory=None), rng.integers(0, T, 1))
        twin.state.motion.m[..., 0] += rng.choice([0.0, 2.0, 6.0])
        mine = concatenate([tracks._replace(next_id=None, memory=None), twin._replace(id=np.array([tracks.next_id]))])
        tracks = mine._replace(next_id=tracks.next_id + 1, memory=tracks.memory)
    existence = rng.choice([0.021, 0.3, 0.6, 0.9999], len(tracks.id)) * rng.uniform(0.9, 1, len(tracks.id))
    divided = np.argwhere(rng.random((len(tracks.id), 2)) < 0.2)
    divided[:, 0] = tracks.id[divided[:, 0]]
    out = rng.choice([0.0, 0.4, 0.9], len(RADAR.models)) if rng.random() < 0.5 else None
    hidden = rng.choice([0.0, 0.1, 0.7, 3.0], len(tracks.id))
    tracks = tracks._replace(existence=existence, hidden=hidden)
    tracks = tracks._replace(memory=tracks.memory._replace(divided=divided, out=out))
    polar, mask, noise = scan.polar.copy(), scan.mask & (rng.random(M) < rng.choice([1.0, 0.5, 0.0])), scan.noise.copy()
    still = rng.random(M) < rng.choice([0.0, 0.3])
    polar[still, 2] -= scan.ground_rate[still]
    polar[rng.random(M) < rng.choice([0.0, 0.3]), 2] = np.nan
    noise[rng.random(M) < rng.choice([0.0, 0.2])] = np.nan
    polar[:, :2] *= rng.normal(1, rng.choice([0.0, 0.02]), (M, 2))
    burst = int(rng.choice([0, 0, 60]))
    sensor = np.r_[scan.sensor, np.full(burst, rng.integers(0, len(RADAR.models)), int)]
    far = RADAR.models[sensor[-1]].max_range
    more = np.c_[rng.uniform(1, far, burst), rng.uniform(-1, 1, burst), rng.uniform(-40, 40, burst)]
    like = np.r_[np.arange(M), np.zeros(burst, int)]
    told = rng.random(len(RADAR.models)) < 0.8 if rng.random() < 0.3 else None
    polar, mask = np.r_[polar, more], np.r_[mask, np.ones(burst, bool)]
    return tracks, Scan(polar, mask, scan.pose[like], scan.velocity[like], noise[like], sensor, scan.platform, told)


@pytest.fixture(scope="module")
def drive():
    """With a map of its road, which the tracker of a user is not given by the environment."""
    tracker, steps = recorded("imm-spline", "dense-traffic", 60, 8)
    lanes = [([(-1000.0, y), (5000.0, y)], 4.0) for y in (0.0, 4.0, 8.0, 12.0)]
    return replace(tracker, road=RoadMap.of(lanes)), steps


@given(seed=st.integers(0, 2**32 - 1), k=st.integers(3, 59), dt=st.sampled_from([0.0, 1 / 15, 0.4, 3.0]))
def test_a_step_from_any_state_is_the_same(drive, seed, k, dt):
    tracker, steps = drive
    tracks, scan = changed(np.random.default_rng(seed), *steps[k][:2])
    with pytest.MonkeyPatch.context() as patch:
        check(tracker, [(tracks, scan, dt)], patch)


def turned(platform, bend):
    """The platform (6,) with the yaw rate of such a bend [1/m]."""
    return np.append(platform[:5], bend * np.hypot(*platform[3:5]))


@pytest.mark.parametrize("bend", [-0.01, 0.01])
def test_what_no_track_explains_beside_an_ego_that_turns_is_the_same(bend, monkeypatch):
    """Without a map it drives along the way of the ego, which bends."""
    tracker, steps = recorded("imm-spline", "dense-traffic", 30, 8)
    assert tracker.road is None
    steps = [
        (t._replace(memory=t.memory._replace(way=None)), scan._replace(platform=turned(scan.platform, bend)), dt)
        for t, scan, dt in steps[3:]
    ]
    after = [tracks.memory.unexplained for tracks, _ in check(tracker, steps, monkeypatch)]
    assert max(np.ptp(loose.course) for loose in after if len(loose.course)) > 0.5


def test_what_is_changed_has_all_that_is_rare(drive):
    tracker, steps = drive
    kinds, seen = set(), {"out": 0, "alarms": 0, "calm": 0, "hidden": 0, "end": 0}
    for seed in range(240):
        tracks, scan = changed(np.random.default_rng(seed), *steps[3 + seed % 50][:2])
        new, info = tracker.step(tracks, scan, 1 / 15)
        kinds |= {event.kind for event in info.events}
        seen["out"] += (new.memory.out > 0.5).any()
        seen["alarms"] += len(scan.mask) > len(steps[3 + seed % 50][1].mask)
        seen["calm"] += not {event.kind for event in info.events} - {"confirmed"}
        seen["hidden"] += ((info.expected == 0) & info.in_view).any()
        view = tracker._seen(tracker._predict(tracks, 1 / 15), scan, 1 / 15).view
        seen["end"] += (view.end_hidden & (info.detections > 0)).any()
    assert {"born", "died", "merged", "lost"} <= kinds
    assert min(seen.values()) > 3


def test_scans_that_numpy_would_not_take_as_they_are_go_the_other_way(drive):
    tracker, steps = drive
    life, scan = tracker._compiled, steps[20][1]
    assert life.plausible(scan)
    broken = [
        scan._replace(polar=scan.polar * [1, 1, 1e5]), scan._replace(polar=-scan.polar),
        scan._replace(pose=scan.pose * np.nan), scan._replace(noise=-scan.noise), scan._replace(mask=scan.mask[1:]),
        scan._replace(sensor=scan.sensor + 9), scan._replace(polar=scan.polar.astype(np.float32)),
        scan._replace(platform=np.full(6, np.inf)), scan._replace(velocity=scan.velocity[:, :1]),
        scan._replace(delivered=np.ones(2, bool)), scan._replace(polar=scan.polar.tolist()),
    ]  # fmt: skip
    assert not any(map(life.plausible, broken))
    silent = scan._replace(polar=scan.polar * [1, 1, np.nan], noise=scan.noise * np.nan)
    assert life.plausible(silent)
    assert admit(silent, ()).scan is silent


@pytest.mark.parametrize("dt", [0.01, 0.5, 1.5, 3.0, 10.0])
def test_a_gap_between_scans_of_any_length_leaves_tracks_of_use(drive, monkeypatch, dt):
    tracker, steps = drive
    for tracks, info in check(tracker, [(tracks, scan, dt) for tracks, scan, _ in steps[3::8]], monkeypatch):
        assert np.isfinite(tracks.state.motion.m).all()
        assert np.linalg.eigvalsh(tracks.state.motion.P).min(initial=0) > -1e-9
        assert tracks.state.motion.mu.min(initial=1) >= 0
        assert np.isfinite(info.log_ratio).all()


@pytest.fixture(scope="module")
def tracker():
    return build("imm-spline", RADAR.models)


# One vehicle or two: place and heading of b in the box of a, both speeds and lengths, empty ground at the ends of b.
TWO = {
    "0.6 of the box, 4.9 m/s": (2.4, 0.0, 0.0, 0.0, 4.9, 5.0, 5.0, False, False),
    "0.6 of the box, 5.1 m/s": (2.4, 0.0, 0.0, 0.0, 5.1, 5.0, 5.0, False, True),
    "0.4 of the box": (2.6, 0.0, 0.0, 0.0, 4.0, 5.0, 5.0, False, True),
    "0.8 of the box, whatever the speed": (1.4, 0.0, 0.0, 0.0, 20.0, 5.0, 5.0, False, False),
    "0.6 of the box, 20 m/s": (1.6, 0.0, 0.0, 0.0, 20.0, 5.0, 5.0, False, True),
    "0.67 of the width": (0.0, 0.6, 0.0, 0.0, 4.0, 5.0, 5.0, False, False),
    "0.33 of the width": (0.0, 1.1, 0.0, 0.0, 4.0, 5.0, 5.0, False, True),
    "all of the shorter one": (3.5, 0.0, 0.0, 0.0, 20.0, 12.0, 2.0, False, False),
    "across": (0.0, 0.0, np.pi / 2, 0.0, 0.0, 5.0, 5.0, False, True),
    "on each other, divided": (1.4, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, True, False),
    "gap 0.7, standing": (5.7, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, False, False),
    "gap 0.9, standing": (5.9, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, False, True),
    "gap 0.7, unlike lengths": (7.7, 0.0, 0.0, 0.0, 0.0, 9.0, 5.0, False, False),
    "gap 0.9, unlike lengths": (7.9, 0.0, 0.0, 0.0, 0.0, 9.0, 5.0, False, True),
    "gap 2.0, 10 m/s": (7.0, 0.0, 0.0, 10.0, 10.0, 5.0, 5.0, False, False),
    "gap 2.1, 10 m/s": (7.1, 0.0, 0.0, 10.0, 10.0, 5.0, 5.0, False, True),
    "gap 7.4, 30 m/s": (12.4, 0.0, 0.0, 30.0, 30.0, 5.0, 5.0, False, False),
    "gap 7.6, 30 m/s": (12.6, 0.0, 0.0, 30.0, 30.0, 5.0, 5.0, False, True),
    "1.5 m aside": (5.7, 1.5, 0.0, 0.0, 0.0, 5.0, 5.0, False, False),
    "1.7 m aside": (5.7, 1.7, 0.0, 0.0, 0.0, 5.0, 5.0, False, True),
    "1.4 m/s apart": (6.9, 0.0, 0.0, 10.0, 11.4, 5.0, 5.0, False, False),
    "1.6 m/s apart": (6.9, 0.0, 0.0, 10.0, 11.6, 5.0, 5.0, False, True),
    "near for the speed of one of them": (5.81, 0.0, 0.0, 0.0, 1.4, 5.0, 5.0, False, True),
    "in the lane of one of them": (5.75, 0.0, 0.3, 0.0, 0.0, 5.0, 5.0, False, True),
    "turned a little": (5.7, 0.0, 0.2, 0.0, 0.0, 5.0, 5.0, False, False),
    "turned away": (2.4, 1.45, 0.47, 0.0, 0.0, 2.0, 2.0, False, True),
    "turned by less": (2.4, 1.45, 0.43, 0.0, 0.0, 2.0, 2.0, False, False),
    "a gap between what was divided": (5.7, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, (True, False), True),
    "a gap at the other end, 0.7 at 30 m/s": (5.7, 0.0, 0.0, 30.0, 30.0, 5.0, 5.0, (False, True), False),
    "a gap at the other end, 0.9 at 30 m/s": (5.9, 0.0, 0.0, 30.0, 30.0, 5.0, 5.0, (False, True), True),
    "a gap at the other end, 0.1 at 8.1 m/s": (5.1, 0.0, 0.0, 8.1, 8.1, 5.0, 5.0, (False, True), False),
    "a gap at the other end, 0.1 at 7.9 m/s": (5.1, 0.0, 0.0, 7.9, 7.9, 5.0, 5.0, (False, True), True),
    "overlap at the other end, standing": (4.9, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, (False, True), True),
    "empty ground between two parts of a car": (2.7, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0, (True, False), False),
    "empty ground where they touch": (5.1, 0.0, 0.0, 30.0, 30.0, 5.0, 5.0, (True, False), True),
}


@pytest.mark.parametrize("case", TWO)
def test_two_tracks_are_one_vehicle_where_they_overlap_or_have_hardly_a_gap(tracker, case):
    """(MOT.42) to (MOT.44), in both forms; whichever is first, wherever they are and whoever else is there."""
    from trackers.compiled.multi.steps import apart

    x, y, heading, speed, other, length, shorter, divided, two = TWO[case]
    turn = rotation(np.array(2.5))
    place = [turn @ [x, y], [60.0, 0.0], [0.0, 0.0]]
    pose = np.c_[place, [2.5 + heading, 2.5, 2.5]]
    v = np.outer([other, speed, speed], turn[:, 0])
    e = prior(pose, v, size=np.c_[[shorter, 5.0, length], [2.0] * 3])
    rule, life, into = tracker.exclusion, tracker._compiled, np.zeros((3, 2), bool)
    into[0] = divided
    for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
        one, some = take(e, np.array(order)), into[order]
        kept = rule.apply(one, np.ones(3), some).keep
        assert bool(apart(life._boxes(one), some, life.rules)) is two is bool(kept.all())


class Mine(Exclusion):
    """An exclusion of a user."""


def test_parts_of_a_user_have_no_compiled_form():
    tracker = build("imm-spline", RADAR.models)
    assert supported(tracker)
    assert not supported(replace(tracker, exclusion=Mine()))
    assert not supported(build("imm-spline:compiled=off", RADAR.models))
    assert not supported(build("pmht-spline", RADAR.models))  # claims by a density of its own
    assert supported(build("rm-feldmann", RADAR.models))


def test_copies_of_a_tracker_take_no_compiled_code_along(drive):
    tracker, steps = drive
    expected = tracker.step(*steps[30])
    for copy in (deepcopy(tracker), pickle.loads(pickle.dumps(tracker))):
        assert_same(copy.step(*steps[30]), expected)

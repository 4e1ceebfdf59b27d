"""One step of the compiled form of `imm-spline` and `imm-htg` is one of the numpy form, from every kind of state."""

import os
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
from tests.trackers.compiled.states import (
    COMPILED,
    NAMES,
    NUMPY,
    RADAR,
    STATES,
    assert_same,
    check,
    drawn,
    recorded,
    shaded,
)
from trackers import build, find
from trackers.batch import take
from trackers.compiled import REFUSED, available
from trackers.compiled.core import Core, supported
from trackers.htg.density import HTG, evaluate, lift, log_mass
from trackers.htg.density import prepare as dense
from trackers.htg.map import HTGMap

pytestmark = pytest.mark.skipif(not available(), reason="needs the extra `fast`")


@pytest.mark.parametrize(
    ("name", "scenario"), [("imm-spline", "cut-in"), ("imm-spline", "truck-convoy"), ("imm-htg", "truck-convoy")]
)
def test_a_step_from_each_state_of_a_scenario_is_the_same(name, scenario):
    calls = recorded(name, scenario, 12)
    assert len(calls) > 60
    for call in calls:
        check(name, call)
    if scenario == "truck-convoy":  # where sides are in the shade of other trucks
        updates = [call for call in calls if call[0] == "update"]
        alone = [COMPILED[name].update(*call[1:5])[0] for call in updates]
        among = [COMPILED[name].update(*call[1:])[0] for call in updates]
        assert any((a.size.length != b.size.length).any() for a, b in zip(alone, among, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_step_from_states_of_every_scenario_is_the_same(name, scenario):
    """A prediction and an update from each of 20 states; STATES=2000 takes as many of several seeds."""
    left, seed = 2 * STATES, 0
    while left > 0:
        calls = recorded(name, scenario, -(-left // 30) + 5 * seed, seed)[:left]  # longer where nothing was tracked yet
        for call in calls:
            check(name, call)
        left, seed = left - len(calls), seed + 1


@given(st.sampled_from(NAMES), st.integers(0, 2**32 - 1), st.integers(0, 4), st.integers(0, 9), st.floats(1e-3, 10.0))
def test_a_step_from_any_state_is_the_same(name, seed, T, M, dt):
    """Lost, turned round, seen from the other end, cut off by range, with noise and rates that nobody knows.

    Covariances of some of them are so ill-conditioned that rounding shows.
    """
    state, scan = drawn(name, np.random.default_rng(seed), T, M)
    check(name, ("predict", state, dt), 1e-6)
    check(name, ("update", state, scan), 1e-6)
    check(name, ("update", state, scan, *shaded(np.random.default_rng(seed), T)), 1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_drawn_has_all_that_is_rare_and_is_compiled(name):
    contour, filter = name == "imm-spline", NUMPY[name]
    seen = {"turned": 0, "driven": 0, "flipped": 0, "cut": 0, **({"lost": 0, "longer": 0} if contour else {})}
    for seed in range(40):
        state, scan = drawn(name, np.random.default_rng(seed), 4, 8)
        assert COMPILED[name].core.predict(*state, 0.1) is not None
        assert COMPILED[name].core.update(*state, scan) is not None
        some = scan.mask.any(-1)
        new, info = filter.update(state, scan)
        turn = np.cos(filter.estimate(new).pose[:, 2] - filter.estimate(state).pose[:, 2]) < 0
        seen["turned"] += (turn & some).any()
        backwards = filter.gaussian(new).m[:, 3] < -filter.motion.backwards
        seen["driven"] += (backwards & (new.motion.ahead > -filter.motion.backed) & some).any()
        seen["flipped"] += (new.size.anchor * state.size.anchor < 0).any()
        seen["cut"] += (
            (filter.size.width.sizes[0] < new.size.belief.size[:, 1]) & ~state.size.fully_visible & some
        ).any()
        if contour:
            seen["lost"] += bool(info.notes)
            seen["longer"] += (new.place.p != state.place.p).any()
    assert min(seen.values()) > 3


@pytest.mark.parametrize("name", NAMES)
def test_many_tracks_at_once_are_what_each_is_alone(name):
    filter, (state, scan) = COMPILED[name], drawn(name, np.random.default_rng(5), 6, 7)
    rows = state.motion.mu.shape[:1]
    both, _ = filter.update(filter.predict(state, 0.1), scan)
    for t in range(rows[0]):
        one = scan._replace(
            **{name: getattr(scan, name)[t] for name in ("polar", "mask", "pose", "velocity", "noise", "sensor")}
        )
        alone = filter.predict(take(state, np.array(t)), 0.1)
        assert_same(filter.update(alone, one)[0], take(both, np.array(t)))


@pytest.mark.parametrize("name", NAMES)
def test_a_free_run_gives_the_same_tracks_and_events(name):
    """300 scans of one recording through both trackers, each on its own; fewer where the compiler is off."""
    most = 30 if "NUMBA_DISABLE_JIT" in os.environ else 300
    scans = []

    class Listening:
        name = "listening"

        def __init__(self):
            self.inner = build(f"{name}:compiled=off", RADAR.models)

        def start(self):
            return self.inner.start()

        def step(self, tracks, scan, dt):
            scans.append((scan, dt))
            return self.inner.step(tracks, scan, dt)

    with closing(
        gym.make("testbed/following-v0", config={"duration": 25.0}, tracker=Listening(), radar="surround")
    ) as env:
        env.reset(seed=0)
        while len(scans) < most and not any(env.step(1)[2:4]):
            pass
    assert len(scans) >= most
    trackers = [build(f"{name}:compiled={form}", RADAR.models) for form in ("on", "off")]
    tracks = [tracker.start() for tracker in trackers]
    for scan, dt in scans:
        (a, seen), (b, known) = (tracker.step(t, scan, dt) for tracker, t in zip(trackers, tracks, strict=True))
        np.testing.assert_array_equal(a.id, b.id)
        np.testing.assert_array_equal(seen.owner, known.owner)
        assert [event[:2] for event in seen.events] == [event[:2] for event in known.events]
        np.testing.assert_allclose(a.existence, b.existence, rtol=1e-6)
        for x, y in zip(a.estimate, b.estimate, strict=True):
            assert (x is None) is (y is None)
            np.testing.assert_allclose(0 if x is None else x, 0 if y is None else y, rtol=1e-5, atol=1e-6)
        tracks = [a, b]


@pytest.mark.parametrize("r", [1e-5, 1e-3, 0.1])
def test_the_density_is_the_same_far_inside_a_hole_and_far_outside(r):
    """(HTG.5), (HTG.7) of turned, open and sharp holes, hundreds of standard deviations from their sides."""
    from trackers.compiled.htg import density, prepare

    rng = np.random.default_rng(0)
    p = HTG(np.array(0.7), np.array([0.8, 2.0, np.inf, 0.5]), np.array(0.3), np.array([r, 2 * r]))
    row, c, g = np.array([p.rho, *p.bounds, p.theta, *p.r, log_mass(p)]), np.empty(11), np.empty(2)
    prepare(row, np.array([0.0, r]), c)
    points = rng.normal(0, 1.5, (200, 2))
    log_p, slope = evaluate(points.T, dense(lift(p, 1), np.array([[0.0, r]])))
    found = [(density(x, y, c, g), *g) for x, y in points]
    np.testing.assert_allclose(found, np.column_stack([log_p, *slope]), rtol=1e-9, atol=1e-9)


class Other(type(NUMPY["imm-spline"].motion)):
    """A motion of a user."""


class Mine(HTGMap):
    """A place of a user."""


def test_what_has_no_compiled_form_goes_the_other_way():
    filter = COMPILED["imm-spline"]
    place, motion, size = filter.place, filter.motion, filter.size
    assert supported(place, motion, size)
    assert supported(HTGMap(), motion, size)
    assert not supported(Mine(), motion, size)
    assert not supported(place, Other(), size)
    assert not supported(place, None, size)
    assert not supported(replace(place, visibility="none"), motion, size)
    for name in ("imm-htg:size=off", "imm-spline:motion=off", "imm-spline:size=off"):
        assert getattr(build(name, RADAR.models).filter, "core", None) is None
    lidar = [replace(s, profile=replace(s.profile, hides_within=0.01)) for s in RADAR.models]
    assert find("imm-spline").on(lidar).core is None


def test_a_state_that_the_core_does_not_know_goes_the_other_way(monkeypatch):
    filter, numpy = COMPILED["imm-spline"], NUMPY["imm-spline"]
    state, scan = drawn("imm-spline", np.random.default_rng(1), 3, 5)
    assert filter.core.predict(*state, 0.1) is not None
    contour = state._replace(place=state.place._replace(p=state.place.p * 1.01))
    assert filter.core.predict(*contour, 0.1) is None
    assert_same(filter.predict(contour, 0.1), numpy.predict(contour, 0.1))
    flat = state._replace(motion=state.motion._replace(P=np.zeros(state.motion.P.shape)))
    assert filter.core.update(*flat, scan) is None
    many = scan._replace(
        **{
            name: np.repeat(getattr(scan, name), 20, 1)
            for name in ("polar", "mask", "pose", "velocity", "noise", "sensor")
        }
    )
    assert filter.core.update(*state, many) is None
    assert_same(filter.update(state, many)[0], numpy.update(state, many)[0])
    monkeypatch.setenv(REFUSED, "off")
    assert filter.core.predict(*state, 0.1) is None


def test_copies_work_and_take_no_compiled_code_along():
    filter = COMPILED["imm-spline"]
    state, _ = drawn("imm-spline", np.random.default_rng(2), 2, 3)
    first = filter.predict(state, 0.1)
    for copy in (deepcopy(filter), pickle.loads(pickle.dumps(filter))):
        assert isinstance(copy.core, Core)
        assert_same(copy.predict(state, 0.1), first)
    assert len(pickle.dumps(filter.core)) < 1.5e5

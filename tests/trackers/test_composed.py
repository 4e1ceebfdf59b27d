"""The filter of place, motion and size: what its states hold, and what the catalogue has of it."""

import copy
import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from testbed.check import draws
from testbed.check.draws import arrays, random_prior
from trackers import TRACKERS, MultiObjectTracker, SensorModel, build, find
from trackers.composed import Composed, composed, place_of
from trackers.filter import Abilities

SENSORS = (SensorModel(mount=(1.0, 0.0, 0.1), fov=2.0), SensorModel(fov=7.0))
random_scan = partial(draws.random_scan, missing=True)


def updated(f, seed=0, lead=(4,)):
    """State after one update."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng, lead)
    return f.update(f.predict(f.init(start), 0.1), random_scan(rng, start.pose, lead=lead))[0]


@pytest.mark.parametrize("name", TRACKERS)
def test_a_name_is_one_filter(name):
    alone, tracked = find(name), build(name, SENSORS).filter
    on = Abilities.of(alone).on_sensors
    assert (alone if on is None else on(SENSORS)) == tracked
    assert MultiObjectTracker(alone, SENSORS).filter == tracked


@pytest.mark.parametrize("changes", [{"size": "off"}, {"motion": False}, {"iterations": 5}])
def test_changes_of_a_name_are_those_of_the_tracker(changes):
    text = ",".join(f"{key}={ {False: 'off'}.get(value, value) }" for key, value in changes.items())
    alone = find("imm-spline", **changes)
    assert alone.on(SENSORS) == build(f"imm-spline:{text}", SENSORS).filter
    assert alone != find("imm-spline")


def test_without_motion_and_size_nothing_is_around_the_filter():
    assert find("imm-spline", size="off", motion=False) == find("pmht-spline") == place_of(find("imm-spline"))
    with pytest.raises(ValueError, match="Composed needs motion, size, or both"):
        Composed(find("pmht-spline"))


def test_an_unknown_parameter_is_named():
    for name in ("depth", "angles"):
        with pytest.raises(TypeError, match=f"imm-spline has no parameter {name}; it has model, visibility"):
            find("imm-spline", **{name: 3})


def test_what_a_filter_offers_is_what_its_parts_do():
    whole = Abilities.of(find("imm-spline"))
    assert whole.has("log_spatial", "restart", "learn_where", "reach", "update_among", "classes", "on_sensors")
    assert not any(whole.has(name) for name in ("gaussian", "resize", "shift", "located"))
    moving = Abilities.of(find("imm-spline", size="off"))
    assert moving.has("gaussian", "with_gaussian", "angles", "resize", "shift", "restart", "log_spatial")
    assert not any(moving.has(name) for name in ("reach", "update_among", "classes"))


@pytest.mark.parametrize("name", ["imm-spline", "imm-htg"])
def test_the_motion_of_an_object_is_stored_once(name):
    state = updated(find(name))
    assert state.place.m is None
    assert state.place.P is None
    assert state.motion.m.shape == (4, 5, 7)
    assert sum(a.shape[-2:] == (7, 7) for a in arrays(state)) == 1


def test_a_filter_that_learns_keeps_its_own_gaussian_where_no_size_is_pinned():
    f = composed(find("pmht-spline-adaptive"), motion=True)
    assert updated(f).place.m.shape == (4, 7)
    assert updated(replace(f, size=find("imm-spline").size)).place.m is None


@pytest.mark.parametrize("name", ["imm-spline", "imm-htg"])
def test_copies_go_on_alike(name):
    tracker = build(name, SENSORS)
    state = updated(tracker.filter)
    for other in (copy.deepcopy(tracker), pickle.loads(pickle.dumps(tracker))):
        assert other == tracker
        for a, b in zip(arrays(updated(other.filter)), arrays(state), strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_scan_of_sensors_without_a_data_sheet_is_refused_in_a_sentence():
    f, start = find("imm-spline"), random_prior(np.random.default_rng(0), (1,))
    scan = random_scan(np.random.default_rng(1), start.pose, lead=(1,))
    scan = scan._replace(sensor=np.full((1, 1), 3))
    with pytest.raises(ValueError, match=r"must index the 1 data sheets .* give the filter those of the radar by on\("):
        f.update(f.init(start), scan)
    f.on(SENSORS * 2).update(f.init(start), scan)

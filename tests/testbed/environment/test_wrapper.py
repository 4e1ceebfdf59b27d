"""The wrapper: bit-identical under perfect tracks, blind without them, and reproducible."""

import gc
import pickle
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

import sensors
from scenarios.constants import ProtectedConstants
from testbed.environment import perception
from testbed.environment.perception import label, on_road
from testbed.environment.wrapper import TrackedEnv
from testbed.frame import Frame
from testbed.planners.track_vehicle import TrackVehicle
from trackers import DEFAULT, MultiObjectTracker, find
from trackers.estimate import prior
from trackers.multi.road import RoadMap
from trackers.multi.tracks import StepInfo, Tracks

SMALL = {"vehicles_count": 8, "lanes_count": 3}
ENVS = {
    "highway-fast-v0": SMALL,
    "merge-v1": {},
    "roundabout-v1": {},
    "exit-v1": {"vehicles_count": 8},
    "u-turn-v1": {},
    "two-way-v0": {},
    "intersection-v2": {},
}
OBSERVATIONS = {
    "default": None,
    "Kinematics": {
        "type": "Kinematics",
        "vehicles_count": 8,
        "features": ["presence", "x", "y", "vx", "vy", "heading", "long_off", "lat_off", "ang_off"],
        "see_behind": True,
        "normalize": False,
    },
    "OccupancyGrid": {"type": "OccupancyGrid"},
    "Lidar": {"type": "LidarObservation", "cells": 32},
    "TimeToCollision": {"type": "TimeToCollision"},
}
GRAYSCALE = {
    "type": "GrayscaleObservation",
    "observation_shape": (64, 48),
    "stack_size": 3,
    "weights": [0.3, 0.5, 0.2],
    "scaling": 1.75,
}
SHUFFLED = {"type": "Kinematics", "vehicles_count": 6, "order": "shuffled"}
TWO_EYES = {"type": "TupleObservation", "observation_configs": [SHUFFLED, {"type": "OccupancyGrid"}]}


def make(name: str, observation: dict | None = None, **config: Any) -> gym.Env:
    config = {**ENVS.get(name, {}), "simulation_frequency": 5, **config}
    return gym.make(name, config=config if observation is None else {**config, "observation": observation})


def states(env: gym.Env) -> list[tuple]:
    return [(*v.position, v.heading, v.speed, v.crashed) for v in env.unwrapped.road.vehicles]


def assert_equal_episodes(name: str, observation: dict | None, steps: int = 3) -> None:
    """A native episode and one with perfect tracks agree to the last bit; so does the world, by its reward."""
    native, tracked = make(name, observation), TrackedEnv(make(name, observation), tracker="truth")
    (a, _), (b, _) = native.reset(seed=11), tracked.reset(seed=11)
    np.testing.assert_equal(b, a)
    for action in (1, 0, 2)[:steps]:
        a, *flags, info = native.step(action)
        b, *others, tracked_info = tracked.step(action)
        np.testing.assert_equal(b, a)
        assert others == flags
        assert info["rewards"] == tracked_info["rewards"]
        tracked._swap.show()  # between calls the true road is hidden
        assert states(tracked) == states(native)
        tracked._swap.hide(tracked._belief_now())
        if any(flags[1:]):
            break


@pytest.mark.parametrize("kind", OBSERVATIONS)
@pytest.mark.parametrize("name", ENVS)
def test_perfect_tracks_give_the_native_episode_bit_by_bit(name, kind):
    with ProtectedConstants():
        assert_equal_episodes(name, OBSERVATIONS[kind])


@pytest.mark.parametrize("observation", [GRAYSCALE, SHUFFLED, TWO_EYES], ids=["Grayscale", "shuffled", "tuple"])
def test_observations_with_memory_or_chance_agree_as_well(observation):
    assert_equal_episodes("merge-v1", observation)


# Nothing but tracks


def reachable(thing: Any) -> Iterator[Any]:
    """Everything that can be reached from a thing, code and classes excepted."""
    seen: set[int] = set()
    todo = [thing]
    while todo:
        item = todo.pop()
        if id(item) in seen or isinstance(item, type | ModuleType | FunctionType | str | bytes | np.ndarray):
            continue
        seen.add(id(item))
        yield item
        todo.extend(gc.get_referents(item))


def assert_blind(copied: gym.Env) -> None:
    """No vehicle besides the controlled ones and the tracks, anywhere."""
    core = copied.unwrapped
    vehicles = [v for v in reachable(core) if isinstance(v, Vehicle)]
    assert core.vehicle in vehicles
    strangers = [v for v in vehicles if v not in core.controlled_vehicles and not isinstance(v, TrackVehicle)]
    assert strangers == []
    assert copied.unwrapped.road.vehicles[0] is core.vehicle


@pytest.mark.parametrize("name", ["testbed/truck-convoy-v0", "testbed/articulated-turn-v0"])
def test_between_calls_the_road_and_its_copies_hold_ego_and_tracks_only(name):
    env = gym.make(name)
    env.reset(seed=0)
    for _ in range(8):
        env.step(1)
    road = env.unwrapped.road
    reported = env.tracks.reported
    tracks = [v for v in road.vehicles if v is not env.unwrapped.vehicle]
    assert len(tracks) > 1
    assert {v.track_id for v in tracks} <= set(reported.id.tolist())
    for v in tracks:
        row = int(np.flatnonzero(reported.id == v.track_id)[0])
        np.testing.assert_array_equal(v.position, reported.estimate.pose[row, :2])
        np.testing.assert_array_equal(v.velocity, reported.estimate.velocity[row])
    true = {tuple(pose[:2]) for pose in env.truth.objects.pose}
    assert not true & {tuple(v.position) for v in tracks}
    for copied in (deepcopy(env), deepcopy(env.unwrapped), env.unwrapped.simplify()):
        assert_blind(copied)


def test_recorded_trajectories_and_goals_do_not_leak_the_truth():
    for name, config in (("highway-fast-v0", {"show_trajectories": True}), ("parking-v0", {})):
        env = TrackedEnv(make(name, **config))
        env.reset(seed=0)
        env.step(env.action_space.sample())
        copied = deepcopy(env.unwrapped)
        hidden = {id(v.road) for v in reachable(copied) if isinstance(v, Vehicle)} - {id(copied.road)}
        assert not hidden, name


def test_the_observation_is_made_of_tracks():
    """A tracker that knows one vehicle 12 m ahead, whatever the world is like."""
    env = TrackedEnv(make("highway-fast-v0"), tracker=OneTrack([12.0, 0.0, 0.0], [3.0, 0.0]))
    observation, _ = env.reset(seed=0)
    assert observation[:, 0].tolist() == [1, 1, 0, 0, 0]
    ego = env.truth.ego
    expected = [12.0 / 200.0, (3.0 - ego.velocity[0]) / 80.0]
    np.testing.assert_allclose(observation[1, [1, 3]], expected, rtol=1e-5)


def test_an_absurd_track_never_reaches_observation_or_road():
    env = TrackedEnv(make("highway-fast-v0"), tracker=OneTrack([1e9, 0.0, 0.0], [1e9, 0.0]))
    observation, _ = env.reset(seed=0)
    assert np.isfinite(observation).all()
    assert env.unwrapped.road.vehicles == [env.unwrapped.vehicle]
    assert np.isfinite(env.step(1)[0]).all()


def test_a_track_of_small_existence_is_not_shown():
    env = TrackedEnv(make("highway-fast-v0"), tracker=OneTrack([12.0, 0.0, 0.0], [3.0, 0.0], existence=0.4))
    env.reset(seed=0)
    assert env.unwrapped.road.vehicles == [env.unwrapped.vehicle]
    assert len(env.tracks.id) == 1


class OneTrack:
    """A tracker that reports one vehicle at a fixed offset from the platform."""

    def __init__(self, offset: list[float], velocity: list[float], existence: float = 1.0) -> None:
        self.offset, self.velocity, self.existence = offset, velocity, existence
        self.dts: list[float] = []

    def start(self) -> Tracks:
        none = np.zeros(0)
        estimate = prior(np.zeros((0, 3)))
        return Tracks(none.astype(int), none, none.astype(int), none, none.astype(bool), None, estimate)

    def step(self, tracks: Tracks, scan: Any, dt: float) -> tuple[Tracks, StepInfo]:
        self.dts.append(dt)
        one = np.ones(1)
        estimate = prior(scan.platform[None, :3] + self.offset, velocity=[self.velocity])
        rest = StepInfo(np.full(scan.mask.shape, -1), one.astype(int), one, one > 0, one.astype(int), one, one, ())
        return Tracks(one.astype(int), self.existence * one, one.astype(int), one, one > 0, None, estimate, 2), rest


# Planning on copies


def test_a_rollout_on_a_copy_does_not_disturb_the_live_environment():
    env, twin = gym.make("testbed/cut-in-v0"), gym.make("testbed/cut-in-v0")
    for e in (env, twin):
        e.reset(seed=5)
        e.step(1)
    for copied in (deepcopy(env), env.unwrapped.simplify()):
        for action in (4, 0, 3):
            observation, *_ = copied.step(action)
            assert np.isfinite(observation).all()
    (a, *flags, _), (b, *others, _) = env.step(1), twin.step(1)
    np.testing.assert_array_equal(a, b)
    assert flags == others
    np.testing.assert_array_equal(env.scan.polar, twin.scan.polar)


def test_a_copy_has_neither_radar_nor_tracker():
    env = TrackedEnv(make("highway-fast-v0"), tracker="truth")
    env.reset(seed=0)
    copied = deepcopy(env)
    for name in ("truth", "tracks", "scan", "origin", "observers"):
        assert not hasattr(copied, name)
    before = env.truth
    copied.step(1)
    assert env.truth is before


# Streams


def test_another_radar_or_tracker_never_changes_the_traffic():
    def drive(**mounted: Any) -> list:
        env = gym.make("testbed/cut-in-v0", **mounted)
        env.reset(seed=3)
        poses = []
        for _ in range(4):
            env.step(1)
            poses.append(np.concatenate([env.truth.objects.pose, env.truth.ego.pose[None]]))
        return poses

    reference = drive(tracker="truth", radar="ideal")
    for other in ({"radar": "front"}, {"tracker": {"name": "rm-feldmann", "sigma": 0.5}, "also": ["truth"]}):
        np.testing.assert_array_equal(drive(**other), reference)


def test_another_tracker_sees_the_same_detections():
    scans = []
    for tracker in ("truth", "rm-feldmann"):
        env = TrackedEnv(make("highway-fast-v0"), tracker=tracker)
        env.reset(seed=3)
        env.step(1)
        scans.append(env.scan)
    np.testing.assert_array_equal(scans[0].polar, scans[1].polar)
    assert scans[0].mask.any()


def test_resets_without_a_seed_go_on_reproducibly_and_differ():
    def episodes() -> list:
        env = TrackedEnv(make("highway-fast-v0"), tracker="truth")
        scans = []
        for seed in (3, None, None):
            env.reset(seed=seed)
            scans.append(env.scan.polar)
        return scans

    first, second = episodes(), episodes()
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first[1], first[2])


def test_every_episode_of_the_same_traffic_has_its_own_detections():
    """The published scene starts alike whatever the seed, so only the radar's stream can make its scans differ."""

    def episodes() -> list[tuple[Any, Any]]:
        env = gym.make("testbed/six-radar-highway-v0", tracker="truth")
        return [(env.reset(seed=seed), env.truth.objects.pose, env.scan)[1:] for seed in (3, None, 3)]

    (first_truth, first), (second_truth, second), (_, again) = episodes()
    np.testing.assert_array_equal(first_truth, second_truth)
    assert first.mask.any()
    assert not np.array_equal(first.polar, second.polar)
    np.testing.assert_array_equal(first.polar, again.polar)
    for (_, scan), (_, repeated) in zip(episodes(), episodes(), strict=True):
        np.testing.assert_array_equal(scan.polar, repeated.polar)


# Scans and observers


def test_the_first_frame_comes_at_reset_and_then_every_simulated_one():
    env = TrackedEnv(make("highway-fast-v0", simulation_frequency=5), tracker="truth", also=["rm-feldmann"])
    frames: list[Frame] = []
    env.attach(frames.append)
    env.reset(seed=0)
    assert [(frame.step, frame.time, frame.action, len(frame.plan)) for frame in frames] == [(0, 0.0, "reset", 0)]
    assert frames[0].scene.dt == 0.0
    env.plan = np.ones((4, 2))
    env.step(3)
    assert [frame.step for frame in frames] == list(range(6))
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(6) / 5)
    last = frames[-1]
    assert last.scene is env.truth
    assert last.scene.dt == pytest.approx(0.2)
    assert last.scan is env.scan
    assert last.origin is env.origin
    assert len(last.origin.object) == last.scan.mask.shape[-1]
    assert list(last.outputs) == ["truth", "rm-feldmann"] == list(env.all_tracks)
    assert last.outputs["truth"][0] is env.tracks
    assert (last.action, last.plan.shape) == ("FASTER", (4, 2))


def test_a_slow_radar_scans_at_its_own_rate_and_tracks_are_predicted_in_between():
    tracker = OneTrack([12.0, 0.0, 0.0], [3.0, 0.0])
    radar = {"name": "ideal", "rate": 4.0}
    env = TrackedEnv(make("highway-fast-v0", simulation_frequency=10), tracker=tracker, radar=radar)
    frames = []
    env.attach(lambda frame: frames.append(frame.step))
    env.reset(seed=0)
    for _ in range(2):
        env.step(1)
    assert frames == [0, 3, 5, 8, 10, 13, 15, 18, 20]
    assert sum(tracker.dts) == pytest.approx(2.0)

    stale = TrackedEnv(make("highway-fast-v0", simulation_frequency=10), tracker=tracker, radar={**radar, "rate": 0.6})
    stale.reset(seed=0)
    stale.step(1)
    track = stale.unwrapped.road.vehicles[1]
    assert stale.truth.time == 0.0
    np.testing.assert_allclose(track.position - stale.tracks.estimate.pose[0, :2], [3.0, 0.0])


def test_info_counts_tracks_and_detections():
    env = TrackedEnv(make("highway-fast-v0"), tracker="truth", also=["rm-feldmann"])
    _, info = env.reset(seed=0)
    assert info["tracks"] == len(env.truth.objects.id)
    assert info["detections"] == int(env.scan.mask.sum())
    assert {type(info["tracks"]), type(info["detections"])} == {int}


class Counting:
    """The radar `ideal`, which counts its scans."""

    def __init__(self) -> None:
        self.radar, self.scans = sensors.find("ideal"), 0
        self.models, self.rate = self.radar.models, self.radar.rate

    def scan(self, scene, rng):
        self.scans += 1
        return self.radar.scan(scene, rng)


def driven(frames: list[Frame] | None = None, **options: Any) -> tuple[TrackedEnv, Counting]:
    """Ten simulated frames on perfect tracks, frame 0 not counted; with a list, under an observer."""
    radar = Counting()
    env = TrackedEnv(make("highway-fast-v0", simulation_frequency=5), tracker="truth", radar=radar, **options)
    if frames is not None:
        env.attach(frames.append)
    env.reset(seed=0)
    for _ in range(2):
        _, _, _, _, info = env.step(1)
        assert ("detections" in info) == bool(options)
    assert env.truth.time == 2.0
    np.testing.assert_array_equal(env.tracks.id, env.truth.objects.id)
    return env, radar


def test_perfect_tracks_alone_need_no_scan_and_one_that_is_read_late_is_the_same():
    (env, radar), frames = driven(), list[Frame]()
    assert radar.scans == 0
    watched, busy = driven(frames)
    assert (busy.scans, len(frames)) == (11, 11)
    np.testing.assert_array_equal(env.scan.polar, frames[-1].scan.polar)
    np.testing.assert_array_equal(env.origin.object, watched.origin.object)
    assert (radar.scans, env.costs["truth"].scans) == (11, 11)
    assert driven(also=["rm-feldmann"])[1].scans == 11


def test_of_the_scenes_that_wait_for_a_scan_the_first_is_scanned_when_they_are_too_many(monkeypatch):
    patient = driven()[0].scan
    monkeypatch.setattr(perception, "MAX_DEFERRED_SCANS", 4)
    env, radar = driven()
    assert radar.scans == 11 - 4
    np.testing.assert_array_equal(env.scan.polar, patient.polar)


# Life and errors


def test_an_environment_may_be_closed_twice():
    env = TrackedEnv(gym.make("merge-v1", render_mode="rgb_array"), tracker=OneTrack([12.0, 0.0, 0.0], [3.0, 0.0]))
    env.reset(seed=0)
    env.render()
    env.close()
    env.close()


def test_a_window_for_people_shows_the_true_world_and_hides_it_again(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # there is no window, but the road that it would show
    env = TrackedEnv(gym.make("merge-v1", render_mode="human"), tracker=OneTrack([12.0, 0.0, 0.0], [3.0, 0.0]))
    env.reset(seed=0)
    shown = []
    env.unwrapped.viewer.display = lambda: shown.append(len(env.unwrapped.road.vehicles))
    env.render()
    assert shown == [sum(kind != "obstacle" for kind in env.truth.objects.kind) + 1]
    assert shown[0] > 2
    assert len(env.unwrapped.road.vehicles) == 2
    env.close()


def test_intersections_leave_the_constants_of_other_traffic_alone():
    before = {k: v for k, v in vars(IDMVehicle).items() if k.isupper()}
    with ProtectedConstants():
        inner = make("intersection-v2")
    env = TrackedEnv(inner, tracker="truth")
    env.reset(seed=0)
    env.step(1)
    assert {k: v for k, v in vars(IDMVehicle).items() if k.isupper()} == before


def test_two_controlled_vehicles_are_both_known():
    with ProtectedConstants():
        env = TrackedEnv(make("intersection-multi-agent-v0"), tracker="rm-feldmann")
        observation, _ = env.reset(seed=0)
        env.step((1, 1))
    assert len(observation) == 2
    core = env.unwrapped
    assert core.road.vehicles[:2] == core.controlled_vehicles


def test_a_step_before_reset_is_an_error():
    with pytest.raises(gym.error.ResetNeeded):
        TrackedEnv(make("highway-fast-v0").unwrapped, tracker="truth").step(1)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"tracker": "rm-feldman"}, LookupError, "did you mean 'rm-feldmann'"),
        ({"tracker": None}, TypeError, "tracker must be a name, .* got None; try 'imm-spline'"),
        ({"tracker": MultiObjectTracker}, TypeError, "tracker must be a name, .* got <class"),
        ({"tracker": {"sigma": 0.3}}, ValueError, "tracker .* has no key 'name'"),
        ({"tracker": {"name": None}}, TypeError, "the name of a tracker must be a string, got None"),
        ({"tracker": {"name": "rm-feldmann", "sigm": 1}}, TypeError, "rm-feldmann has no parameter sigm; it has"),
        ({"radar": "suround"}, LookupError, "did you mean 'surround'"),
        ({"radar": None}, TypeError, "radar must be a name, .* got None; try 'surround'"),
        ({"radar": {"name": "front", "rat": 4.0}}, TypeError, "radar front has no parameter rat; it has .*rate"),
        ({"also": [DEFAULT]}, ValueError, "different names"),
        ({"also": "rm-koch"}, TypeError, "also must be a sequence of trackers, got 'rm-koch'"),
        ({"also": {"name": "rm-koch"}}, TypeError, "also must be a sequence of trackers, got {"),
        ({"also": None}, TypeError, "also must be a sequence of trackers, got None"),
        ({"planner": "nope"}, LookupError, "no planner 'nope'; known: idm"),
        ({"planner": None}, TypeError, "planner must be a name, or an object with a name, got None"),
        ({"log": "loud"}, ValueError, "log must be one of off, metrics, full, got 'loud'"),
        ({"log": "metrics", "metrics": False}, ValueError, "log must be 'off' where metrics are off, got 'metrics'"),
        ({"road": "fast"}, ValueError, "road must be one of cached, stock, got 'fast'"),
        ({"out": 3}, TypeError, "out must be a directory or None, got 3"),
    ],
)
def test_a_wrong_argument_is_named_at_construction(arguments, error, message):
    with pytest.raises(error, match=message):
        TrackedEnv(make("highway-fast-v0"), **arguments)


def test_an_environment_that_cannot_be_tracked_is_named():
    for env in (gym.make("CartPole-v1"), "highway-v0"):
        with pytest.raises(TypeError, match="env must be a highway-env environment, got"):
            TrackedEnv(env)
    for env in (gym.make("testbed/cut-in-v0"), gym.wrappers.TimeLimit(TrackedEnv(make("highway-fast-v0")), 5)):
        with pytest.raises(ValueError, match="env has a radar and trackers already"):
            TrackedEnv(env)
    for frequency in (0, -1, 1000, float("nan"), "x"):
        with pytest.raises(ValueError, match=r"'simulation_frequency'. must be"):
            TrackedEnv(make("highway-fast-v0", simulation_frequency=frequency))


def test_a_planner_of_ones_own_lends_its_name():
    assert TrackedEnv(make("highway-fast-v0"), planner=SimpleNamespace(name="mine")).planner == "mine"


def test_further_trackers_may_come_from_a_generator():
    env = TrackedEnv(make("highway-fast-v0"), tracker="truth", also=(name for name in ["rm-koch"]))
    assert list(env.costs) == ["truth", "rm-koch"]


# Actions and the end


@pytest.mark.parametrize("action", [7, -1, 1.5, "FASTER", np.array([1]), (1, 1)])
def test_an_action_outside_the_space_is_refused_and_nothing_is_simulated(action):
    env = TrackedEnv(make("highway-fast-v0"), tracker="truth")
    env.reset(seed=0)
    with pytest.raises(gym.error.InvalidAction, match=r"is not in the action space Discrete\(5\)") as caught:
        env.step(action)
    assert repr(action) in str(caught.value)
    assert env.unwrapped.steps == 0
    env.step(np.int64(1))
    assert env.truth.time == 1.0


def test_continuous_actions_may_be_any_numbers_within_the_box():
    env = gym.make("testbed/cut-in-v0", tracker="truth", config={"action": {"type": "ContinuousAction"}})
    env.reset(seed=0)
    for action in (np.zeros(2), [0.1, 0.0], np.array([1, 0], np.float32)):
        env.step(action)
    for action in ([2.0, 0.0], [np.nan, 0.0], [0.0], 1, "ab"):
        with pytest.raises(gym.error.InvalidAction, match="is not in the action space Box"):
            env.step(action)


def test_actions_of_several_vehicles_are_checked_one_by_one():
    with ProtectedConstants():
        env = TrackedEnv(make("intersection-multi-agent-v0"), tracker="truth")
        env.reset(seed=0)
        for action in ((1, 9), (1,), [1, 1]):
            with pytest.raises(gym.error.InvalidAction, match="is not in the action space Tuple"):
                env.step(action)


def test_a_step_after_the_end_asks_for_a_reset():
    env = gym.make("testbed/cut-in-v0", tracker="truth", config={"duration": 0.4})
    env.reset(seed=0)
    assert [env.step(1)[3] for _ in range(2)] == [False, True]
    with pytest.raises(gym.error.ResetNeeded, match="after the end of the episode"):
        env.step(1)
    assert env.truth.time == pytest.approx(0.4)
    env.reset()
    env.step(1)


# Pickles


@pytest.mark.parametrize("name", ["testbed/articulated-turn-v0", "highway-fast-v0"])
def test_a_pickled_environment_goes_on_as_the_original(name):
    env = gym.make(name, also=["truth"]) if name.startswith("testbed") else TrackedEnv(make(name), also=["truth"])
    env.reset(seed=2)
    for _ in range(3):
        env.step(1)
    again = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(states(again), states(env))
    for action in (1, 4, 3):
        (a, *flags, info), (b, *others, other) = env.step(action), again.step(action)
        np.testing.assert_array_equal(b, a)
        assert (others, other["tracks"]) == (flags, info["tracks"])
        for mine, yours in ((env.truth.objects, again.truth.objects), (env.tracks.estimate, again.tracks.estimate)):
            np.testing.assert_equal(yours, mine)
        np.testing.assert_array_equal(again.scan.polar, env.scan.polar)
        np.testing.assert_array_equal(again.tracks.id, env.tracks.id)
    (a, _), (b, _) = env.reset(), again.reset()
    np.testing.assert_array_equal(b, a)
    np.testing.assert_array_equal(again.scan.polar, env.scan.polar)


def test_a_pickled_environment_leaves_the_files_to_the_original(tmp_path):
    env = gym.make("testbed/cut-in-v0", tracker="truth", out=str(tmp_path), log="metrics")
    env.reset(seed=0)
    again = pickle.loads(pickle.dumps(env))
    frames: list[Frame] = []
    again.attach(frames.append)
    for e in (env, again):
        e.step(1)
    assert again.recorder is None
    assert len(frames) == 3
    again.close()
    assert not list(tmp_path.glob("*.json"))
    env.close()
    assert len(list(tmp_path.glob("*.json"))) == 1


def test_trackers_get_the_map_of_every_episode_unless_they_bring_one():
    road = RoadMap.of([(np.array([[0.0, 0.0], [10.0, 0.0]]), 4.0)])
    stock = MultiObjectTracker(find("rm-feldmann"), sensors.find("front").models)
    assert on_road(stock, road).road is road
    own = replace(stock, road=RoadMap.of([]))
    assert on_road(own, road) is own
    assert on_road(None, road) is None


def test_the_map_lets_a_vehicle_be_found_that_stands_in_a_lane():
    action = {"type": "DiscreteMetaAction", "target_speeds": [0, 5, 10]}
    env = TrackedEnv(make("highway-v0", action=action, lanes_count=3), radar="front")
    core = env.unwrapped

    def reset() -> None:
        core._create_road()
        core.vehicle = MDPVehicle(core.road, [100.0, 4.0], speed=10.0, target_speeds=[0, 5, 10])
        core.road.vehicles = [core.vehicle, Vehicle(core.road, [170.0, 4.0], speed=0.0)]

    core._reset = reset
    env.reset(seed=0)
    for _ in range(5):
        env.step(1)
    (track,) = core.road.vehicles[1:]
    assert np.hypot(*(track.position - [170.0, 4.0])) < 3.0  # only its rear is seen
    assert np.hypot(*track.velocity) < 1.0


def test_objects_are_taken_as_well_as_names():
    radar, rm = sensors.find("front"), find("rm-feldmann", sigma=0.3)
    env = TrackedEnv(make("highway-fast-v0"), tracker=rm, radar=radar, also=[{"name": "rm-feldmann", "sigma": 0.3}])
    env.reset(seed=0)
    env.step(1)
    one, two = env.all_tracks.values()
    assert list(env.all_tracks) == ["RandomMatrix", "rm-feldmann(sigma=0.3)"]
    np.testing.assert_array_equal(one.estimate.pose, two.estimate.pose)
    assert label("truth") == "truth"


def test_faults_that_have_not_begun_change_no_bit_and_later_ones_no_traffic():
    """The same drive without faults, with one that never begins, and with lost scans."""
    drives = []
    for faults in ((), "front:outage:50:60", ["drop:0.5"]):
        frames = []
        env = gym.make("testbed/cut-in-v0", tracker="truth", radar="front", faults=faults)
        env.attach(frames.append)
        env.reset(seed=4)
        env.step(1)
        drives.append(frames)
    for one, same, lossy in zip(*drives, strict=True):
        np.testing.assert_array_equal(one.scan.polar, same.scan.polar)
        np.testing.assert_array_equal(one.scene.objects.pose, lossy.scene.objects.pose)
        if lossy.scan.delivered.all():
            np.testing.assert_array_equal(one.scan.polar, lossy.scan.polar)
        else:
            assert len(lossy.scan.mask) == 0
    assert 0 < sum(frame.scan.delivered.all() for frame in drives[2]) < len(drives[2])


def test_a_fault_of_sensors_that_the_radar_has_not_is_refused():
    with pytest.raises(ValueError, match="no 'rear'"):
        gym.make("testbed/cut-in-v0", radar="front", faults="rear:drop:0.1")

"""Each line of docs/contract.md."""

import copy
import pickle
import re
import subprocess
import sys
from math import inf, isnan
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import testbed
from sensors.scene import Scene
from trackers.multi.tracks import Tracks
from trackers.scan import Scan

PAGE = (Path(__file__).parents[3] / "docs" / "contract.md").read_text()
KINDS = {"float": (float, np.floating), "bool": (bool, np.bool_), "int": (int,), "dict": (dict,)}
OPTIONAL = {"rewards", "detections", "track_ids"}  # the page says where they are missing
SAMPLE = """
import gymnasium, testbed
env = gymnasium.make("testbed/lone-leader-v0", tracker="rm-koch")
print([env.reset(seed=seed)[1]["action"] for seed in (0, 1, 2, None)])
"""


def documented():
    """Key -> type of the table of `info`."""
    rows = re.findall(r"^\| `([\w.]+)` \| ([\w -]+) \|[^|]*\| [^|]+ \|$", PAGE, re.M)
    assert len(rows) > 12
    return dict(rows)


def flat(info):
    """Keys of an info as the page names them, with their values."""
    inner = {f"drive.{key}": value for key, value in info["drive"].items()}
    return {**info, **inner}


def lone(**options):
    return gym.make("testbed/lone-leader-v0", **{"tracker": "rm-koch", **options})


@pytest.fixture(scope="module")
def episode():
    """The infos of a short episode of `cut-in` on tracks, that of the reset first."""
    env = gym.make("testbed/cut-in-v0", tracker="rm-koch")
    infos = [env.reset(seed=3)[1]]
    infos += [env.step(1)[-1] for _ in range(3)]
    return infos


def test_info_holds_what_the_page_lists_in_the_types_that_it_names(episode):
    kinds = documented()
    for info in episode:
        found = flat(info)
        assert set(found) | OPTIONAL == set(kinds)
        for key in found:
            if kinds[key] in KINDS:
                assert isinstance(found[key], KINDS[kinds[key]]), key


def test_keys_that_may_be_missing_are_missing_where_the_page_says():
    _, info = lone(tracker="truth").reset(seed=0)
    assert {"rewards"} == OPTIONAL & set(info)
    _, info = testbed.TrackObservation(lone()).reset(seed=0)
    assert set(info) >= OPTIONAL
    assert (info["track_ids"] == -1).any()
    _, info = testbed.TrackedEnv(gym.make("parking-v0"), "rm-koch").reset(seed=0)
    assert "rewards" not in info
    assert "is_success" in info


def test_the_acceleration_is_nan_at_a_reset_and_known_after_a_decision(episode):
    assert [isnan(info["drive"]["acceleration"]) for info in episode] == [True, False, False, False]


def test_times_and_gaps_are_infinite_without_another_body():
    env = testbed.TrackedEnv(gym.make("highway-v0", config={"vehicles_count": 0}), "rm-koch")
    drive = env.reset(seed=0)[1]["drive"]
    infinite = {key for key, value in drive.items() if value == inf}
    assert infinite == {"distance", "ttc", "ttc_plane", "gap", "headway"}
    assert drive["drac"] == 0


def test_the_action_of_a_reset_is_a_sample_from_the_seed_also_in_another_process():
    runs = [
        subprocess.run([sys.executable, "-c", SAMPLE], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert len(set(re.findall(r"\d+", runs[0].replace("int64", "")))) > 1  # a sample, no constant
    env = lone()
    assert env.action_space.contains(env.reset(seed=0)[1]["action"])


def test_a_crash_terminates_and_is_worth_the_collision_reward():
    env = lone(config={"collision_reward": -1.0})
    env.reset(seed=0)
    env.unwrapped.vehicle.crashed = True
    _, reward, terminated, truncated, info = env.step(1)
    assert (reward, terminated, truncated, info["crashed"]) == (-1.0, True, False, True)
    assert isnan(info["drive"]["acceleration"])
    with pytest.raises(gym.error.ResetNeeded, match="after the end of the episode"):
        env.step(1)


def test_the_duration_truncates_and_counts_from_the_first_observation():
    env = lone(config={"duration": 0.6}, warm_up=1.0)
    env.reset(seed=0)
    assert env.truth.time == pytest.approx(1.0)
    ends = [env.step(1)[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    assert env.truth.time == pytest.approx(1.6)


def test_a_step_is_one_decision_of_simulated_frames_with_a_scan_each_unless_the_radar_is_slower():
    times = {}
    for rate in (None, 5):
        env, seen = lone(radar={"name": "surround", "rate": rate}), []
        env.attach(lambda frame, seen=seen: seen.append(frame.time))
        env.reset(seed=0)
        env.step(1)
        times[rate] = np.round(np.array(seen) * 15, 6).tolist()
    config = env.unwrapped.config
    assert (config["policy_frequency"], config["simulation_frequency"]) == (5, 15)
    assert times == {None: [0, 1, 2, 3], 5: [0, 3]}


def test_wrong_calls_are_refused_and_simulate_nothing():
    env = lone()
    with pytest.raises(gym.error.ResetNeeded, match="before reset"):
        env.step(1)
    env.reset(seed=0)
    with pytest.raises(gym.error.InvalidAction):
        env.step(99)
    assert env.unwrapped.steps == 0
    env.step(None)
    assert env.unwrapped.steps == 3


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        (7, TypeError, r"^options must be a dict or None, got 7; write options=\{'config': \{\.\.\.\}\}$"),
        ({"seed": 3}, ValueError, r"^options has no key 'seed'; known: 'config'"),
        ({"config": {}, "configs": {}}, ValueError, r"^options has no key 'configs'; known: 'config'"),
        ({"config": 7}, TypeError, r"^options\['config'\] must be a dict, got 7; leave it out$"),
        ({"config": {"other_vehicles_type": "Mine"}}, ValueError, "^config\\['other_vehicles_type'\\] is not used"),
    ],
)
def test_options_that_no_reset_takes_are_refused_in_one_sentence(options, error, words):
    env = lone()
    with pytest.raises(error, match=words):
        env.reset(seed=0, options=options)
    env.reset(seed=0, options={"config": {"duration": 3.0}})
    env.reset(seed=0)
    assert env.unwrapped.config["duration"] == 3.0  # from that reset on


def test_the_same_seed_and_actions_give_the_same_bits():
    def bits(env):
        observation, info = env.reset(seed=7)
        found = [(observation.tobytes(), repr(info))]
        for action in (1, 3, 4):
            observation, *rest, info = env.step(action)
            found.append((observation.tobytes(), *rest, repr(info)))
        env.reset()
        return [*found, repr(env.step(1)[-1])]

    assert bits(lone()) == bits(lone())


def test_a_deep_copy_has_no_truth_and_a_pickle_goes_on():
    env = lone()
    env.reset(seed=0)
    twin, other = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    for name in ("truth", "tracks", "scan"):
        with pytest.raises(AttributeError):
            getattr(twin, name)
    assert {type(v).__name__ for v in twin.unwrapped.road.vehicles} <= {
        "TrackVehicle",
        type(env.unwrapped.vehicle).__name__,
    }
    twin.step(1)
    assert repr(env.step(1)) == repr(other.step(1))


def test_the_truth_is_behind_other_wrappers_and_not_on_the_road():
    env = gym.wrappers.TimeLimit(lone(), 5)
    env.reset(seed=0)
    env.step(1)
    found = [env.get_wrapper_attr(name) for name in ("truth", "tracks", "scan")]
    assert [type(value) for value in found] == [Scene, Tracks, Scan]
    ego, *others = env.unwrapped.road.vehicles
    assert ego is env.unwrapped.vehicle
    assert {type(v).__name__ for v in others} <= {"TrackVehicle"}

"""The probes: their parameters, and drives on the truth that are just safe."""

import gymnasium as gym
import numpy as np
import pytest

from scenarios import PROBES, find
from testbed.environment.registration import env_id
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.experiments.probe import BLIND, driven, fails
from testbed.experiments.run import Run
from testbed.frame import TRUTH
from testbed.planners import find as find_planner
from tests.parameters import rest_slow

WANTS = {"probe-merge": "idm-keen"}  # planners that want what the probe is about; the others need none


def drive(name, seed, planner="idm", **config):
    """Measures of a drive on the truth, and the courses of the others, (frames, vehicles, 3)."""
    env = gym.make(env_id(name), tracker="truth", config=config)
    evaluator, poses, chooses = DriveEvaluator(), [], find_planner(planner)
    env.attach(lambda frame: (evaluator.step(frame.scene), poses.append(frame.scene.objects.pose)))
    env.reset(seed=seed)
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step(chooses.act(env))
        done = terminated or truncated
    assert info["drive"]["gap"] == evaluator.curves.gap[-1]
    return evaluator.summary(), np.array(poses)


@pytest.mark.parametrize("name", rest_slow(PROBES, "probe-brake", "probe-passing", "probe-merge"))
def test_a_probe_is_just_safe_on_the_truth(name):
    measures, _ = drive(name, 1, WANTS.get(name, "idm"))
    assert not measures["collisions"]
    if name == "probe-passing":
        assert measures["deceleration_max"] < 1.0
    else:
        assert 1.0 < min(measures["ttc_min"], measures["ttc_plane_min"]) < 4.0


@pytest.mark.parametrize("planner", ["idm", "mpc", "idm-keen"])
@pytest.mark.parametrize("name", rest_slow([p for p in PROBES if p != "probe-passing"], "probe-oncoming"))
def test_who_sees_nothing_fails_in_every_probe_that_calls_for_braking(name, planner):
    if planner == "idm-keen" and name not in WANTS:
        pytest.skip("the planner differs from idm in probe-merge only")
    for seed in (900, 901):
        truth, blind = (driven(Run(name, seed, source, planner, warm_up=1.0)) for source in (TRUTH, BLIND))
        assert fails(blind, truth)
        assert not truth["collisions"]


def test_the_others_follow_their_courses_whatever_the_ego_does():
    (_, braked), (_, kept) = drive("probe-cutin", 3), drive("probe-cutin", 3, planner="idle")
    n = min(len(braked), len(kept))
    np.testing.assert_array_equal(braked[:n], kept[:n])
    assert n > 50


def test_a_probe_can_be_made_harder():
    assert drive("probe-brake", 0, gap=20.0)[0]["ttc_min"] < drive("probe-brake", 0, gap=50.0)[0]["ttc_min"]


def test_the_ego_keeps_its_lane_in_a_probe_unless_a_change_for_nothing_is_the_question():
    lateral = [name for name in PROBES if gym.make(env_id(name)).unwrapped.action_type.lateral]
    assert lateral == [name for name in PROBES if find(name).lateral]
    assert lateral == ["probe-passing", "probe-merge"]


@pytest.mark.parametrize("value", [1.0, 1000.0, "30", True, float("nan")])
def test_a_parameter_outside_its_range_is_refused(value):
    env = gym.make(env_id("probe-brake"), config={"gap": 30})
    assert env.unwrapped.config["gap"] == 30
    with pytest.raises(ValueError, match="gap must be a number from 6 to 60 m, got"):
        gym.make(env_id("probe-brake"), config={"gap": value})


def test_a_scenario_without_parameters_takes_none():
    with pytest.raises(ValueError, match="config has no key 'gap'"):
        gym.make(env_id("cut-in"), config={"gap": 30})
    with pytest.raises(ValueError, match="probe-brake has no parameter gab; it has gap"):
        find("probe-brake").build(np.random.default_rng(0), {"gab": 3.0})

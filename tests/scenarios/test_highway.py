import sys

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from scenarios import SCENARIOS, Scenario, find
from scenarios.bodies import parts, rear_extent
from scenarios.drivers import balanced_target, steady_gap
from scenarios.highway import ScenarioEnv, build_config
from scenarios.stage import Phase, maneuver_end, phases
from scenarios.vehicles import SizedIDM
from tests.parameters import KINDS, rest_slow
from tests.scenarios.episodes import world_only

IDLE, FASTER, SLOWER = 1, 3, 4
every_scenario = pytest.mark.parametrize("name", SCENARIOS)


def idm_action(env, cruise):
    """Meta action whose target speed is closest to what IDM wants within the time constant of the speed control."""
    ego = env.vehicle
    limit = max(min(cruise, ego.lane.speed_limit), 0.1)
    free = 3.0 * (1 - (max(ego.speed, 0.0) / limit) ** 4)
    wish = free
    for lane in {ego.lane_index, ego.target_lane_index}:
        leader, _ = env.road.neighbour_vehicles(ego, lane)
        if leader is not None:
            gap = max(np.linalg.norm(leader.position - ego.position) - ego.LENGTH / 2 - rear_extent(leader), 0.5)
            closing = ego.speed - float(leader.velocity @ ego.direction)
            wanted = 5.0 + max(0.0, 1.3 * ego.speed + ego.speed * closing / (2 * np.sqrt(15.0)))
            wish = min(wish, free - 3.0 * (wanted / gap) ** 2)
    half_step = (ego.target_speeds[1] - ego.target_speeds[0]) / 2
    want = ego.speed + 0.6 * wish
    if want < ego.target_speed - half_step:
        return _index(env, "SLOWER")
    return _index(env, "FASTER" if want > ego.target_speed + half_step and ego.target_speed < limit else "IDLE")


def _index(env, action):
    return env.action_type.actions_indexes[action]


def drive(name, seed):
    """Run an episode with the cautious driver; the env at its end and whether it was truncated."""
    env = world_only(name)
    env.reset(seed=seed)
    cruise = 1.1 * env.vehicle.speed
    terminated = truncated = False
    while not (terminated or truncated):
        _, _, terminated, truncated, _ = env.step(idm_action(env, cruise))
    return env, truncated


def state(env):
    return [(*v.position, v.heading, v.speed, *p.pose) for v in env.road.vehicles for p in parts(v)]


@pytest.mark.parametrize("name", rest_slow(SCENARIOS, *KINDS, "merge", "hard-brake"))
def test_nobody_crashes_while_the_ego_drives_cautiously(name):
    env, truncated = drive(name, seed=0)
    assert truncated
    assert 0 <= env.steps - 15 * find(name).duration < 3  # frames of a decision
    assert [v for v in env.road.vehicles if v.crashed] == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@every_scenario
def test_nobody_crashes_under_other_seeds(name, seed):
    env, truncated = drive(name, seed)
    assert truncated
    assert [v for v in env.road.vehicles if v.crashed] == []


def test_a_reckless_driver_does_crash():
    env = world_only("hard-brake")
    env.reset(seed=0)
    while not env.step(FASTER)[2]:
        assert env.steps < 300


@pytest.mark.parametrize("name", rest_slow(SCENARIOS, *KINDS))
def test_the_environment_keeps_the_contract_of_gymnasium(name):
    check_env(ScenarioEnv(name), skip_render_check=True)


@pytest.mark.parametrize("name", ["cut-in", "s-curve", "articulated-turn"])
def test_the_same_seed_gives_the_same_episode(name):
    episodes = []
    for _ in range(2):
        env = ScenarioEnv(name)
        env.reset(seed=11)
        for action in (IDLE, FASTER, SLOWER, IDLE):
            env.step(action)
        episodes.append(state(env))
    assert episodes[0] == episodes[1]


def test_the_platoons_start_without_hard_braking():
    for name in SCENARIOS:
        env = world_only(name)
        env.reset(seed=1)
        env.step(IDLE)
        drivers = [v for v in env.road.vehicles if isinstance(v, SizedIDM)]
        limit = -3.5 if name in ("stop-and-go", "six-radar-highway") else -2.5  # [m/s^2] both begin close together
        assert min((v.action["acceleration"] for v in drivers), default=0.0) > limit, name


def test_a_steady_gap_and_its_target_speed_are_inverse():
    gap = steady_gap(25.0, 29.0, 1.2)
    assert balanced_target(25.0, gap, 1.2) == pytest.approx(29.0)
    assert balanced_target(25.0, np.inf, 1.2) == 25.0


def test_the_ego_starts_near_a_target_speed_in_steps_of_two_and_a_half():
    env = ScenarioEnv("following")
    env.reset(seed=2)
    np.testing.assert_allclose(np.diff(env.vehicle.target_speeds), 2.5)
    assert abs(env.vehicle.target_speed - env.vehicle.speed) <= 1.25


def test_target_speeds_of_the_config_reach_the_ego():
    env = ScenarioEnv("following", config={"action": {"type": "DiscreteMetaAction", "target_speeds": [0, 10, 20, 30]}})
    env.reset(seed=2)
    assert env.vehicle.target_speeds.tolist() == [0, 10, 20, 30]
    assert env.vehicle.target_speed in (20, 30)


def test_walls_and_phases_are_there_after_a_reset():
    env = ScenarioEnv("cut-in")
    env.reset(seed=0)
    assert env.walls.shape == (128, 2, 2)
    assert [p.name for p in env.phases] == ["before", "onset", "during", "after"]


def test_reward_rises_with_speed_and_stays_in_the_unit_interval():
    env = ScenarioEnv("following")
    env.reset(seed=0)
    rewards = []
    for speed in (0.0, 15.0, 30.0, 40.0):
        env.vehicle.speed = speed
        rewards.append(env._reward(IDLE))
    assert rewards == pytest.approx([0.0, 0.5, 1.0, 1.0], abs=1e-6)
    env.vehicle.crashed = True
    assert env._reward(IDLE) == 0.0


def test_the_duration_of_the_scenario_holds_unless_the_config_names_one():
    short = Scenario("short", "One second of following.", find("following").builder, 9, duration=1.0)
    for env, frames in ((ScenarioEnv(short), 15), (ScenarioEnv(short, config={"duration": 2.0}), 30)):
        env.reset(seed=0)
        while not env.step(IDLE)[3]:
            assert env.steps < 40
        assert env.steps == frames


def test_an_episode_may_end_with_the_maneuver():
    env = ScenarioEnv("cut-in", config={"after": 2.0, "duration": 30.0})
    env.reset(seed=0)
    (over,) = [phase.start for phase in env.phases if phase.name == "after"]
    while not env.step(IDLE)[3]:
        assert env.steps < 450
    assert env.steps / 15 == pytest.approx(over + 2.0, abs=0.1 + 1 / 5)  # whole decisions
    short = ScenarioEnv("cut-in", config={"after": 2.0, "duration": 1.0})
    short.reset(seed=0)
    while not short.step(IDLE)[3]:
        assert short.steps < 450
    assert short.steps == 15


def test_a_maneuver_ends_where_what_is_after_it_begins():
    assert maneuver_end(()) is None
    assert maneuver_end((Phase("right", 0.0, 3.0), Phase("left", 3.0, 8.0))) == 8.0
    assert maneuver_end(phases(2.0, 7.0)) == 7.0


def test_a_picture_shows_the_road():
    env = ScenarioEnv("cut-in", render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (150, 600, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3
    env.close()


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"policy_freqency": 5}, "no key 'policy_freqency'"),
        ({"policy_frequency": 4}, "must divide"),
        ({"simulation_frequency": 1000}, "'simulation_frequency'. must be at most 100 Hz, got 1000 Hz"),
        ({"simulation_frequency": 0}, "'simulation_frequency'. must be positive and finite, got 0; give it in Hz"),
        ({"simulation_frequency": -1}, "'simulation_frequency'. must be positive and finite, got -1"),
        ({"simulation_frequency": "15"}, "'simulation_frequency'. must be positive and finite, got '15'"),
        ({"policy_frequency": True}, "'policy_frequency'. must be positive and finite, got True"),
        ({"policy_frequency": 30}, "30 Hz must not exceed simulation_frequency 15 Hz"),
        ({"duration": 0}, "'duration'. must be positive and finite, got 0; give seconds"),
        ({"duration": "x"}, "'duration'. must be positive and finite, got 'x'"),
        ({"duration": float("nan")}, "'duration'. must be positive and finite, got nan"),
        ({"after": 0}, "'after'. must be positive and finite, got 0; give seconds or None"),
        ({"duration": float("inf")}, "'duration'. must be positive and finite, got inf"),
        ({"observation": {"vehicles_count": 5}}, "whole dict"),
        ({"action": {"type": "MultiAgentAction"}}, "ContinuousAction, DiscreteAction, DiscreteMetaAction, got 'Multi"),
        ({"action": {"type": "ContinuousAction", "dynamical": True}}, "dynamical"),
    ],
)
def test_a_config_that_cannot_work_is_refused(config, message):
    with pytest.raises(ValueError, match=message):
        ScenarioEnv("cut-in", config=config)


@pytest.mark.parametrize("duration", ["x", float("nan"), float("inf"), 0, None])
def test_a_scenario_of_no_duration_is_refused(duration):
    with pytest.raises(ValueError, match="short: duration must be positive and finite, got"):
        Scenario("short", "Nothing.", find("following").builder, 9, duration=duration)


# Action types


@pytest.mark.parametrize("kind", ["ContinuousAction", "DiscreteAction", "DiscreteMetaAction"])
def test_every_action_type_keeps_the_contract_of_gymnasium(kind):
    check_env(ScenarioEnv("cut-in", config={"action": {"type": kind}}), skip_render_check=True)


def drive_straight(kind, action):
    """The ego's speeds [m/s] before and after a second of one action, and its headings [rad]."""
    env = ScenarioEnv("following", config={"action": {"type": kind}})
    env.reset(seed=0)
    before = env.vehicle.speed, env.vehicle.heading
    for _ in range(5):
        env.step(action)
    return before, (env.vehicle.speed, env.vehicle.heading)


@pytest.mark.parametrize(("pedal", "change"), [(-0.5, -2.5), (0.0, 0.0), (0.5, 2.5)])  # of 5 m/s^2, in one second
def test_continuous_actions_set_the_acceleration(pedal, change):
    (speed, heading), (later, turned) = drive_straight("ContinuousAction", np.array([pedal, 0.0]))
    assert later - speed == pytest.approx(change, abs=1e-9)
    assert turned == heading


def test_discrete_actions_set_acceleration_and_steering():
    """Nine of them, by acceleration -5, 0, 5 m/s^2, then by steering left, none, right."""
    for action, change in ((1, -5.0), (4, 0.0), (7, 5.0)):
        (speed, heading), (later, turned) = drive_straight("DiscreteAction", action)
        assert later - speed == pytest.approx(change, abs=1e-9)
        assert turned == heading
    (_, heading), (_, turned) = drive_straight("DiscreteAction", 5)
    assert turned > heading + 0.1


def test_the_traffic_starts_alike_under_every_action_type():
    worlds = []
    for kind in ("ContinuousAction", "DiscreteAction", "DiscreteMetaAction"):
        env = ScenarioEnv("cut-in", config={"action": {"type": kind}})
        env.reset(seed=3)
        assert env.road.vehicles.index(env.vehicle) == 0
        worlds.append([(state, v.LENGTH, v.WIDTH, v.contour) for state, v in zip(state(env), env.road.vehicles)])
    assert worlds[0] == worlds[1] == worlds[2]


# Finite Markov decision process


@pytest.fixture
def mdp_package(tmp_path, monkeypatch):
    """A stand-in for the package that highway-env puts the tables into."""
    (tmp_path / "finite_mdp").mkdir()
    (tmp_path / "finite_mdp" / "__init__.py").touch()
    (tmp_path / "finite_mdp" / "mdp.py").write_text(
        "class DeterministicMDP:\n"
        "    def __init__(self, transition, reward, terminal, state):\n"
        "        self.transition, self.reward, self.terminal, self.state = transition, reward, terminal, state\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for name in ("finite_mdp.mdp", "finite_mdp"):
        sys.modules.pop(name, None)


def test_a_finite_mdp_rewards_speed_and_no_collision(mdp_package):
    env = ScenarioEnv("hard-brake")
    env.reset(seed=0)
    for _ in range(10):
        env.step(FASTER)
    mdp = env.to_finite_mdp()
    speeds, lanes, instants = mdp.original_shape
    assert (speeds, instants) == (len(env.vehicle.target_speeds), 50)
    reward = mdp.reward.reshape(speeds, lanes, instants, 5)
    last = mdp.terminal.reshape(mdp.original_shape)
    hit = last & (np.arange(instants) < instants - 1)
    share = np.broadcast_to(np.linspace(0.0, 1.0, speeds)[:, None, None], hit.shape)
    assert hit.any()
    assert (reward[hit] == (share[hit] - 1.0)[:, None]).all()
    assert reward[~hit].max() == 1.0
    assert env.config == ScenarioEnv("hard-brake").config


def test_a_finite_mdp_needs_all_meta_actions(mdp_package):
    env = ScenarioEnv("hard-brake", config={"action": {"type": "DiscreteMetaAction", "lateral": False}})
    with pytest.raises(ValueError, match=r"to_finite_mdp needs config.'action'. of type DiscreteMetaAction"):
        env.to_finite_mdp()


def test_a_config_changes_only_what_it_names():
    default = ScenarioEnv.default_config()
    assert build_config(default, {"duration": 5.0}) == {**default, "duration": 5.0}


def test_an_unknown_scenario_is_named_with_the_nearest_one():
    with pytest.raises(LookupError, match="did you mean 'overtake'"):
        ScenarioEnv("overtaken")

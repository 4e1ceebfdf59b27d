"""Each way to the truth that docs/contract.md names: those that are closed, and what they show instead."""

import pickle
from copy import copy, deepcopy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import AddRenderObservation, TimeLimit
from highway_env.vehicle.objects import RoadObject

import testbed
from sensors.scene import Scene
from testbed.environment.wrapper import TrackedEnv
from tests.testbed.environment.test_wrapper import OneTrack, reachable

ID = "testbed/cut-in-v0"


def made(tracker="rm-koch", steps=2, **options):
    """A scenario on tracks, some decisions after its start."""
    env = gym.make(ID, tracker=tracker, **options)
    env.reset(seed=0)
    for _ in range(steps):
        env.step(1)
    return env


def episode(env, seed=5):
    """Observations of a reset with a seed and of two decisions, as bytes."""
    found = [env.reset(seed=seed)[0]]
    found += [env.step(action)[0] for action in (1, 4)]
    return [observation.tobytes() for observation in found]


def true_places(env):
    """Places of the true vehicles but the ego, as bytes."""
    ego = env.unwrapped.vehicle
    return {v.position.tobytes() for v in env._swap._truth.vehicles if v is not ego}


def through_pickle(env):
    return pickle.loads(pickle.dumps(env))


def before_a_reset(env):
    return deepcopy(gym.make(ID, tracker="rm-koch"))


def after_close(env):
    env.close()
    return deepcopy(env)


def stepped(env):
    twin = deepcopy(env)
    for _ in range(3):
        twin.step(4)
    return twin


COPIES = {
    "copy": deepcopy,
    "copy of a copy": lambda env: deepcopy(deepcopy(env)),
    "pickle": through_pickle,
    "pickle of a copy": lambda env: through_pickle(deepcopy(env)),
    "copy of a pickle": lambda env: deepcopy(through_pickle(env)),
    "shallow copy": copy,
    "stepped copy": stepped,
    "copy before a reset": before_a_reset,
    "copy after close": after_close,
    "copy of a wrapper": lambda env: deepcopy(TimeLimit(env, 50)),
    "copy within a wrapper": lambda env: deepcopy(TimeLimit(env, 50)).env,
}


@pytest.fixture(scope="module")
def on_tracks():
    return episode(gym.make(ID, tracker="rm-koch"))


@pytest.mark.parametrize("way", COPIES)
def test_a_copy_that_is_reset_sees_the_tracks_of_the_original_with_that_seed(way, on_tracks):
    assert episode(COPIES[way](made())) == on_tracks


def test_the_truth_has_other_observations(on_tracks):
    assert episode(gym.make(ID, tracker="truth"))[1] != on_tracks[1]


def test_a_reset_of_a_copy_leaves_the_original_its_tracker_and_its_files(tmp_path):
    env, alone = (made(OneTrack([12.0, 0.0, 0.0], [3.0, 0.0]), out=str(tmp_path / n), log="off") for n in "ab")
    twin = deepcopy(env)
    twin.reset(seed=5)
    twin.step(1)
    twin.close()
    assert not list((tmp_path / "a").glob("*.json"))
    np.testing.assert_array_equal(env.step(1)[0], alone.step(1)[0])
    assert len(env._perception.trackers["OneTrack"].dts) == len(alone._perception.trackers["OneTrack"].dts)
    env.close()
    assert len(list((tmp_path / "a").glob("*.json"))) == 1


INNER = {
    "unwrapped": lambda env: env.unwrapped,
    "the environment below": lambda env: env.env,
    "copy of unwrapped": lambda env: deepcopy(env.unwrapped),
    "shallow copy of unwrapped": lambda env: copy(env.unwrapped),
    "pickle of unwrapped": lambda env: through_pickle(env.unwrapped),
    "simplify": lambda env: env.unwrapped.simplify(),
    "simplify of a copy": lambda env: deepcopy(env).unwrapped.simplify(),
    "unwrapped of a copy": lambda env: deepcopy(env).unwrapped,
    "unwrapped of a pickle": lambda env: through_pickle(env).unwrapped,
    "change_vehicles": lambda env: env.unwrapped.change_vehicles("highway_env.vehicle.behavior.IDMVehicle"),
    "unwrapped of a copy that was reset": lambda env: (lambda twin: (twin.reset(seed=1), twin.unwrapped)[1])(
        deepcopy(env)
    ),
    "before a reset": lambda env: gym.make(ID).unwrapped,
    "highway-env": lambda env: TrackedEnv(TimeLimit(gym.make("highway-fast-v0"), 9), "rm-koch").env,
    "what an observation type holds": lambda env: env.unwrapped.observation_type.env,
}


@pytest.mark.parametrize("way", INNER)
def test_the_inner_environment_refuses_a_reset_in_one_sentence(way):
    inner = INNER[way](made(steps=1))
    with pytest.raises(gym.error.ResetNeeded, match=r"^reset goes around radar and tracker.*deep copy of that$"):
        inner.reset(seed=5)


BLIND = {
    "copy": deepcopy,
    "copy of a copy": lambda env: deepcopy(deepcopy(env)),
    "pickle of a copy": lambda env: through_pickle(deepcopy(env)),
    "copy of unwrapped": lambda env: deepcopy(env.unwrapped),
    "simplify": lambda env: env.unwrapped.simplify(),
    "road": lambda env: env.unwrapped.road,
    "pickle of the road": lambda env: through_pickle(env.unwrapped.road),
    "ego": lambda env: env.unwrapped.controlled_vehicles,
    "neighbours": lambda env: env.unwrapped.road.neighbour_vehicles(env.unwrapped.vehicle),
    "map": lambda env: (env.unwrapped.road.network, env.unwrapped.road.objects),
    "actions": lambda env: copy(env.unwrapped.action_type).__dict__ | {"env": None},
    "generator": lambda env: env.np_random,
    "config": lambda env: env.unwrapped.config,
    "info": lambda env: {key: value for key, value in env.step(1)[-1].items() if key != "drive"},
}


def seen_in(thing, places):
    """What can be reached from a thing that holds the truth: scenes, and road objects at true places."""
    hits = [x for x in reachable(thing) if isinstance(x, Scene)]
    return hits + [x for x in reachable(thing) if isinstance(x, RoadObject) and x.position.tobytes() in places]


@pytest.mark.parametrize("way", BLIND)
def test_nothing_that_a_planner_holds_refers_to_the_true_vehicles(way):
    env = made()
    thing = BLIND[way](env)
    assert seen_in(thing, true_places(env)) == []


def test_that_search_finds_the_truth_where_it_is():
    env = made()
    places = true_places(env)
    assert len(places) > 5
    assert seen_in(env._swap, places)
    assert seen_in(env._reader, places)
    assert seen_in([env.truth], places)


def test_there_is_no_road_before_the_first_reset_and_after_one_that_failed():
    env = gym.make(ID, tracker="rm-koch", render_mode="rgb_array")
    for _ in range(2):
        core = env.unwrapped
        assert core.road is None
        assert core.vehicle is None
        for refused in (lambda: env.step(1), lambda: deepcopy(env).step(1), env.render):
            with pytest.raises(gym.error.ResetNeeded, match="was called before reset"):
                refused()
        env.reset(seed=0)
        with pytest.raises(ValueError, match="frequency"):
            env.reset(options={"config": {"policy_frequency": 0}})


class Fails(OneTrack):
    """A tracker that has had enough after some steps."""

    def step(self, tracks, scan, dt):
        if len(self.dts) == 5:
            raise ArithmeticError("enough")
        return super().step(tracks, scan, dt)


def test_a_step_that_fails_leaves_the_belief_and_raises_one_error():
    env = made(Fails([12.0, 0.0, 0.0], [3.0, 0.0]), steps=1)
    with pytest.raises(ArithmeticError) as caught:
        env.step(1)
    assert caught.value.__context__ is None
    assert seen_in(env.unwrapped.road, true_places(env)) == []
    assert len(env.unwrapped.road.vehicles) == 2


# Pictures


BLIND_TRACKER = OneTrack([12.0, 0.0, 0.0], [3.0, 0.0], existence=0.1)  # reports nothing


def highway(tracker="rm-koch", below=None, **config):
    inner = gym.make("highway-fast-v0", config={"vehicles_count": 8, **config}, render_mode="rgb_array")
    return TrackedEnv(below(inner) if below else inner, tracker)


def pictures(env, look):
    env.reset(seed=0)
    return [look(env.step(1)[0]) for _ in range(2)]


def test_a_picture_for_a_program_shows_what_the_planner_knows():
    native = gym.make("highway-fast-v0", config={"vehicles_count": 8}, render_mode="rgb_array")
    true = pictures(native, lambda _: native.render())
    for tracker, alike in (("truth", True), (OneTrack([12.0, 0.0, 0.0], [3.0, 0.0]), False)):
        for of in (lambda env: env, lambda env: env.unwrapped, deepcopy, lambda env: deepcopy(env.unwrapped)):
            env = highway(tracker)
            found = pictures(env, lambda _, env=env, of=of: of(env).render())
            assert [np.array_equal(a, b) for a, b in zip(found, true, strict=True)] == [alike] * 2


@pytest.mark.parametrize("above", [True, False])
def test_pixels_as_an_observation_are_those_of_the_tracks(above):
    """A wrapper around or below the tracked environment replaces the observation by the picture."""
    env = AddRenderObservation(highway(BLIND_TRACKER)) if above else highway(BLIND_TRACKER, AddRenderObservation)
    empty, true = highway(BLIND_TRACKER), highway("truth")
    seen, due = pictures(env, np.copy), pictures(empty, lambda _: empty.render())
    np.testing.assert_array_equal(seen, due)
    assert not np.array_equal(seen, pictures(true, lambda _: true.render()))


def test_frames_of_a_film_within_a_decision_show_the_tracks():
    """`RecordVideo` asks for pictures while a step runs and the true road is in place."""
    env, film = highway(BLIND_TRACKER), []

    class Camera:
        frames_per_sec = 0

        def _capture_frame(self):
            core = env.unwrapped
            film.append((len(core.road.vehicles), env.render(), core.viewer.env.road.vehicles == [core.vehicle]))

    env.reset(seed=0)
    env.unwrapped.set_record_video_wrapper(Camera())
    env.render()
    env.step(1)
    assert [(count, blind) for count, _, blind in film] == [(9, True)] * 4
    assert all(picture.shape == (150, 600, 3) for _, picture, _ in film)


# Vector environments


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_vector_of_environments_sees_tracks_also_after_the_end_of_an_episode(mode):
    settings = {"tracker": "rm-koch", "config": {"duration": 0.4}}
    many, one = gym.make_vec(ID, 2, vectorization_mode=mode, **settings), gym.make(ID, **settings)
    truth = gym.make(ID, **{**settings, "tracker": "truth"})
    found = [many.reset(seed=[5, 6])[0][0]]
    found += [many.step(np.ones(2, int))[0][0] for _ in range(3)]  # the third begins the next episode
    due = [one.reset(seed=5)[0], one.step(1)[0], one.step(1)[0], one.reset()[0]]
    true = [truth.reset(seed=5)[0], truth.step(1)[0], truth.step(1)[0], truth.reset()[0]]
    many.close()
    np.testing.assert_array_equal(found, due)
    assert not np.array_equal(found, true)


def test_rows_of_tracks_of_a_copy_that_was_reset_are_those_of_the_original():
    env = testbed.TrackObservation(gym.make(ID, tracker="rm-koch", warm_up=0.6))
    env.reset(seed=0)
    (a, _), (b, _) = deepcopy(env).reset(seed=5), env.reset(seed=5)
    for key in a:
        np.testing.assert_array_equal(a[key], b[key])
    assert a["mask"].any()

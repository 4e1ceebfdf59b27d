"""The observation of tracks: its frame, order, mask and columns, by hand and on a running environment."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from sensors import RADARS
from testbed import TrackObservation
from testbed.environment.track_observation import CLASSES, COLUMNS, track_rows
from trackers import TRACKERS, build
from trackers.estimate import Estimate, prior
from trackers.geometry import rotation
from trackers.multi.tracks import Memory, Tracks

EGO = np.array([10.0, 5.0, 0.3])
EGO_VELOCITY = np.array([20.0, 4.0])


def tracks_at(position, existence=None, **known):
    """Tracks of the ids 100, 101, ... at positions (T, 2) [m], with full covariances."""
    n = len(position)
    rng = np.random.default_rng(3)
    root = rng.normal(size=(n, 4, 4))
    pose = np.column_stack([position, rng.uniform(-3, 3, n)])
    estimate = prior(pose, rng.normal(size=(n, 2)), 0.1, (5.0, 2.0), heading_std=0.2, yaw_rate_std=0.3)
    estimate = estimate._replace(cov=root @ root.mT, **known)
    existence = np.ones(n) if existence is None else np.asarray(existence)
    return Tracks(np.arange(n) + 100, existence, np.ones(n, int), np.arange(n) / 2.0, existence > 0.5, None, estimate)


def turned(tracks, angle):
    """The tracks in a world turned about its origin."""
    M, e = rotation(angle), tracks.estimate
    C = np.kron(np.eye(2), M)
    pose = np.column_stack([e.pose[:, :2] @ M.T, e.pose[:, 2] + angle])
    return tracks._replace(estimate=e._replace(pose=pose, velocity=e.velocity @ M.T, cov=C @ e.cov @ C.T))


@pytest.mark.parametrize("angle", [np.pi / 2, -2.0])
def test_turning_the_world_changes_nothing(angle):
    tracks = tracks_at(np.array([[30.0, 2.0], [-4.0, 9.0], [12.0, 40.0]]))
    M = rotation(angle)
    pose = np.array([*(M @ EGO[:2]), EGO[2] + angle])
    before = track_rows(tracks, EGO, EGO_VELOCITY, 4, 0.1)
    after = track_rows(turned(tracks, angle), pose, M @ EGO_VELOCITY, 4, 0.1)
    np.testing.assert_allclose(after.tracks, before.tracks, atol=1e-5)
    np.testing.assert_array_equal(after.id, before.id)


def test_columns_by_hand():
    """The ego drives along y; a track 8 m ahead and 3 m beside it, 2 m/s faster, whose x and vy are uncertain."""
    cov = np.diag([4.0, 0.0, 0.0, 9.0])
    cov[0, 3] = cov[3, 0] = 5.0
    estimate = Estimate(
        np.array([[-3.0, 8.0, np.pi / 2]]), np.array([[0.0, 12.0]]), np.array([0.2]), np.array([[6.0, 2.5]]), cov[None],
        np.array([[0.7, 0.1]]), np.array([0.05]), np.array([0.01]), None, np.eye(7)[None, 2],
        np.array([[0.9, 0.3, 0.2, 0.1]]),
    )  # fmt: skip
    tracks = Tracks(np.array([7]), np.array([0.4]), np.array([3]), np.array([1.5]), np.array([False]), None, estimate)
    rows = track_rows(tracks, np.array([0.0, 0.0, np.pi / 2]), np.array([0.0, 10.0]), 2, 0.1)
    row = dict(zip(COLUMNS, rows.tracks[0], strict=True))
    expected = {
        "x": 8.0, "y": 3.0, "cos_h": 1.0, "vx": 2.0, "yaw_rate": 0.2, "length": 6.0, "width": 2.5, "yy": 4.0,
        "vxvx": 9.0, "yvx": -5.0, "heading_std": 0.05, "yaw_rate_std": 0.01, "length_std": 0.7, "width_std": 0.1,
        "existence": 0.4, "age": 1.5, "front_std": 0.9, "rear_std": 0.3, "left_std": 0.2, "right_std": 0.1,
    }  # fmt: skip
    assert row == pytest.approx({name: expected.get(name, 0.0) for name in COLUMNS}, abs=1e-6)
    np.testing.assert_array_equal(rows.class_probability, [np.eye(7)[2], np.zeros(7)])
    np.testing.assert_array_equal(rows.id, [7, -1])


def test_classes_stand_in_their_columns_whatever_the_order_of_the_tracker():
    tracks = tracks_at(np.array([[30.0, 2.0], [9.0, 9.0]]))
    p = np.array([[0.1, 0.2, 0.7], [0.5, 0.5, 0.0]])
    known = tracks._replace(estimate=tracks.estimate._replace(class_probability=p))
    named = known._replace(memory=Memory(classes=("motorcycle", "cyclist", "van")))
    rows = track_rows(named, EGO, EGO_VELOCITY, 2, 0.1)
    expected = {100: [0, 0.7, 0, 0, 0, 0, 0.1], 101: [0, 0, 0, 0, 0, 0, 0.5]}  # "cyclist" has no column
    np.testing.assert_allclose(rows.class_probability, [expected[i] for i in rows.id], rtol=1e-6)
    with pytest.raises(ValueError, match=r"class_probability has 3 columns for the classes car, .*memory\.classes"):
        track_rows(known, EGO, EGO_VELOCITY, 2, 0.1)


@pytest.mark.parametrize("name", TRACKERS)
def test_every_tracker_names_the_classes_of_its_estimates(name):
    tracker = build(name, RADARS["surround"].models)
    p = tracker.filter.estimate(tracker.filter.init(prior(np.zeros((1, 3))))).class_probability
    names = tracker.start().memory.classes
    assert names is None if p is None else p.shape == (1, len(names))
    assert {*CLASSES}.issuperset(names or ())


def test_the_default_tracker_is_observed_with_its_classes():
    with TrackObservation(gym.make("testbed/cut-in-v0", warm_up=1.0)) as env:
        observation, _ = env.reset(seed=0)
        assert observation in env.observation_space
        sums = observation["class_probability"].sum(-1)
        np.testing.assert_allclose(sums, observation["mask"], atol=1e-5)
        assert sums.any()


def test_the_nearest_are_kept_in_order_of_distance_and_those_that_hardly_exist_are_not():
    distance = np.array([50.0, 20.0, 40.0, 10.0, 30.0])
    tracks = tracks_at(EGO[:2] + distance[:, None] * [1.0, 0.0], [1.0, 1.0, 1.0, 0.1, 0.2])
    rows = track_rows(tracks, EGO, EGO_VELOCITY, 3, 0.1)
    np.testing.assert_array_equal(rows.id, [101, 104, 102])
    np.testing.assert_allclose(np.hypot(*rows.tracks[:, :2].T), [20.0, 30.0, 40.0], rtol=1e-6)
    np.testing.assert_array_equal(rows.tracks[:, COLUMNS.index("reported")], [1, 0, 1])
    rows = track_rows(tracks, EGO, EGO_VELOCITY, 6, 0.1)
    np.testing.assert_array_equal(rows.mask, [1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(rows.id[4:], -1)
    assert not rows.tracks[4:].any()
    assert not track_rows(tracks_at(np.zeros((0, 2))), EGO, EGO_VELOCITY, 2, 0.1).mask.any()


def test_equal_distances_keep_their_order():
    tracks = tracks_at(EGO[:2] + np.array([[0.0, 9.0], [9.0, 0.0], [0.0, -9.0], [-9.0, 0.0]]))
    np.testing.assert_array_equal(track_rows(tracks, EGO, EGO_VELOCITY, 4, 0.1).id, [100, 101, 102, 103])


@pytest.fixture(scope="module")
def env():
    with_tracks = TrackObservation(gym.make("testbed/cut-in-v0", tracker="rm-feldmann", warm_up=1.0), size=8)
    yield with_tracks
    with_tracks.close()


def test_it_keeps_the_contract_of_gymnasium(env):
    check_env(env, skip_render_check=True, skip_close_check=True)


def test_it_shows_the_tracks_of_the_road_where_they_are(env):
    observation, info = env.reset(seed=0)
    ego, *vehicles = env.unwrapped.road.vehicles
    reported = observation["tracks"][:, COLUMNS.index("reported")] > 0
    np.testing.assert_array_equal(info["track_ids"][reported], [v.track_id for v in vehicles][: reported.sum()])
    np.testing.assert_allclose(
        observation["tracks"][reported, :2],
        [(v.position - ego.position) @ rotation(ego.heading) for v in vehicles][: reported.sum()],
        atol=1e-4,
    )
    assert observation["mask"].sum() >= 4
    assert observation["ego"][0] == pytest.approx(ego.speed)


def test_a_scaled_observation_is_divided_by_fixed_numbers(env):
    plain, _ = env.reset(seed=0)
    scaled, _ = TrackObservation(env.env, size=8, scale=True).reset(seed=0)
    np.testing.assert_allclose(scaled["tracks"][:, 0] * 100, plain["tracks"][:, 0], rtol=1e-5)
    np.testing.assert_allclose(scaled["ego"] * [30, 1, 3], plain["ego"], rtol=1e-5)
    np.testing.assert_allclose(scaled["tracks"][:, 9:24], plain["tracks"][:, 9:24], rtol=1e-5)


@pytest.mark.parametrize(("arguments", "message"), [({"size": 0}, "size must"), ({"existence": 1.0}, "existence must")])
def test_it_refuses_what_it_cannot_do(env, arguments, message):
    with pytest.raises(ValueError, match=message):
        TrackObservation(env.env, **arguments)
    with pytest.raises(TypeError, match="env must have a tracker"):
        TrackObservation(env.unwrapped)

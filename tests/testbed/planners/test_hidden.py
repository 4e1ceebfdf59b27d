"""What of a path was never seen: rays against boxes, and the views of an episode."""

from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from testbed.environment.sources.in_view import InView
from testbed.planners.hidden import TIMES, View, first_unseen, in_sight
from testbed.planners.mpc import Ahead
from testbed.planners.prediction import LanePath
from testbed.planners.registry import find, settings
from tests.testbed.planners.roads import world
from trackers.geometry import box_corners

ARC = 2.0 * np.arange(76)
PATH = LanePath(np.stack([ARC, 0 * ARC], -1), 0 * ARC, ARC, 0 * ARC, np.full(76, np.inf), 0.0)
PLACES = st.floats(-40, 40).map(lambda x: round(x, 2))


def view(*boxes, eye=(0.0, 0.0)):
    rows = np.array(boxes, float).reshape(-1, 5)
    return View(np.array(eye), rows[:, :3], rows[:, 3:])


@given(PLACES, PLACES, PLACES, PLACES, st.floats(-3, 3), st.floats(1, 12), st.floats(1, 4))
def test_a_point_is_in_sight_where_the_ray_to_it_leaves_no_box(x, y, a, b, heading, length, width):
    seen = view((a, b, heading, length, width))
    box = shapely.Polygon(box_corners(seen.pose, seen.size)[0])
    ray, point = shapely.LineString([(0.0, 0.0), (x, y)]), shapely.Point(x, y)
    cut = shapely.length(shapely.intersection(ray, box))
    if box.distance(shapely.Point(0.0, 0.0)) < 0.1 or box.boundary.distance(point) < 0.01 or 0 < cut < 0.01:
        return  # the ego is in it, or a ray that grazes a corner
    assert in_sight(seen, np.array([x, y])) == (cut == 0 or box.contains(point))


def test_what_a_truck_hides_begins_beyond_it():
    assert first_unseen(PATH, [view()], 5.0, 120.0) == np.inf
    assert first_unseen(PATH, [view((30.0, 0.0, 0.0, 12.0, 2.5))], 5.0, 120.0) == 38.0
    assert first_unseen(PATH, [view((30.0, 0.0, 0.0, 12.0, 2.5))], 5.0, 36.0) == np.inf
    assert first_unseen(PATH, [view((30.0, 3.5, 0.0, 12.0, 2.5))], 5.0, 120.0) == np.inf


def test_what_was_in_sight_for_some_time_stays_seen():
    hides, long = view((30.0, 0.0, 0.0, 12.0, 2.5)), TIMES * [view()]
    assert first_unseen(PATH, [*long, hides], 5.0, 120.0) == np.inf
    before = view((60.0, 0.0, 0.0, 12.0, 2.5))  # then the truck was farther ahead: seen up to its front
    assert first_unseen(PATH, [*TIMES * [before], hides], 5.0, 120.0) == 68.0


def test_a_glance_before_there_was_a_track_of_a_truck_does_not_vouch_for_what_it_hides():
    hides = view((30.0, 0.0, 0.0, 12.0, 2.5))
    assert first_unseen(PATH, [view()], 5.0, 120.0) == np.inf
    for glances in ([view(), hides], [view(), view(), hides, hides]):
        assert first_unseen(PATH, glances, 5.0, 120.0) == 38.0


@given(st.lists(st.tuples(st.floats(15, 80), st.floats(-4, 4)), min_size=TIMES, max_size=6))
def test_older_views_never_hide_more(places):
    views = [view((x, y, 0.0, 12.0, 2.5)) for x, y in places]
    assert first_unseen(PATH, views, 5.0, 120.0) >= first_unseen(PATH, views[-TIMES:], 5.0, 120.0)


def test_it_can_stop_before_what_it_has_not_seen():
    env = world(**settings(find("mpc")))
    ego, planner = env.unwrapped.vehicle, find("mpc")
    speed, arc = np.array([[20.0, 20.0]]), np.array([[0.0, 4.0]])
    arc = np.concatenate([arc, np.zeros((1, 18))], -1)
    speed = np.concatenate([speed, np.full((1, 18), 20.0)], -1)
    way = 20.0**2 / 10 + 0.4 * 20.0
    cost = planner.unseen_risk(ego, way + ego.LENGTH / 2 + 2.0, speed, arc)[0]
    np.testing.assert_allclose(cost[:2], [0.0, 0.02 * 2.0**2])
    assert not cost[5:].any()  # by then it will have looked again
    assert not planner.unseen_risk(ego, np.inf, speed, arc).any()


def test_where_a_leader_drives_nothing_stands_as_long_as_it_stays_on_the_path():
    times, planner = np.arange(1, 21), find("mpc")
    stays = Ahead(np.array([30.0 + 2.0 * times]), np.full((1, 20), 10.0), np.zeros((1, 20)), np.ones(1))
    leaves = stays._replace(rear=np.where(times <= 3, stays.rear, np.inf))
    np.testing.assert_allclose(planner.vouched(stays), 2.0 * times)
    np.testing.assert_allclose(planner.vouched(leaves), np.minimum(2.0 * times, 6.0))
    np.testing.assert_array_equal(planner.vouched(Ahead(*np.zeros((3, 0, 20)), np.ones(0))), 0.0)


@pytest.fixture(scope="module")
def tracked():
    env = gym.make("testbed/probe-reveal-v0", tracker=InView(), config=settings(find("mpc")), warm_up=1.0)
    env.reset(seed=3)
    yield env
    env.close()


def test_the_environment_remembers_what_was_in_sight_by_the_boxes_of_tracks(tracked):
    views = tracked.views
    tracks = tracked.current_tracks.reported
    np.testing.assert_allclose(np.sort(views[-1].pose[:, 0]), np.sort(tracks.estimate.pose[:, 0]))
    tracked.step(find("mpc").act(tracked))
    assert len(tracked.views) == len(views) + 1
    assert deepcopy(tracked).views == ()
    tracked.reset(seed=3)
    assert len(tracked.views) == len(views)


def test_who_has_the_truth_has_nothing_hidden():
    env = gym.make("testbed/probe-reveal-v0", tracker="truth", config=settings(find("mpc")))
    env.reset(seed=3)
    assert env.get_wrapper_attr("views") == ()


def test_where_nothing_is_hidden_drives_are_equal_bit_by_bit():
    poses = []
    for name in ("mpc", "mpc:unseen=False"):
        env, planner = gym.make("testbed/probe-cutin-v0", tracker=InView(), config=settings(find("mpc"))), find(name)
        env.reset(seed=3)
        for _ in range(30):
            env.step(planner.act(env))
        poses.append(env.unwrapped.vehicle.position)
    np.testing.assert_array_equal(*poses)

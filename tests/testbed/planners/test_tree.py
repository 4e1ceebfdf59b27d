"""Tree search on hand-made roads: what it chooses, and what more expansions buy."""

from dataclasses import replace

import numpy as np
import pytest

from testbed.planners.prediction import LANE_MARGIN, Relation
from testbed.planners.registry import find
from testbed.planners.tree import EgoState, Scene
from tests.testbed.planners.roads import blocked, world

TREE = find("tree")


def action(env, planner=TREE):
    return env.unwrapped.action_type.actions[planner.act(env)]


def test_an_empty_road_is_driven_faster_and_a_blocked_one_slower():
    assert action(world(speed=15.0)) in ("FASTER", "IDLE")
    assert action(world({"x": 245.0, "y": 4.0, "vx": 5.0}, blocked(0.0), blocked(8.0))) == "SLOWER"


@pytest.mark.parametrize(("side", "expected"), [(8.0, "LANE_LEFT"), (0.0, "LANE_RIGHT")])
def test_it_passes_where_there_is_room(side, expected):
    env = world({"x": 240.0, "y": 4.0, "vx": 10.0}, blocked(side))
    assert action(env) == expected
    assert action(world({"x": 240.0, "y": 4.0, "vx": 10.0}, blocked(side), action={
        "type": "DiscreteMetaAction", "target_speeds": [0.0, 10.0, 20.0, 30.0], "lateral": False,
    })) == "SLOWER"  # fmt: skip


def test_where_no_action_avoids_a_contact_it_brakes():
    assert action(world({"x": 207.0, "y": 4.0, "vx": 0.0}, blocked(0.0), blocked(8.0))) == "SLOWER"


def test_a_follower_in_the_own_lane_is_no_reason_to_flee():
    assert action(world({"x": 188.0, "y": 4.0, "vx": 22.0}, blocked(0.0), blocked(8.0), speed=20.0)) != "SLOWER"


def scene(along, across, chance=1.0):
    """A standing body of 4 x 2 m at a place relative to the path, for an ego of 4 x 2 m."""
    steps = 40
    fields = (np.full((1, steps), value) for value in (along, across, 0.0, 0.0))
    relation = Relation(*fields, half=np.broadcast_to([2.0, 1.0], (1, steps, 2)))
    size, actions = np.array([4.0, 2.0]), ("SLOWER", "IDLE")
    return Scene(relation, np.full(1, chance), size, range(1), 4.0, 20.0, 1 / 0.6, 2.5, 30.0, 3, actions)


def test_braking_is_what_the_pedals_give():
    now, place = EgoState(0, 0.0, 20.0, 20.0, 0.0, 0), scene(50.0, 0.0)
    assert 20.0 * 0.6 + 20.0**2 / 16 + 4.5 < 50.0  # 8 m/s^2 would do
    assert not TREE.after(place, now, "IDLE")[2]
    assert TREE.after(place._replace(step=0.5), now, "IDLE")[2]  # a press of 0.5 m/s brakes less


def test_a_contact_that_may_come_takes_its_chance_from_all_that_follows():
    now = EgoState(0, 0.0, 20.0, 20.0, 0.0, 0)
    certain, perhaps = (TREE.after(scene(15.0, 0.0, chance), now, "IDLE") for chance in (1.0, 0.4))
    assert certain[1:] == (0.0, True)
    assert not perhaps[2]
    assert perhaps[0].free == pytest.approx(0.6)
    behind = perhaps[0]._replace(arc=100.0)
    assert TREE.after(scene(15.0, 0.0, 0.4), behind, "IDLE")[0].free == pytest.approx(0.6)
    assert TREE.after(scene(15.0, 0.0, 0.4), behind, "IDLE")[1] == pytest.approx(0.6)


def test_what_is_just_beside_the_path_counts_as_ahead_of_the_ego():
    now = EgoState(1, 0.0, 20.0, 20.0, 0.0, 0)
    assert TREE._room(scene(15.0, 2.0 + 0.9 * LANE_MARGIN), now) < 0.5
    assert TREE._room(scene(15.0, 2.0 + 1.1 * LANE_MARGIN), now) == 1.0


def test_one_expansion_is_enough_for_an_action_and_more_look_farther_ahead():
    env = world({"x": 260.0, "y": 4.0, "vx": 8.0}, blocked(0.0), blocked(8.0))
    short, long = (replace(TREE, budget=n).choose(env).plan for n in (1, 60))
    assert len(short) == 1 + 3  # the present place, and three instants of one action
    assert len(long) > 3 * len(short)


def test_it_changes_nothing():
    env = world({"x": 240.0, "y": 4.0, "vx": 10.0})
    ego = env.unwrapped.vehicle
    before = ego.position.copy(), ego.speed, ego.target_speed, ego.target_lane_index
    first = TREE.choose(env)
    again = TREE.choose(env)
    assert first.action == again.action
    np.testing.assert_array_equal(first.plan, again.plan)
    np.testing.assert_array_equal(ego.position, before[0])
    assert (ego.speed, ego.target_speed, ego.target_lane_index) == before[1:]

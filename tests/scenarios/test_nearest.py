"""The sifted network: the same lane as highway-env's search over all lanes, everywhere on and off the road."""

import copy

import numpy as np
import pytest
from highway_env.road.lane import CircularLane, PolyLaneFixedWidth, SineLane, StraightLane
from highway_env.road.road import RoadNetwork
from hypothesis import given
from hypothesis import strategies as st

from scenarios.highway import ScenarioEnv
from scenarios.registry import SCENARIOS
from scenarios.roads import SiftedNetwork, lane_boxes, sifted

PLACE, HEADING = st.floats(-150.0, 250.0), st.floats(-10.0, 10.0)


def stock_lanes():
    """A network of all lanes that highway-env has, some of them on top of each other."""
    network = RoadNetwork()
    for y in (0.0, 4.0, 4.0):
        network.add_lane("a", "b", StraightLane([0.0, y], [100.0, y]))
    network.add_lane("b", "c", SineLane([100.0, 4.0], [180.0, 4.0], 3.25, 2 * np.pi / 100, 0.3))
    network.add_lane("c", "d", CircularLane([100.0, -40.0], 30.0, 0.5, 4.0))
    network.add_lane("c", "e", CircularLane([100.0, -40.0], 34.0, 4.0, 0.5, clockwise=False))
    network.add_lane("d", "e", PolyLaneFixedWidth([(0.0, -60.0), (10.0, -52.0), (25.0, -50.0), (45.0, -58.0)]))
    network.add_lane("d", "b", StraightLane([-30.0, 80.0], [60.0, -70.0]))
    return network


def assert_same_lanes(network, points, headings):
    for point, heading in zip(points, headings, strict=True):
        stock = RoadNetwork.get_closest_lane_index(network, point, heading)
        assert SiftedNetwork.get_closest_lane_index(network, point, heading) == stock


@given(PLACE, PLACE, st.none() | HEADING)
def test_any_place_has_the_lane_of_the_full_search(x, y, heading):
    network = sifted(stock_lanes())
    assert isinstance(network, SiftedNetwork)
    assert_same_lanes(network, [np.array([x, y])], [heading])


@pytest.mark.parametrize("name", SCENARIOS)
def test_networks_of_the_catalogue_give_the_lane_of_the_full_search(name):
    env = ScenarioEnv(name)
    env.reset(seed=0)
    network, rng = env.road.network, np.random.default_rng(0)
    assert isinstance(network, SiftedNetwork)
    _, lanes, low, high = lane_boxes(network)
    anywhere = rng.uniform(low.min(0) - 50.0, high.max(0) + 50.0, (100, 2))
    assert_same_lanes(network, anywhere, rng.uniform(-4.0, 4.0, 100))
    for lane in lanes:
        s = rng.uniform(-5.0, lane.length + 5.0, 5)
        beside = [lane.position(at, off) for at, off in zip(s, rng.normal(0.0, 3.0, 5), strict=True)]
        assert_same_lanes(network, beside, [lane.heading_at(at) for at in s])


def test_a_lane_added_later_is_found():
    network = sifted(stock_lanes())
    place = np.array([200.0, 200.0])
    assert network.get_closest_lane_index(place) != ("x", "y", 0)
    network.add_lane("x", "y", StraightLane([190.0, 200.0], [220.0, 200.0]))
    assert network.get_closest_lane_index(place) == ("x", "y", 0)


def test_a_copy_has_lanes_of_its_own():
    network = sifted(stock_lanes())
    network.get_closest_lane_index(np.zeros(2))
    twin = copy.deepcopy(network)
    twin.add_lane("x", "y", StraightLane([-10.0, -200.0], [10.0, -200.0]))
    place = np.array([0.0, -200.0])
    assert twin.get_closest_lane_index(place) == ("x", "y", 0)
    assert network.get_closest_lane_index(place) != ("x", "y", 0)


def test_an_undefined_place_is_answered_as_by_the_full_search():
    assert_same_lanes(sifted(stock_lanes()), [np.full(2, np.nan)], [0.0])

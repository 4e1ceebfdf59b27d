"""The cached road: the same states as highway-env's road, bit by bit."""

import hashlib
import warnings

import gymnasium as gym
import highway_env  # noqa: F401 - registers the ids
import numpy as np
import pytest
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Landmark, Obstacle

from scenarios.articulated import ArticulatedCourse, ArticulatedIDM
from scenarios.constants import ProtectedConstants
from scenarios.roads import CachedRegulatedRoad, CachedRoad, cached, near_pairs
from scenarios.vehicles import CourseVehicle, SizedIDM


def digest(road):
    rows = [
        [*v.position, v.heading, v.speed, v.crashed, v.hit]
        + [getattr(v, name, 0.0) for name in ("timer", "trailer_heading")]
        for v in road.vehicles + road.objects
    ]
    lanes = [getattr(v, "target_lane_index", None) for v in road.vehicles]
    return hashlib.sha256(np.array(rows, float).tobytes() + repr(lanes).encode()).hexdigest()


def ring_with_approach(connected, rng, road_class):
    """A ring of four arcs, two approaches and an exit, two lanes each: many segment borders, branches and joins."""
    net = RoadNetwork()
    names = ["e", "s", "w", "n"]
    for q, (a, b) in enumerate(zip(names, names[1:] + names[:1], strict=True)):
        for radius in (36, 32):
            net.add_lane(a, b, CircularLane([0, 0], radius, q * np.pi / 2, (q + 1) * np.pi / 2, speed_limit=12))
    for radius in (36, 32):
        net.add_lane("in", "e", StraightLane([radius, -120], [radius, 0], speed_limit=15))
        net.add_lane("in2", "w", StraightLane([-radius, 120], [-radius, 0], speed_limit=15))
    net.add_lane("w", "out", StraightLane([-32, 0], [-32, -150], speed_limit=15))
    road = road_class(net, np_random=rng, neighbour_vehicles_connected_lanes=connected)
    for start, end in [("in", "e"), ("in2", "w"), ("e", "s")]:
        for lane in range(2):
            for s in (5.0, 32.0):
                where = net.get_lane((start, end, lane))
                s += float(rng.uniform(0, 4))
                kind = ("car", "truck", "bus")[int(rng.integers(3))]
                road.vehicles.append(
                    SizedIDM(road, where.position(s, 0), where.heading_at(s), 8.0, contour=kind, target_speed=12.0)
                )
    return road


def mixed_highway(connected, rng, road_class):
    """Sized traffic, a course, articulated trucks, an obstacle, a landmark and one pair with equal coordinates."""
    net = RoadNetwork.straight_road_network(3, length=150, speed_limit=30, nodes_str=("a", "b"))
    RoadNetwork.straight_road_network(3, start=150, length=600, speed_limit=30, nodes_str=("b", "c"), net=net)
    road = road_class(net, np_random=rng, neighbour_vehicles_connected_lanes=connected)
    table = np.stack([t := np.arange(1200) / 100, 60 + 12 * t, 4 + 0 * t, 0 * t, 12 + 0 * t, 0 * t, 0 * t], -1)
    road.vehicles.append(CourseVehicle(road, table))
    road.vehicles.append(ArticulatedIDM(road, [40.0, 8.0], 0.0, 20.0, target_speed=25.0))
    road.vehicles.append(ArticulatedCourse(road, table + np.array([0, 60, 4, 0, 0, 0, 0])))
    for lane in range(3):
        for s in np.arange(5, 36, 15) if lane == 2 else np.arange(5, 140, 30):
            kind = ("car", "van", "truck", "motorcycle")[int(rng.integers(4))]
            s = float(s) if lane < 2 else float(s - 40)
            v = SizedIDM(road, [s, 4.0 * lane], 0.0, float(rng.uniform(15, 25)), contour=kind, target_speed=28.0)
            road.vehicles.append(v)
    road.objects.append(Obstacle(road, [400.0, 0.0]))
    road.objects.append(Landmark(road, [300.0, 0.0]))
    return road


@pytest.mark.parametrize(
    ("build", "connected"),
    [
        (ring_with_approach, True),
        (mixed_highway, False),
        pytest.param(ring_with_approach, False, marks=pytest.mark.slow),
        pytest.param(mixed_highway, True, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_states_equal_the_stock_road_over_200_frames(build, connected, seed):
    stock = build(connected, np.random.default_rng(seed), Road)
    fast = build(connected, np.random.default_rng(seed), CachedRoad)
    for frame in range(200):
        for road in (stock, fast):
            road.act()
            road.step(1 / 15)
        assert digest(stock) == digest(fast), f"frame {frame}"


@pytest.mark.parametrize(
    ("name", "config"),
    [
        ("highway-v0", {"vehicles_count": 15, "duration": 100}),
        ("merge-v1", {}),
        ("roundabout-v1", {"duration": 100}),
        ("intersection-v2", {"duration": 100}),
    ],
)
@pytest.mark.parametrize("seed", [0, pytest.param(5, marks=pytest.mark.slow)])
def test_stock_environments_run_equally_on_the_cached_road(name, config, seed):
    hashes = []
    for convert in (lambda road: road, cached):
        with ProtectedConstants(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            env = gym.make(name, config=config).unwrapped
            env.reset(seed=seed)
            env.road = convert(env.road)
            states = []
            for _ in range(205):
                env.road.act()
                env.road.step(1 / 15)
                states.append(digest(env.road))
            hashes.append(states)
    assert hashes[0] == hashes[1]


def test_the_digest_sees_a_difference_in_the_last_bit():
    road = mixed_highway(False, np.random.default_rng(0), Road)
    before = digest(road)
    road.vehicles[3].position[0] = np.nextafter(road.vehicles[3].position[0], np.inf)
    assert digest(road) != before


class Asking(Vehicle):
    """Asks both roads for its neighbours on every lane while it acts."""

    def act(self, action=None):
        graph = self.road.network.graph
        lanes = [(a, b, k) for a in graph for b in graph[a] for k in range(len(graph[a][b]))]
        self.answers = [self.road.neighbour_vehicles(self, lane) for lane in lanes]
        self.stock = [Road.neighbour_vehicles(self.road, self, lane) for lane in lanes]


@pytest.mark.parametrize("connected", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_neighbours_agree_in_ties(connected, seed):
    """Many vehicles on few grid points: equal coordinates ahead, behind and with the asking vehicle itself."""
    rng = np.random.default_rng(seed)
    road = ring_with_approach(connected, rng, CachedRoad)
    road.vehicles.clear()
    for k in range(40):
        thing = Obstacle if k % 9 == 0 else Landmark if k % 10 == 0 else Asking
        where = [float(rng.choice([32, 34, 36, -32])), float(rng.integers(-6, 3) * 20)]
        (road.vehicles if thing is Asking else road.objects).append(thing(road, where, 0.0))
    road.vehicles.append(Asking(road, [np.nan, 0.0], 0.0))
    road.act()
    asked = 0
    for v in road.vehicles:
        for (ahead, behind), (ahead_stock, behind_stock) in zip(v.answers, v.stock, strict=True):
            assert ahead is ahead_stock
            assert behind is behind_stock
            asked += ahead is not None
    assert asked > 100


def test_nothing_is_remembered_when_vehicles_have_moved():
    road = mixed_highway(True, np.random.default_rng(0), CachedRoad)
    road.act()
    ego = road.vehicles[0]
    road.vehicles[5].position = ego.position + np.array([3.0, 0.0])
    assert road.neighbour_vehicles(ego, ("a", "b", 1))[0] is road.vehicles[5]


def test_no_colliding_pair_is_sifted_out():
    rng = np.random.default_rng(3)
    road = Road(RoadNetwork.straight_road_network(3))
    crowd = [
        SizedIDM(road, rng.uniform(0, 30, 2), rng.uniform(-3, 3), rng.uniform(-30, 30), contour=c)
        for c in ("car", "bus", "truck", "motorcycle") * 8
    ]
    crowd += [ArticulatedIDM(road, rng.uniform(0, 30, 2), rng.uniform(-3, 3), 20.0, hitch=0.5) for _ in range(4)]
    near = near_pairs(crowd, [], 0.1)
    hits = np.array([[a is not b and any(a._is_colliding(b, 0.1)[:2]) for b in crowd] for a in crowd])
    assert hits.sum() > 50
    assert near[hits].all()
    assert near_pairs(crowd[:1], [Obstacle(road, [500.0, 0.0])], 0.1).tolist() == [[True, False]]


def test_a_stock_vehicle_hits_a_trailer_too():
    road = CachedRoad(RoadNetwork.straight_road_network(3))
    truck = ArticulatedIDM(road, [100.0, 4.0], 0.0, 0.0)
    car = Vehicle(road, [90.0, 4.0], 0.0, 0.0)
    road.vehicles = [car, truck]
    road.step(0.05)
    assert car.crashed
    assert truck.crashed


def test_conversion_keeps_the_rules_of_a_regulated_road():
    with ProtectedConstants(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gym.make("intersection-v2").unwrapped
    assert type(cached(env.road)) is CachedRegulatedRoad
    assert cached(env.road) is env.road


def test_an_unknown_road_is_not_converted():
    class Other(Road):
        pass

    with pytest.raises(TypeError, match="Other"):
        cached(Other(RoadNetwork()))

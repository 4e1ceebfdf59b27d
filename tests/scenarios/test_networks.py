import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios import networks
from scenarios.paths import PathLane, SmoothPath, along, of_lanes, through
from trackers.geometry import wrap_angle

NETWORKS = {
    f.__name__: f()
    for f in (
        networks.straight,
        networks.gentle_curve,
        networks.s_curve,
        networks.six_radar_bend,
        networks.merge,
        networks.exit_road,
        networks.two_way,
        networks.roundabout,
        networks.u_turn,
        networks.crossing,
    )
}
layouts = pytest.mark.parametrize("layout", NETWORKS.values(), ids=NETWORKS)
S_BEND = along((10.0, -5.0, 0.4), ((60.0, 0.0), (80.0, -1 / 40), (90.0, 1 / 30)), ramp=20.0)


@given(st.floats(-15.0, S_BEND.length + 15.0), st.floats(-8.0, 8.0))
def test_projection_inverts_position_also_beyond_the_ends(s, lateral):
    assert S_BEND.project(S_BEND.position(s, lateral)) == pytest.approx((s, lateral), abs=1e-7)


@given(st.floats(-15.0, S_BEND.length + 15.0), st.floats(-5.0, 5.0))
def test_a_lane_agrees_with_its_path(s, lateral):
    lane = PathLane(S_BEND)
    np.testing.assert_allclose(lane.position(s, lateral), S_BEND.position(s, lateral), atol=1e-9)
    assert wrap_angle(lane.heading_at(s) - S_BEND.heading(s)) == pytest.approx(0.0, abs=1e-9)


def test_a_path_turns_by_the_sum_of_its_pieces_and_has_the_curvature_asked_for():
    path = along((0.0, 0.0, 0.0), ((100.0, 0.0), (np.pi * 15.0, 1 / 15.0), (100.0, 0.0)), ramp=10.0)
    assert abs(path.heading(path.length)) == pytest.approx(np.pi, abs=1e-6)
    assert path.curvature(100.0 + np.pi * 7.5) == pytest.approx(1 / 15.0, rel=1e-3)
    assert path.curvature(np.array([50.0, 190.0])) == pytest.approx([0.0, 0.0], abs=1e-6)


def test_speed_along_a_path_is_that_of_its_arc_length():
    s = np.linspace(0.0, S_BEND.length, 2000)
    step = np.linalg.norm(np.diff(S_BEND.position(s), axis=0), axis=1)
    np.testing.assert_allclose(step, np.diff(s), rtol=2e-4)


def test_a_parallel_path_stays_parallel():
    s = np.linspace(5.0, 200.0, 60)
    gaps = [S_BEND.project(p)[1] for p in S_BEND.offset(3.6).position(s)]
    np.testing.assert_allclose(gaps, 3.6, atol=1e-4)


def test_copies_share_the_path_because_it_never_changes():
    lane = PathLane(S_BEND)
    assert copy.deepcopy(lane).path is S_BEND


def test_smoothed_lanes_have_no_jump_of_curvature_and_do_not_drift():
    ring = NETWORKS["roundabout"].network
    edges = [("s:near-in", "s:enter", 0), ("s:enter", "e:leave", 0), ("e:leave", "e:enter", 0)]
    lanes = tuple(ring.get_lane(e) for e in edges)
    path: SmoothPath = of_lanes(lanes)
    assert np.abs(np.diff(path.bend)).max() < 0.02  # 1/m per metre; the lanes themselves jump by 0.06
    assert np.linalg.norm(path.xy[-1] - lanes[-1].position(lanes[-1].length, 0)) < 0.1


@layouts
def test_every_lane_inverts_its_positions(layout):
    for index, lane in layout.network.lanes_dict().items():
        for share in (0.02, 0.3, 0.77):
            s = share * lane.length
            got = lane.local_coordinates(lane.position(s, 0.7))
            assert got == pytest.approx((s, 0.7), abs=1e-6), index


@layouts
def test_roads_that_meet_at_a_node_join_without_a_step(layout):
    """Each lane of a road starts at the end of some lane before it, with the same heading, where one lies beside."""
    graph = layout.network.graph
    for index, lane in layout.network.lanes_dict().items():
        before = [old for ends in graph.values() for old in ends.get(index[0], [])]
        if before:
            gap = [np.linalg.norm(old.position(old.length, 0.0) - lane.position(0.0, 0.0)) for old in before]
            turn = [abs(wrap_angle(old.heading_at(old.length) - lane.heading_at(0.0))) for old in before]
            nearest = int(np.argmin(gap))
            assert gap[nearest] < 1e-6 or gap[nearest] == pytest.approx(networks.WIDTH), index
            assert turn[nearest] < 1e-2, index


@layouts
def test_rails_come_in_short_pieces(layout):
    assert layout.walls.shape[1:] == (2, 2)
    assert (np.linalg.norm(layout.walls[:, 1] - layout.walls[:, 0], axis=1) <= 25.0 + 1e-9).all()


def test_rails_stand_beside_the_outer_lanes():
    walls = networks.straight(lanes=3).walls
    assert set(np.round(walls[..., 1].ravel(), 9)) == {-3.2, 11.2}  # 4 m lanes at 0, 4, 8, and 1.2 m


@pytest.mark.parametrize("name", ["gentle_curve", "s_curve", "six_radar_bend"])
def test_rails_of_bends_keep_their_distance_from_the_outer_lanes(name):
    network, walls = NETWORKS[name]
    lanes = network.graph["a"]["b"]
    half = lanes[0].width / 2 + networks.RAIL_GAP
    corners = walls[:, 0]
    left = np.array([lanes[0].local_coordinates(p)[1] for p in corners])
    right = np.array([lanes[-1].local_coordinates(p)[1] for p in corners])
    off = np.minimum(np.abs(left + half), np.abs(right - half))
    assert off.max() < 1e-3


def test_the_published_bend_is_mirrored_into_a_left_bend_of_the_driver():
    centre = NETWORKS["six_radar_bend"].network.get_lane(("a", "b", 1))
    for x, y_left in ((0, 0), (50, 0), (100, 0), (250, 20), (400, 35)):
        assert abs(centre.local_coordinates(np.array([x, -y_left]))[1]) < 1e-3
    s = centre.local_coordinates(np.array([250.0, -20.0]))[0]
    assert centre.heading_at(s) < 0  # y points down on screen and to the driver's right: turning left is negative
    assert NETWORKS["six_radar_bend"].network.get_lane(("a", "b", 2)).local_coordinates(np.array([86.0, 3.6]))[
        1
    ] == pytest.approx(0.0, abs=0.5)


def test_a_spline_passes_through_its_points():
    points = [(0, 0), (40, 5), (90, -3), (120, 20)]
    path = through(points)
    assert all(abs(path.project(np.array(p, float))[1]) < 2e-3 for p in points)


def test_a_path_lane_cannot_be_written_as_a_stock_lane():
    with pytest.raises(TypeError, match="rebuild the scenario"):
        PathLane(S_BEND).to_config()

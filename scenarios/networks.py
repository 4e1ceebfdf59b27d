"""Road networks as small functions: each returns the lanes and the guard rails beside them.

y points to the driver's right on a road along +x; lane 0 is the leftmost, at y = 0. highway-env's drivers clip their
target speeds to the limit of the lane, so only junctions and bends have one that means something.
"""

from typing import NamedTuple

import numpy as np
from highway_env.road.lane import CircularLane, LineType, StraightLane
from highway_env.road.road import RoadNetwork
from numpy.typing import NDArray

from scenarios.paths import PathLane, SmoothPath, along, from_nodes, through
from trackers.geometry import unit

WIDTH = 4.0  # [m] of a lane
OPEN = 60.0  # [m/s] speed limit of a lane that has none
RAIL_GAP = 1.2  # [m] from the edge of the outer lane to the guard rail
STRAIGHT_RAIL, BENT_RAIL = 25.0, 10.0  # [m] longest piece of a rail; shorter in bends, 3 cm off the arc at R = 400 m
NONE, STRIPED, SOLID = LineType.NONE, LineType.STRIPED, LineType.CONTINUOUS_LINE


class Layout(NamedTuple):
    """Lanes and guard rails."""

    network: RoadNetwork
    walls: NDArray = np.zeros((0, 2, 2))  # (W, 2, 2) [m] segments from point to point


def rail(
    path: SmoothPath, lateral: float, piece: float = BENT_RAIL, start: float = 0.0, end: float = np.inf
) -> NDArray:
    """Guard rail (W, 2, 2) [m] parallel to a path between two arc lengths, in pieces of at most `piece` [m]."""
    end = min(end, path.length)
    points = path.position(np.linspace(start, end, int(np.ceil((end - start) / piece)) + 1), lateral)
    return np.stack([points[:-1], points[1:]], 1)


def lines(lane: int, lanes: int) -> tuple[int, int]:
    """Line types left and right of a lane: solid outside, dashed between, each line drawn once."""
    return (SOLID if lane == 0 else STRIPED, SOLID if lane == lanes - 1 else NONE)


def straight(lanes: int = 3, length: float = 1600.0, gap: float = RAIL_GAP) -> Layout:
    """One-way straight road a -> b along +x, with rails on both sides, `gap` [m] from the outer lanes."""
    network = RoadNetwork()
    _straight_lanes(network, ("a", "b"), 0.0, length, lanes)
    axis = along((0.0, 0.0, 0.0), ((length, 0.0),))
    sides = (-WIDTH / 2 - gap, (lanes - 0.5) * WIDTH + gap)
    return Layout(network, np.vstack([rail(axis, side, STRAIGHT_RAIL) for side in sides]))


def tunnel() -> Layout:
    """Two straight lanes a -> b between two walls, so near that each shows the traffic to the other."""
    return straight(lanes=2, gap=0.5)


def _straight_lanes(
    network: RoadNetwork, edge: tuple[str, str], start: float, end: float, lanes: int, speed_limit: float = OPEN
) -> None:
    for i in range(lanes):
        y = i * WIDTH
        lane = StraightLane([start, y], [end, y], WIDTH, lines(i, lanes), speed_limit=speed_limit)
        network.add_lane(*edge, lane)


def curved(centre: SmoothPath, offsets: tuple[float, ...], width: float = WIDTH, speed_limit: float = OPEN) -> Layout:
    """One-way road a -> b of parallel lanes at lateral offsets [m] from a path, leftmost first, with rails."""
    network = RoadNetwork()
    for i, offset in enumerate(offsets):
        lane = PathLane(centre.offset(offset), width, lines(i, len(offsets)), speed_limit=speed_limit)
        network.add_lane("a", "b", lane)
    sides = (offsets[0] - width / 2 - RAIL_GAP, offsets[-1] + width / 2 + RAIL_GAP)
    return Layout(network, np.vstack([rail(centre, side) for side in sides]))


def gentle_curve(lanes: int = 3, radius: float = 500.0) -> Layout:
    """Motorway that bends right for ever after 200 m, with clothoids of 80 m."""
    centre = along((0.0, 0.0, 0.0), ((200.0, 0.0), (900.0, 1.0 / radius)), ramp=80.0)
    return curved(centre, tuple(WIDTH * i for i in range(lanes)))


def s_curve(lanes: int = 3, radius: float = 260.0) -> Layout:
    """Straight, left, right and left bends of 45, 90 and 45 degrees with clothoids of 70 m, and straight on."""
    quarter = radius * np.pi / 4
    pieces = ((200.0, 0.0), (quarter, -1 / radius), (2 * quarter, 1 / radius), (quarter, -1 / radius), (300.0, 0.0))
    return curved(along((0.0, 0.0, 0.0), pieces, ramp=70.0), tuple(WIDTH * i for i in range(lanes)))


def six_radar_bend() -> Layout:
    """Three lanes of 3.6 m through (0,0) (50,0) (100,0) (250,20) (400,35) m, y to the LEFT as the scene is published.

    y is mirrored here, so it stays a left bend. Extended by 60 m behind and 400 m ahead.
    """
    points = np.array([(0, 0), (50, 0), (100, 0), (250, -20), (400, -35)], float)
    core = through(points)
    back = -60.0 + np.arange(60.0)
    ahead = core.length + 1.0 + np.arange(400.0)
    s = np.concatenate([back, core.s, ahead])
    return curved(from_nodes(core.position(s), unit(core.heading(s))), (-3.6, 0.0, 3.6), width=3.6)


SIX_RADAR_ORIGIN = 60.0  # [m] arc length of the published point (0, 0)


def _ramp(x0: float, y0: float, x1: float, y1: float) -> SmoothPath:
    """Quintic transition of y between two points, straight along x at both ends."""
    x = np.linspace(x0, x1, round(x1 - x0) + 1)
    u = (x - x0) / (x1 - x0)
    y = y0 + (y1 - y0) * u**3 * (10 - 15 * u + 6 * u**2)
    slope = (y1 - y0) / (x1 - x0) * 30 * u**2 * (1 - u) ** 2
    return from_nodes(np.column_stack([x, y]), np.column_stack([np.ones_like(x), slope]))


def _with_room_for_a_lane(lanes: int, begin: float, end: float, length: float) -> RoadNetwork:
    """A straight road a -> b -> c -> d whose stretch b -> c, from begin to end [m], may have one lane more."""
    network = RoadNetwork()
    for edge, start, stop in (("ab", 0.0, begin), ("bc", begin, end), ("cd", end, length)):
        _straight_lanes(network, (edge[0], edge[1]), start, stop, lanes)
    network.get_lane(("b", "c", lanes - 1)).line_types = (STRIPED, NONE)
    return network


def merge(lanes: int = 2, before: float = 500.0, parallel: float = 400.0, length: float = 1600.0) -> Layout:
    """Road a -> b -> c -> d; the ramp j -> k -> b joins as lane `lanes` of b -> c and ends at c."""
    end, y, far = before + parallel, lanes * WIDTH, lanes * WIDTH + 10.0
    network = _with_room_for_a_lane(lanes, before, end, length)
    ramp = _ramp(before - 150.0, far, before, y)
    network.add_lane("j", "k", StraightLane([0.0, far], [before - 150.0, far], line_types=(SOLID, SOLID)))
    network.add_lane("k", "b", PathLane(ramp, line_types=(SOLID, SOLID), speed_limit=OPEN))
    network.get_lane(("j", "k", 0)).speed_limit = OPEN
    extra = StraightLane([before, y], [end, y], line_types=(STRIPED, SOLID), forbidden=True, speed_limit=OPEN)
    network.add_lane("b", "c", extra)
    axis = along((0.0, 0.0, 0.0), ((length, 0.0),))
    side = WIDTH / 2 + RAIL_GAP
    right = [rail(ramp, side), rail(axis, y + side, STRAIGHT_RAIL, before, end)]
    after = rail(axis, y - WIDTH + side, STRAIGHT_RAIL, end + 30.0)
    return Layout(network, np.vstack([rail(axis, -side, STRAIGHT_RAIL), *right, after]))


def exit_road(lanes: int = 3, before: float = 450.0, parallel: float = 200.0, length: float = 1600.0) -> Layout:
    """Road a -> b -> c -> d; lane `lanes` of b -> c is the exit lane and goes on as the ramp x -> e -> f.

    The ramp has a node of its own: highway-env takes the only lane of a next road for the continuation of every lane.
    """
    end, y, far = before + parallel, lanes * WIDTH, lanes * WIDTH + 14.0
    network = _with_room_for_a_lane(lanes, before, end, length)
    extra = StraightLane([before, y], [end, y], line_types=(STRIPED, SOLID), speed_limit=OPEN)
    network.add_lane("b", "c", extra)
    ramp = _ramp(end, y, end + 160.0, far)
    network.add_lane("x", "e", PathLane(ramp, line_types=(SOLID, SOLID), forbidden=True, speed_limit=25.0))
    off = StraightLane([end + 160.0, far], [length, far], line_types=(SOLID, SOLID), forbidden=True, speed_limit=25.0)
    network.add_lane("e", "f", off)
    axis = along((0.0, 0.0, 0.0), ((length, 0.0),))
    side = WIDTH / 2 + RAIL_GAP
    right = [rail(axis, y - WIDTH + side, STRAIGHT_RAIL, 0.0, before - 30.0), rail(ramp, side)]
    parallel_rail = rail(axis, y + side, STRAIGHT_RAIL, before, end)
    return Layout(network, np.vstack([rail(axis, -side, STRAIGHT_RAIL), *right, parallel_rail]))


def two_way(length: float = 1600.0) -> Layout:
    """Country road: a -> b at y = 4 m along +x, the opposite lane c -> d at y = 0 on the driver's left; no rails."""
    network = RoadNetwork()
    ours = StraightLane([0.0, WIDTH], [length, WIDTH], line_types=(STRIPED, SOLID), speed_limit=OPEN)
    theirs = StraightLane([length, 0.0], [0.0, 0.0], line_types=(NONE, SOLID), speed_limit=OPEN)
    network.add_lane("a", "b", ours)
    network.add_lane("c", "d", theirs)
    return Layout(network)


ARMS = {"s": 90.0, "e": 0.0, "n": -90.0, "w": -180.0}  # [deg] in the order in which traffic passes them
RING = (28.0, 32.0)  # [m] radii, inner lane first (it is the left one)
SLOW = 7.5  # [m/s] limit in junctions: 2 m/s^2 on the inner ring


def roundabout(arm: float = 180.0, mouth: float = 26.0, approach: float = 75.0) -> Layout:
    """Two-lane roundabout about the origin with four arms, driven against the clock on screen.

    Arm k has the road `k:far-in` -> `k:near-in` -> `k:enter` and `k:leave` -> `k:near-out` -> `k:far-out`. The outer
    ring runs `k:leave` -> `k:enter` -> `next:leave`; the inner one has nodes of its own, `inner k:leave` and so on.
    `mouth` [deg] is half the angle between leaving and entering, `approach` [m] where the arm begins to bend.
    """
    network = RoadNetwork()
    names = list(ARMS)
    for k, name in enumerate(names):
        phi, following = np.deg2rad(ARMS[name]), names[(k + 1) % 4]
        m = np.deg2rad(mouth)
        _ring(network, (f"{name}:leave", f"{name}:enter"), phi + m, phi - m)
        _ring(network, (f"{name}:enter", f"{following}:leave"), phi - m, phi - np.pi / 2 + m)
        _arm(network, name, phi, m, arm, approach)
    return Layout(network)


def _ring(network: RoadNetwork, edge: tuple[str, str], start: float, end: float) -> None:
    for prefix, radius, types in zip(("inner ", ""), RING, ((SOLID, STRIPED), (NONE, SOLID)), strict=True):
        lane = CircularLane([0.0, 0.0], radius, start, end, False, WIDTH, types, speed_limit=SLOW)
        network.add_lane(prefix + edge[0], prefix + edge[1], lane)


def _arm(network: RoadNetwork, name: str, phi: float, mouth: float, far: float, near: float) -> None:
    """Add the two roads of an arm at angle phi [rad]; vehicles keep right."""
    out, right = unit(phi), unit(phi - np.pi / 2)  # right of a driver who comes in
    side = WIDTH / 2 * right
    enter, leave = RING[-1] * unit(phi - mouth), RING[-1] * unit(phi + mouth)
    curve_in = _bridge(near * out + side, -out, enter, unit(phi - mouth - np.pi / 2))
    curve_out = _bridge(leave, unit(phi + mouth - np.pi / 2), near * out - side, out)
    straight_in = StraightLane(far * out + side, near * out + side, line_types=(SOLID, SOLID), speed_limit=SLOW)
    straight_out = StraightLane(near * out - side, far * out - side, line_types=(SOLID, SOLID), speed_limit=SLOW)
    network.add_lane(f"{name}:far-in", f"{name}:near-in", straight_in)
    network.add_lane(f"{name}:near-in", f"{name}:enter", PathLane(curve_in, WIDTH, (SOLID, SOLID), speed_limit=SLOW))
    network.add_lane(f"{name}:leave", f"{name}:near-out", PathLane(curve_out, WIDTH, (SOLID, SOLID), speed_limit=SLOW))
    network.add_lane(f"{name}:near-out", f"{name}:far-out", straight_out)


def _bridge(a: NDArray, a_dir: NDArray, b: NDArray, b_dir: NDArray) -> SmoothPath:
    """Cubic Hermite curve from point a to b (2,) [m] with the given directions."""
    chord = float(np.linalg.norm(b - a))
    u = np.linspace(0.0, 1.0, round(1.1 * chord) + 1)[:, None]
    blend = u * u * (3 - 2 * u)
    xy = (1 - blend) * a + blend * b + chord * u * (1 - u) * ((1 - u) * a_dir - u * b_dir)
    slope = 6 * u * (1 - u) * (b - a) + chord * ((1 - u) * (1 - 3 * u) * a_dir + u * (3 * u - 2) * b_dir)
    return from_nodes(xy, slope)


def u_turn(radius: float = 17.0, approach: float = 200.0) -> Layout:
    """Two lanes a -> b, a half circle to the left b -> c and two lanes back c -> d; lane 0 is the inner one."""
    network = RoadNetwork()
    half = along((approach, 0.0, 0.0), ((10.0, 0.0), (np.pi * radius, -1 / radius), (10.0, 0.0)), ramp=12.0)
    for i in range(2):
        turn = half.offset(i * WIDTH)
        a, b = turn.xy[0], turn.xy[-1]
        types = lines(i, 2)
        network.add_lane("a", "b", StraightLane(a - [approach, 0.0], a, WIDTH, types, speed_limit=SLOW))
        network.add_lane("b", "c", PathLane(turn, WIDTH, types, speed_limit=SLOW))
        network.add_lane("c", "d", StraightLane(b, b - [approach + 200.0, 0.0], WIDTH, types, speed_limit=SLOW))
    return Layout(network)


TURN_RADIUS = 14.0  # [m] of the right turn at the crossing


def crossing(before: float = 300.0, length: float = 900.0, radius: float = TURN_RADIUS) -> Layout:
    """Town road a -> b -> c of two lanes, from which two lanes turn right by 90 degrees, b -> e -> f.

    A lane g -> h comes the other way at y = -4 m; beside the side road, which runs towards +y, the way back u -> v ends
    at the main road. `radius` [m] is that of the inner turn, from lane 1.
    """
    network = RoadNetwork()
    _straight_lanes(network, ("a", "b"), 0.0, before, 2, speed_limit=15.0)
    _straight_lanes(network, ("b", "c"), before, length, 2, speed_limit=15.0)
    pieces = ((6.0, 0.0), (np.pi / 2 * radius, 1 / radius), (6.0, 0.0))
    bend = along((before, WIDTH, 0.0), pieces, ramp=10.0)
    for path, types in ((bend.offset(-WIDTH), (SOLID, STRIPED)), (bend, (NONE, SOLID))):
        a = path.xy[-1]
        network.add_lane("b", "e", PathLane(path, line_types=types, forbidden=True, speed_limit=SLOW))
        down = StraightLane(a, a + np.array([0.0, 250.0]), line_types=types, forbidden=True, speed_limit=15.0)
        network.add_lane("e", "f", down)
    back = bend.xy[-1] + np.array([2 * WIDTH, 0.0])
    up = StraightLane(back + np.array([0.0, 250.0]), back, line_types=(NONE, SOLID), forbidden=True, speed_limit=15.0)
    network.add_lane("u", "v", up)
    opposite = StraightLane([length, -WIDTH], [0.0, -WIDTH], line_types=(SOLID, SOLID), speed_limit=15.0)
    network.add_lane("g", "h", opposite)
    return Layout(network)

"""Hard cases of the life cycle with the default tracker; figures: docs/methods/life-cycle-of-tracks.md."""

from dataclasses import replace

import pytest

from tests.testbed.evaluation import road_cases as cases
from tests.testbed.evaluation.road_world import SEVEN, Vehicle, World, follow, record, with_clutter
from trackers.registry import build

SLOW = pytest.mark.slow
CLUTTER = sum(s.clutter for s in SEVEN.sensors)  # false alarms a scan
MOTORCYCLE = World((Vehicle(30, 0, 22.0, (14.0, 2.5)), Vehicle(30, -0.72, 22.5, (2.2, 0.8))))


def run(world, seconds, seed, radar=SEVEN, distort=None, **layers):
    """Outcome of the default tracker in a world of straight lanes."""
    tracker = replace(build("imm-spline", radar.models, **layers), road=world.road.map(seconds * 25.0))
    return follow(tracker, record(world, seconds, seed, lambda time: radar, distort))


def queue(gap, speed, ego):
    """Five cars of 4.5 m beside the ego, the gap [m] between their bumpers."""
    vehicles = [Vehicle(-8 + k * (4.5 + gap), 1, speed, (4.5, 1.85)) for k in range(5)]
    return World(tuple(vehicles), Vehicle(speed=ego, size=(4.7, 1.9)))


def held(outcome, start, end):
    """Number of vehicles that a track was paired with between start and end [s]."""
    return len(set().union(*(s.score.pairs for s in outcome.steps if start <= s.time < end)))


@pytest.mark.parametrize(
    ("total", "minute"), [pytest.param(12, 0.0, marks=SLOW), pytest.param(50, 0.0, marks=SLOW), (200, 0.5)]
)
def test_clutter_alone_bears_no_tracks(total, minute):
    outcome = run(World(), 20.0, 0, with_clutter(SEVEN, total / CLUTTER))
    confirmed = sum(e.kind == "confirmed" for s in outcome.steps for e in s.info.events)
    assert confirmed * 60 / 20 <= minute


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=SLOW)])
@pytest.mark.parametrize("world", [cases.ABREAST, MOTORCYCLE])
def test_two_abreast_never_become_one_track(world, seed):
    outcome = run(world, 4.0, seed)
    assert all(len(s.tracks.reported.id) >= 2 for s in outcome.steps if s.time >= 3)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=SLOW)])
def test_two_seconds_without_radar_keep_all_ids(seed):
    world = World(tuple(Vehicle(s, lane, 25.0 - lane) for s, lane in ((-40, -1), (-20, 1), (25, 0), (40, 1), (60, -1))))

    def silent(time, scene, scan, origin, rng):
        return scan._replace(mask=scan.mask & ~(2 <= time < 4), delivered=None)

    outcome = run(world, 6.0, seed, distort=silent)
    before, after = (next(s for s in outcome.steps if s.time >= t) for t in (1.95, 5.0))
    assert len(before.tracks.reported.id) == 5
    assert set(before.tracks.reported.id) == set(after.tracks.reported.id)


NOT_YET = pytest.mark.xfail(strict=True, reason="docs/methods/life-cycle-of-tracks.md says why")
QUEUES = [  # gap [m], speeds of the queue and of the ego [m/s], seed, marks; the first two are quick
    (0.8, 0, 4, 0, ()), (3.0, 0, 4, 0, ()), (0.8, 0, 4, 1, SLOW), (3.0, 0, 4, 1, (SLOW, NOT_YET)),
    (0.8, 2, 6, 0, SLOW), (3.0, 2, 6, 0, SLOW), (0.8, 2, 6, 1, SLOW), (3.0, 2, 6, 1, SLOW),
]  # fmt: skip


@pytest.mark.parametrize(("gap", "speed", "ego", "seed"), [pytest.param(*case, marks=m) for *case, m in QUEUES])
def test_of_five_cars_in_a_queue_so_many_are_held_after_two_and_four_seconds(gap, speed, ego, seed):
    two, four = {0.8: (2, 4), 3.0: (4, 5)}[gap]
    world = queue(gap, speed, ego)
    outcome = run(world, 4.2, seed)
    assert held(outcome, 1.9, 2.1) >= two
    assert held(outcome, 3.9, 4.1) >= four
    assert held(run(world, 4.2, seed, ground=None), 3.9, 4.1) < held(outcome, 3.9, 4.1)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=SLOW)])
def test_five_cars_of_a_column_at_speed_are_held(seed):
    """Gaps of 3 m at 25 m/s, a headway of 0.12 s: rarer than a truck, but the ground between them is empty."""
    world = queue(3.0, 25, 26)
    assert held(run(world, 2.2, seed), 1.9, 2.1) >= 4
    assert held(run(world, 2.2, seed, ground=None), 1.9, 2.1) <= 1

"""Where tracks begin: moving things anywhere, standing things in a lane of the map only."""

import numpy as np
import pytest

from tests.trackers.multi.known_objects import KnownObjects, scan_of
from trackers import MultiObjectTracker, SensorModel
from trackers.multi.road import RoadMap

RADAR = SensorModel(max_range=200.0, fov=np.pi)
REAR = [(50.0, -0.6), (50.0, 0.0), (50.0, 0.6), (50.3, 0.3)]  # four returns of one rear end
LANE = RoadMap.of([([[0.0, 0.0], [100.0, 0.0]], 4.0)])
BESIDE = RoadMap.of([([[0.0, 8.0], [100.0, 8.0]], 4.0)])


@pytest.mark.parametrize(
    ("road", "rate", "born"),
    [(None, 0.0, 0), (BESIDE, 0.0, 0), (LANE, 0.0, 1), (None, 9.0, 1), (BESIDE, 9.0, 1)],
    ids=["standing-no-map", "standing-off-lane", "standing-in-lane", "moving-no-map", "moving-off-lane"],
)
def test_what_stands_is_born_in_a_lane_of_the_map_and_nowhere_else(road, rate, born):
    tracker = MultiObjectTracker(KnownObjects(), (RADAR,), road=road)
    tracks, info = tracker.step(tracker.start(), scan_of(REAR, (0.15, 0.005, 0.1), rate), 0.0)
    assert len(tracks.id) == born
    assert sum(event.kind == "born" for event in info.events) == born


def test_a_turning_vehicle_across_the_line_of_sight_is_not_born_as_a_fast_one():
    """Its yaw rate alone makes the range rates of its ends differ, as a speed of 30 m/s the other way would."""
    along, turn, speed = np.linspace(-4.0, 4.0, 7), 0.3, 7.0
    place = np.stack([np.full(7, 100.0), along], -1)
    velocity = np.stack([-turn * along, np.full(7, speed)], -1)
    rate = (velocity * place).sum(-1) / np.hypot(*place.T)
    lane = RoadMap.of([([[100.0, -50.0], [100.0, 50.0]], 4.0)])
    tracker = MultiObjectTracker(KnownObjects(), (RADAR,), road=lane)
    tracks, _ = tracker.step(tracker.start(), scan_of(place, (0.15, 0.005, 0.1), rate), 0.0)
    assert len(tracks.id) == 1
    estimate = tracks.estimate
    assert abs(estimate.velocity[0, 1] - speed) < 2.5 * np.sqrt(estimate.cov[0, 3, 3])

"""What is in view: known as soon as it is visible, forgotten two seconds later."""

import numpy as np

from sensors.origin import Origin
from sensors.scene import boxes_scene
from testbed.environment.perception import truth_tracks
from testbed.environment.sources.in_view import InView
from trackers.multi.road import RoadMap
from trackers.scan import Scan

NO_SCAN = Scan.from_xy(np.zeros((0, 2)))
ROAD = RoadMap.of([])


def ids_over_time(visible, dt=0.5):
    """Ids in view at each scan; visible (K, N) is the visible share of N objects at K scans."""
    source, found = InView(), []
    state = source.start_on(ROAD)
    for k, share in enumerate(visible):
        scene = boxes_scene([[20.0 * (i + 1), 0, 0] for i in range(len(share))], [[4, 2]] * len(share), time=k * dt)
        origin = Origin.empty(len(share))._replace(visible=np.array(share))
        state, tracks, _ = source.step_on_truth(state, NO_SCAN, scene, origin)
        found.append(tracks.id.tolist())
    return found


def test_an_object_is_known_from_the_first_visible_sliver_until_two_seconds_after_the_last():
    seen = [[1, 0], [1, 0.01], [1, 0], [1, 0], [1, 0], [1, 0], [1, 0], [1, 0.5]]
    assert ids_over_time(seen) == [[0], [0, 1], [0, 1], [0, 1], [0, 1], [0, 1], [0], [0, 1]]


def test_the_tracks_of_what_is_visible_are_those_of_the_truth():
    scene = boxes_scene([[20.0, 1, 0.1], [40, 0, 0]], [[4, 2], [5, 2]], [[10, 1], [11, 0]])
    source = InView()
    origin = Origin.empty(2)._replace(visible=np.array([0.0, 1.0]))
    _, tracks, info = source.step_on_truth(source.start_on(ROAD), NO_SCAN, scene, origin)
    expected = truth_tracks(scene).rows(np.array([False, True]))
    np.testing.assert_array_equal(tracks.estimate.pose, expected.estimate.pose)
    np.testing.assert_array_equal(tracks.estimate.velocity, [[11, 0]])
    assert tracks.reported.id.tolist() == [1]
    assert info.owner.shape == (0,)

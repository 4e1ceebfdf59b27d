"""The collision forecast on straight paths, against times that can be computed by hand."""

import numpy as np
import pytest

from testbed.planners.collision import distance_driven, first_contact, instants
from testbed.planners.prediction import LanePath, Others

ARC = 2.0 * np.arange(76)
STRAIGHT = LanePath(np.stack([ARC, 0 * ARC], -1), 0 * ARC, ARC, 0 * ARC, np.full(76, np.inf), 0.0)
SIZE = np.array([5.0, 2.0])


def others(*rows):
    """Each (x, y, vx, vy, course), 5 x 2 m, on straight lanes along their course."""
    x, y, vx, vy, course = np.array(rows, float).reshape(-1, 5).T
    ones, sure = np.ones((len(x), 1)), (np.zeros((len(x), 2)), np.zeros((len(x), 2, 2)))
    return Others(np.stack([x, y], -1), course, np.stack([vx, vy], -1), ones * SIZE, course, 0 * x, *sure)


def contact(speed, *rows, offset=0.0):
    arc = distance_driven(np.full(len(instants(4.0)), speed))
    return float(first_contact(STRAIGHT, arc, offset, SIZE, others(*rows)))


def test_nobody_is_no_contact():
    assert contact(20.0) == np.inf


@pytest.mark.parametrize(("ahead", "lead"), [(25.0, 10.0), (35.0, 0.0), (65.0, -20.0)])
def test_a_leader_is_reached_when_the_gap_is_used_up(ahead, lead):
    exact = (ahead - 5.0) / (20.0 - lead)
    assert exact <= contact(20.0, (ahead, 0.0, lead, 0.0, 0.0)) < exact + 0.2


def test_the_next_lane_is_passed():
    assert contact(20.0, (25.0, 3.5, 10.0, 0.0, 0.0)) == np.inf


def test_one_that_crosses_is_met_only_if_it_is_there_at_the_same_time():
    half_pi = np.pi / 2
    assert contact(10.0, (20.0, -16.0, 0.0, 8.0, half_pi)) == pytest.approx(1.6, abs=0.21)
    assert contact(10.0, (20.0, -40.0, 0.0, 8.0, half_pi)) == np.inf
    assert contact(0.0, (20.0, -16.0, 0.0, 8.0, half_pi)) == np.inf


def test_motion_across_the_lane_fades():
    """With a decay time of 1.5 s a drift of 1 m/s carries on for 1.5 m, one of 3 m/s for 4.5 m."""
    assert contact(20.0, (4.0, 4.0, 20.0, -1.0, 0.0)) == np.inf
    assert contact(20.0, (4.0, 4.0, 20.0, -3.0, 0.0)) < 2.0


def test_own_offset_from_the_path_fades_within_a_second():
    assert contact(20.0, (0.0, 2.5, 20.0, 0.0, 0.0)) == np.inf
    assert contact(20.0, (0.0, 2.5, 20.0, 0.0, 0.0), offset=1.5) == 0.0
    assert contact(20.0, (60.0, 2.5, 0.0, 0.0, 0.0), offset=1.5) == np.inf


def test_alternatives_and_their_order_do_not_influence_each_other():
    arc = distance_driven(np.array([0.0, 5.0, 20.0, 30.0])[:, None] * np.ones(len(instants(4.0))))
    crowd = others((40.0, 0.0, 10.0, 0.0, 0.0), (25.0, -16.0, 0.0, 8.0, np.pi / 2), (300.0, 0.0, 0.0, 0.0, 0.0))
    together = first_contact(STRAIGHT, arc, 0.0, SIZE, crowd)
    alone = [float(first_contact(STRAIGHT, a, 0.0, SIZE, crowd)) for a in arc]
    np.testing.assert_array_equal(together, alone)
    backwards = Others(*(field[::-1] for field in crowd))
    np.testing.assert_array_equal(first_contact(STRAIGHT, arc, 0.0, SIZE, backwards), together)

"""What a union of two pieces is, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from trackers import Scan, SensorModel, build, prior
from trackers.multi.exclusion import Exclusion
from trackers.multi.ground import GroundTest


def test_a_union_is_less_certain_along_the_vehicle_and_in_its_length():
    """Two pieces 5 m long, centres 6 m apart on a vehicle that drives along y: one box of 11 m, its ends unsure.

    Position: 0.5^2 m^2 across as before, 1 m^2 more along. Length: 20 % of 11 m; width: at least 0.1 m.
    """
    pose = np.array([[3.0, 20.0, np.pi / 2], [3.0, 26.0, np.pi / 2]])
    pieces = prior(pose, velocity=(0.0, 20.0), size=(5.0, 2.0), size_std=(0.4, 0.05), position_std=0.5)
    verdict = Exclusion().apply(pieces, np.array([2.0, 1.0]))
    assert verdict.joined.tolist() == [True, False]
    union = verdict.estimate
    np.testing.assert_allclose(union.pose[0], [3.0, 23.0, np.pi / 2])
    np.testing.assert_allclose(union.size[0], [11.0, 2.0])
    np.testing.assert_allclose(union.cov[0, :2, :2], np.diag([0.25, 1.25]), atol=1e-12)
    np.testing.assert_allclose(union.cov[0, 2:, 2:], np.eye(2))
    np.testing.assert_allclose(union.size_std[0], [2.2, 0.1])


def test_a_duplicate_leaves_the_estimate_of_the_better_track_as_it_is():
    twins = prior(np.array([[20.0, 0, 0], [20.3, 0, 0]]), velocity=(20.0, 0.0))
    verdict = Exclusion().apply(twins, np.array([2.0, 1.0]))
    assert verdict.keep.tolist() == [True, False]
    np.testing.assert_array_equal(verdict.estimate.cov, twins.cov)
    np.testing.assert_array_equal(verdict.estimate.size_std, twins.size_std)


@pytest.mark.parametrize(("std", "reaches", "restarts"), [(1.7, True, False), (0.4, True, True), (1.7, False, True)])
def test_a_union_that_is_no_longer_than_a_track_may_be_leaves_it_as_it_is(std, reaches, restarts):
    """4.5 m, and another track of which 1.4 m lie beyond: (MOT.58), of filters whose gates reach so far."""
    pair = prior([[0, 0, 0], [0.75, 1.0, 0]], velocity=(8.0, 0.0), size=[[4.5, 1.0], [5.8, 1.0]], size_std=(std, 0.3))
    verdict = Exclusion().apply(pair, np.array([2.0, 1.0]), reaches=reaches)
    assert verdict.keep.tolist() == [True, False]
    assert verdict.joined.tolist() == [restarts, False]
    assert (verdict.estimate.size[0, 0] > 4.5) == restarts


@pytest.mark.parametrize(("length", "kept"), [(2.0, 1), (4.4, 2)])
def test_of_what_was_divided_only_what_is_no_longer_than_a_car_is_united(length, kept):
    """At 25 m/s, 1 m between them: two halves of one car, or two cars between which the ground was empty."""
    x = (length + 1.0) / 2
    pair = prior([[-x, 0, 0], [x, 0, 0]], velocity=(25.0, 0.0), size=(length, 1.8))
    assert Exclusion().apply(pair, np.array([2.0, 1.0]), np.ones((2, 2), bool)).keep.sum() == kept


@pytest.mark.parametrize(("behind", "before"), [([False, True], [False, False]), ([False, False], [True, False])])
@pytest.mark.parametrize(
    ("heading", "gap", "speed", "kept"),
    [(0.0, 0.5, 25.0, 2), (np.pi, 0.5, 25.0, 1), (np.pi, 0.9, 25.0, 2), (np.pi, 0.1, 7.9, 2), (np.pi, 0.1, 8.1, 1)],
)
def test_at_the_other_end_of_empty_ground_what_touches_is_united(behind, before, heading, gap, speed, kept):
    """Empty behind the front one, or before the rear one; where they are turned round the ground is elsewhere."""
    x = (5.0 + gap) / 2
    pair = prior([[-x, 0, heading], [x, 0, heading]], velocity=(speed * np.cos(heading), 0.0), size=(5.0, 1.8))
    ground = np.stack([behind, before], -1)
    assert Exclusion().apply(pair, np.array([2.0, 1.0]), ground).keep.sum() == kept


@pytest.mark.parametrize(("width", "std", "kept"), [(1.8, 0.1, 2), (2.5, 0.1, 1), (1.8, 0.6, 1)])
def test_a_car_that_is_known_is_not_united_to_a_long_vehicle(width, std, kept):
    """3 m of gap at 25 m/s; what may be as wide as a truck is one."""
    pair = prior([[0, 0, 0], [7.4, 0, 0]], velocity=(25.0, 0.0), size=(4.4, width), size_std=(0.2, std))
    assert Exclusion().apply(pair, np.array([2.0, 1.0]), None, GroundTest().two).keep.sum() == kept


@pytest.mark.parametrize(
    ("name", "reaches"), [("imm-spline", True), ("imm-spline:size=off", False), ("rm-koch", False)]
)
def test_the_gates_of_filters_with_sizes_of_their_own_reach_as_far_as_their_tracks_may_be_long(name, reaches):
    told = []

    class Watched(Exclusion):
        def apply(self, *args):
            told.append(args[4])
            return super().apply(*args)

    tracker = replace(build(name, (SensorModel(),)), exclusion=Watched())
    xy = np.array([[20.0, 0.0], [20.1, 0.4], [20.2, -0.4], [21.0, 0.2]])
    tracker.step(tracker.start(), Scan.from_xy(xy), 0.1)
    assert told == [reaches]

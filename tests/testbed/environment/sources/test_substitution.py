"""Groups of errors: what is taken from the tracker, and what stays the truth."""

import numpy as np
import pytest

from sensors.scene import boxes_scene
from testbed.environment.perception import truth_tracks
from testbed.environment.sources.substitution import Substituted, match, mix, subsets
from trackers.estimate import prior
from trackers.multi.tracks import Tracks

SCENE = boxes_scene([[20.0, 0, 0], [50, 4, 0], [80, 0, 0]], [[4, 2], [10, 2.5], [4, 2]], [[10, 0], [12, 0], [0, 0]])
TRUTH = truth_tracks(SCENE)
IDEAL = TRUTH.rows(np.array([True, True, False]))  # the third object is hidden


def own_tracks():
    """Of a tracker: 7 on the first object, 8 on nothing, 9 tentative on the second."""
    estimate = prior(
        [[21.0, 0.5, 0.2], [35, -4, 0], [49, 4, 0.1]],
        [[9, 1], [5, 0], [11, 0]],
        [0.1, 0, 0.2],
        [[5, 2], [4, 2], [8, 2]],
    )
    estimate.cov[:, 0, 2] = estimate.cov[:, 2, 0] = 0.1
    return Tracks(
        np.array([7, 8, 9]), np.array([0.9, 0.8, 0.3]), np.ones(3, int), np.ones(3), np.array([True, True, False]),
        None, estimate, 10,
    )  # fmt: skip


def assert_same(a: Tracks, b: Tracks):
    np.testing.assert_array_equal(a.id, b.id)
    np.testing.assert_array_equal(a.existence, b.existence)
    for name in ("pose", "velocity", "yaw_rate", "size", "cov", "size_std", "heading_std", "yaw_rate_std"):
        np.testing.assert_array_equal(getattr(a.estimate, name), getattr(b.estimate, name))


def test_with_no_group_the_planner_gets_what_is_in_view_and_with_all_the_tracks():
    assert_same(mix(TRUTH, IDEAL, own_tracks(), ""), IDEAL)
    assert_same(mix(TRUTH, IDEAL, own_tracks(), "EGV"), own_tracks())


def test_existence_alone_takes_who_is_there_and_leaves_matching_tracks_without_error():
    found = mix(TRUTH, IDEAL, own_tracks(), "E")
    assert found.id.tolist() == [7, 8, 9]
    assert found.reported.id.tolist() == [7, 8]
    np.testing.assert_array_equal(found.estimate.pose, [[20, 0, 0], [35, -4, 0], [50, 4, 0]])
    np.testing.assert_array_equal(found.estimate.velocity, [[10, 0], [5, 0], [12, 0]])
    np.testing.assert_array_equal(found.estimate.size[0], [4, 2])


def test_geometry_alone_moves_the_matching_objects_and_leaves_their_motion():
    found = mix(TRUTH, IDEAL, own_tracks(), "G")
    assert found.id.tolist() == [0, 1]
    np.testing.assert_array_equal(found.estimate.pose, [[21, 0.5, 0.2], [50, 4, 0]])  # an unreported track is none
    np.testing.assert_array_equal(found.estimate.size, [[5, 2], [10, 2.5]])
    np.testing.assert_array_equal(found.estimate.velocity, [[10, 0], [12, 0]])


def test_motion_alone_changes_velocity_and_yaw_rate_only():
    found = mix(TRUTH, IDEAL, own_tracks(), "V")
    np.testing.assert_array_equal(found.estimate.pose, IDEAL.estimate.pose)
    np.testing.assert_array_equal(found.estimate.velocity, [[9, 1], [12, 0]])
    np.testing.assert_array_equal(found.estimate.yaw_rate, [0.1, 0])


@pytest.mark.parametrize("groups", subsets())
def test_covariances_go_with_their_groups_and_stay_definite(groups):
    found = mix(TRUTH, IDEAL, own_tracks(), groups)
    cov, own, tiny = found.estimate.cov[0], own_tracks().estimate.cov[0], TRUTH.estimate.cov[0]
    np.testing.assert_array_equal(cov[:2, :2], (own if "G" in groups else tiny)[:2, :2])
    np.testing.assert_array_equal(cov[2:, 2:], (own if "V" in groups else tiny)[2:, 2:])
    assert cov[0, 2] == (0.1 if {"G", "V"} <= set(groups) else 0.0)
    np.testing.assert_array_equal(cov, cov.T)
    assert (np.linalg.eigvalsh(found.estimate.cov) > 0).all()


def test_reported_tracks_choose_before_unreported_ones():
    rival = own_tracks()._replace(existence=np.array([0.3, 0.8, 0.9]))
    rival.estimate.pose[2] = [22.0, 0, 0]  # farther from the first object than the unreported track 7, and reported
    assert match(rival, TRUTH).tolist() == [-1, -1, 0]


def test_the_gate_grows_with_the_shorter_of_two_long_boxes():
    def partner(offset, length):
        own = prior([[50.0 + offset, 4, 0]], size=[[length, 2.5]])
        one = Tracks(*(np.array([x]) for x in (1, 0.9, 1, 1.0, True)), None, own)
        return match(one, TRUTH).tolist()

    assert partner(6.4, 10.0) == [1]  # 10 / 2 + 1.5
    assert partner(6.6, 10.0) == [-1]
    assert partner(4.1, 4.0) == [-1]


def test_a_track_that_is_not_finite_matches_nothing():
    broken = own_tracks()
    broken.estimate.pose[0, 0] = np.nan
    assert match(broken, TRUTH).tolist() == [-1, -1, 1]


def test_unknown_groups_are_refused():
    for groups in ("X", "EE"):
        with pytest.raises(ValueError, match="each once, got"):
            Substituted(object(), groups)

"""What a union of two pieces is, by hand."""

import numpy as np

from trackers import prior
from trackers.multi.exclusion import Exclusion


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

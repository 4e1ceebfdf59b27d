"""The near edge of estimates, by hand."""

import numpy as np
import pytest

from testbed.evaluation.pair_errors import Pairs, PairTruth
from trackers import prior

BOX = np.array([[0.0, 0.0, 0.0]]), np.array([[4.0, 2.0]])


def near_edge(ego, pose, size=(4.0, 2.0), edges=(0.4, 0.3, 0.2, 0.1)):
    """Error and standard deviation of an estimate of a box of 4 m by 2 m at the origin, seen from ego."""
    truth = PairTruth(BOX[0], np.zeros((1, 2)), BOX[1], np.array([ego]), ((),))
    estimate = prior(np.array([pose]), size=size)._replace(edge_std=np.array([edges]))
    return Pairs(truth, estimate, np.zeros(1)).near_edge[:, 0]


@pytest.mark.parametrize(
    ("ego", "pose", "error", "std"),
    [
        ((-30.0, 0.5), (0.2, 0.9, 0.0), -0.2, 0.3),  # from behind: the rear is 0.2 m further ahead
        ((30.0, 0.5), (0.2, 0.9, 0.0), 0.2, 0.4),
        ((1.0, 9.0), (0.2, 0.9, 0.0), 0.9, 0.2),  # from the left, only what is across counts
        ((1.0, -9.0), (0.2, 0.9, 0.0), -0.9, 0.1),
        ((-30.0, 0.5), (0.2, 0.9, np.pi), -0.2, 0.4),  # held for a car that comes: its front is what is seen
    ],
)
def test_the_edge_that_faces_the_ego_is_compared_across_itself(ego, pose, error, std):
    np.testing.assert_allclose(near_edge(ego, pose), [error, std], atol=1e-12)


def test_a_far_end_that_nobody_saw_is_no_error_of_the_near_edge():
    error, _ = near_edge((-30.0, 0.0), (3.0, 0.0, 0.0), size=(10.0, 2.0))
    assert error == pytest.approx(0.0, abs=1e-12)

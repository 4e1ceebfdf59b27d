"""What an estimate says of the edges of its box."""

import numpy as np

from trackers import prior


def test_edges_are_those_of_independent_centre_and_size_unless_they_are_stated():
    """Turned by 90 degrees: var = 4 along, 1 across, and a quarter of those of length and width."""
    e = prior((3.0, 2.0, np.pi / 2), position_std=1.0, size_std=(2.0, 0.6))
    e.cov[1, 1] = 4.0
    np.testing.assert_allclose(e.edges, np.sqrt([5.0, 5.0, 1.09, 1.09]))
    stated = e._replace(edge_std=np.array([0.9, 0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(stated.edges, [0.9, 0.1, 0.2, 0.3])


def test_edges_have_the_leading_axes_of_the_estimate():
    assert prior(np.zeros((2, 5, 3))).edges.shape == (2, 5, 4)

"""Rows of states: what is put back is what was taken."""

from typing import NamedTuple

import numpy as np
import pytest

from trackers.batch import put, take


class Inner(NamedTuple):
    a: np.ndarray


class Outer(NamedTuple):
    inner: Inner
    b: np.ndarray
    contour: None = None


@pytest.mark.parametrize("index", [np.array([2, 0]), np.array([True, False, True])])
def test_put_replaces_the_rows_that_take_gives_and_no_others(index):
    state = Outer(Inner(np.arange(6.0).reshape(3, 2)), np.arange(3.0))
    rows = Outer(Inner(-take(state, index).inner.a), -take(state, index).b)
    new = put(state, index, rows)
    np.testing.assert_array_equal(new.inner.a, [[0, -1], [2, 3], [-4, -5]])
    np.testing.assert_array_equal(new.b, [0, 1, -2])
    assert new.contour is None
    assert state.b[2] == 2  # the old one is as it was


def test_one_object_is_a_row_too():
    state = Outer(Inner(np.array([1.0, 2.0])), np.array(3.0))
    seen = np.array(True)
    assert take(state, seen).b.shape == (1,)
    np.testing.assert_array_equal(put(state, seen, take(state, seen)).inner.a, state.inner.a)

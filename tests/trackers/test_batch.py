"""Rows of states: what is put back is what was taken."""

import pickle
from typing import NamedTuple

import numpy as np
import pytest

from trackers.batch import Memoised, keep, put, select, take


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


def test_what_is_kept_is_what_a_mask_takes_and_all_of_it_is_no_copy():
    state = Outer(Inner(np.arange(6.0).reshape(3, 2)), np.arange(3.0))
    assert keep(state, np.ones(3, bool)) is state
    some = np.array([True, False, True])
    np.testing.assert_array_equal(keep(state, some).inner.a, take(state, some).inner.a)
    assert keep(state, np.zeros(3, bool)).inner.a.shape == (0, 2)


def test_what_two_states_share_is_not_chosen_between():
    shared = np.arange(6.0).reshape(3, 2)
    yes, no = Outer(Inner(shared), np.ones(3)), Outer(Inner(shared), np.zeros(3))
    new = select(np.array([True, False, True]), yes, no)
    assert new.inner.a is shared
    np.testing.assert_array_equal(new.b, [1, 0, 1])


def test_the_last_value_is_kept_for_the_same_state_only_and_copies_begin_anew():
    seen = []
    last = Memoised(lambda state: seen.append(1) or state.b.sum())
    state = Outer(Inner(np.zeros((3, 2))), np.arange(3.0))
    assert last(state) == last(state) == 3.0
    assert len(seen) == 1
    equal = Outer(*state)
    assert last(equal) == last(state) == 3.0  # the one before is forgotten
    assert len(seen) == 3
    kept = Memoised(len)
    kept((1, 2))
    assert pickle.loads(pickle.dumps(kept))._kept is None

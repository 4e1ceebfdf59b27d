"""States as tuples of arrays with leading axes: take rows, choose between two, put together.

A state is a NamedTuple whose fields all have the same leading axes; `None` fields (an estimate without contour) pass
through. Nested tuples are walked.
"""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound=tuple)


def _walk(function: Any, *states: Any) -> Any:
    """Apply to corresponding leaves; None stays None."""
    first = states[0]
    if first is None:
        return None
    if isinstance(first, tuple):
        return type(first)(*(_walk(function, *leaves) for leaves in zip(*states, strict=True)))
    return function(*states)


def take(state: T, index: NDArray) -> T:
    """Rows `index` (integers or a boolean mask) of the first axis of every field."""
    return _walk(lambda leaf: np.asarray(leaf)[index], state)


def select(where: NDArray, yes: T, no: T) -> T:
    """Rows of `yes` where `where` (...) is true, else of `no`; all with the leading axes of `where`."""

    def choose(a: NDArray, b: NDArray) -> NDArray:
        mask = where.reshape(where.shape + (1,) * (np.ndim(a) - where.ndim))
        return np.where(mask, a, b)

    return _walk(choose, yes, no)


def put(state: T, index: NDArray, rows: T) -> T:
    """The state with its rows `index` (integers or a boolean mask), as `take` gives them, replaced by `rows`."""

    def replaced(leaf: NDArray, row: NDArray) -> NDArray:
        new = np.array(leaf)
        new[index] = row
        return new

    return _walk(replaced, state, rows)


def stack(states: Sequence[T]) -> T:
    """States of single objects as one state with a new first axis."""
    return _walk(lambda *leaves: np.stack(leaves), *states)


def concatenate(states: Sequence[T]) -> T:
    """States joined along their first axis."""
    return _walk(lambda *leaves: np.concatenate(leaves), *states)

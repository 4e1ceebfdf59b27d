"""States as tuples of arrays with leading axes: take rows, choose between two, put together.

A state is a NamedTuple whose fields all have the same leading axes; `None` fields (an estimate without contour) pass
through. Nested tuples are walked.
"""

from collections.abc import Callable, Sequence
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound=tuple)
V = TypeVar("V")
States = ParamSpec("States")


def _walk(function: Any, *states: Any) -> Any:
    """Apply to corresponding leaves; None stays None."""
    first = states[0]
    if first is None:
        return None
    if isinstance(first, tuple):
        return type(first)(*[_walk(function, *leaves) for leaves in zip(*states, strict=True)])
    return function(*states)


def take(state: T, index: NDArray) -> T:
    """Rows `index` (integers or a boolean mask) of the first axis of every field."""
    return _walk(lambda leaf: np.asarray(leaf)[index], state)


def keep(state: T, mask: NDArray) -> T:
    """Rows where mask (T,) bool is true; the state itself, not a copy, where that is everywhere."""
    return state if mask.all() else take(state, np.flatnonzero(mask))


def select(where: NDArray, yes: T, no: T) -> T:
    """Rows of `yes` where `where` (...) is true, else of `no`; all with the leading axes of `where`.

    A field that is the same array in both stays that array.
    """

    def choose(a: NDArray, b: NDArray) -> NDArray:
        if a is b:
            return a
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


class Memoised(Generic[States, V]):
    """A function of states or arrays that keeps its last value: one step asks the same of the same several times.

    States are never written into, so the same objects have the same value.
    """

    def __init__(self, function: Callable[States, V]) -> None:
        self.function = function
        self._kept: tuple[tuple[Any, ...], V] | None = None

    def __call__(self, *states: States.args, **none: States.kwargs) -> V:
        """The value for these states."""
        kept = self._kept
        if kept is None or any(a is not b for a, b in zip(states, kept[0], strict=True)):
            self._kept = kept = states, self.function(*states, **none)
        return kept[1]

    def keep(self, states: tuple[Any, ...], value: V) -> None:
        """Keep a value that was computed elsewhere."""
        self._kept = states, value

    def __reduce__(self) -> tuple[Any, ...]:
        return Memoised, (self.function,)  # copies begin anew

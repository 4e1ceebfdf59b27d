"""How far chance alone may move the mean of a few runs, judged by the spread within groups of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def pooled_spread(groups: Sequence[NDArray]) -> tuple[float, int]:
    """Standard deviation within groups (n_c,), pooled over them, and its degrees of freedom; NaN for none of these.

    >>> pooled_spread([np.array([1.0, 3.0]), np.array([0.0, 0.0])])
    (1.0, 2)
    """
    squares, dof = _sums(groups)
    return float(_root(squares.sum(), dof.sum())), int(dof.sum())


def spread_of_others(groups: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """The same for each group (C,) over all groups but itself, with the degrees of freedom (C,)."""
    squares, dof = _sums(groups)
    others = np.array([squares[np.arange(len(squares)) != k].sum() for k in range(len(squares))])
    return _root(others, dof.sum() - dof), dof.sum() - dof


def _sums(groups: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """Sums of squares (C,) about the means of the groups, and their degrees of freedom (C,)."""
    known = [group for group in groups if len(group)]
    squares = [float(((group - group.mean()) ** 2).sum()) for group in known]
    return np.array(squares), np.array([len(group) - 1 for group in known], int)


def _root(squares: NDArray, dof: NDArray) -> NDArray:
    return np.sqrt(squares / np.where(dof > 0, dof, np.nan))

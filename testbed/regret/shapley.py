"""Exact Shapley values: how much of a difference each of a few groups causes, whatever the order they come in.

docs/methods/regret.md, section 5.
"""

from collections.abc import Mapping
from math import factorial

import numpy as np
from numpy.typing import NDArray

from testbed.environment.sources.substitution import GROUPS


def shapley(values: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Share (...) of each group in values["EGV"] - values[""].

    values: an array (...) for each of the eight subsets of the groups, as named by `substitution.subsets`.

    >>> shapley({s: np.array(float(len(s))) for s in ("", "E", "G", "V", "EG", "EV", "GV", "EGV")})["E"].item()
    1.0
    """
    n = len(GROUPS)
    shares = {}
    for group in GROUPS:
        share = np.zeros_like(np.asarray(values[""], float))
        for subset, value in values.items():
            if group not in subset:
                weight = factorial(len(subset)) * factorial(n - len(subset) - 1) / factorial(n)
                with_it = "".join(g for g in GROUPS if g in subset + group)
                share = share + weight * (np.asarray(values[with_it]) - np.asarray(value))  # (RGT.8)
        shares[group] = share
    return shares

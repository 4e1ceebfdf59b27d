"""Numbers that follow from keys, arrays of uint64: the same key, the same number, and nothing is drawn or kept.

Keys are mixed by the finaliser of splitmix64 (Steele, Lea and Flood (2014), "Fast splittable pseudorandom number
generators").
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

STEP = 0x9E3779B97F4A7C15  # odd, 2^64 over the golden ratio


def mix(key: NDArray) -> NDArray:
    """Keys (...) uint64 whose bits all depend on all bits of those given."""
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        key = (key ^ (key >> np.uint64(shift))) * np.uint64(factor)
    return key ^ (key >> np.uint64(31))


def fold(key: NDArray, number: ArrayLike) -> NDArray:
    """Keys (...) uint64 of keys and integers (...), which broadcast."""
    counted = np.atleast_1d(np.asarray(number)).astype(np.uint64) + np.uint64(1)
    return mix(key ^ mix(counted * np.uint64(STEP)))


def uniform(key: NDArray) -> NDArray:
    """Uniform numbers (...) within [0, 1) of keys (...) uint64."""
    return (key >> np.uint64(11)) / 2.0**53

"""Figures of an independent implementation on the same set-ups, 100 runs: docs/reproductions.md has them in brackets.

The papers print curves only. Mean squared Gaussian Wasserstein distance is `gwd2` [m^2], its root's mean `gwd` [m].
"""

from collections.abc import Mapping

from studies.papers.xia2020.methods import (
    LEARNED,
    LEARNED_LOOSE,
    LEARNED_N,
    MAP,
    MAP_HALF,
    MAP_SEED,
    MM,
    ONLINE,
    ONLINE_N,
    RM,
    RM_MATCHED,
)

FULL_COLUMNS = ("pos", "vel", "head", "len", "wid", "gwd2", "gwd", "nees")
FULL: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "htg": {
        RM: (0.388, 0.326, 3.46, 1.559, 0.763, 1.029, 1.002, 2.6),
        RM_MATCHED: (0.388, 0.325, 3.47, 0.145, 0.187, 0.259, 0.464, 2.5),
        ONLINE: (0.357, 0.349, 3.04, 0.262, 0.181, 0.243, 0.453, 4.2),
        LEARNED: (0.533, 0.440, 5.27, 0.131, 0.412, 0.400, 0.570, 42),
        LEARNED_N: (0.389, 0.427, 3.05, 0.203, 0.138, 0.205, 0.409, 4.4),
        MM: (0.382, 0.323, 3.49, 0.183, 0.209, 0.252, 0.458, 2.4),
        MAP: (0.244, 0.28, 2.41, 0.176, 0.066, 0.074, 0.241, 1.5),
    },
    "band": {
        RM: (0.401, 0.324, 3.68, 2.100, 1.088, 1.703, 1.298, 2.4),
        RM_MATCHED: (0.401, 0.323, 3.69, 0.124, 0.214, 0.274, 0.477, 2.4),
        ONLINE: (0.289, 0.314, 2.92, 0.181, 0.163, 0.177, 0.385, 4.7),
        LEARNED: (1.340, 0.599, 11.9, 0.177, 1.095, 2.227, 1.193, 242),
        LEARNED_N: (0.418, 0.468, 3.21, 0.161, 0.131, 0.224, 0.423, 5.0),
        MM: (0.404, 0.323, 3.72, 0.117, 0.201, 0.276, 0.479, 2.4),
        MAP: (0.177, 0.23, 2.47, 0.102, 0.056, 0.041, 0.177, 1.7),
    },
    "vrm": {
        RM: (0.443, 0.343, 3.77, 3.132, 1.257, 3.219, 1.789, 2.4),
        RM_MATCHED: (0.442, 0.341, 3.78, 0.169, 0.184, 0.320, 0.518, 2.4),
        ONLINE: (0.348, 0.325, 3.19, 0.787, 0.323, 0.398, 0.586, 5.4),
        LEARNED: (3.91, 1.66, 22, 1.96, 1.86, 18.0, 3.07, 1350),
        LEARNED_N: (0.465, 0.509, 3.23, 0.160, 0.104, 0.254, 0.451, 5.9),
        MAP: (0.196, 0.18, 2.43, 0.090, 0.114, 0.050, 0.179, 3.1),
    },
}

CASES = tuple(f"{course}, {hertz} Hz" for hertz in (2, 13) for course in ("following", "right turn", "S curve"))
PARTIAL: Mapping[str, tuple[tuple[float, float], ...]] = {  # gwd2, gwd in the order of CASES
    RM: ((3.08, 1.69), (2.47, 1.50), (3.62, 1.85), (2.94, 1.68), (2.41, 1.51), (3.57, 1.86)),
    RM_MATCHED: ((3.40, 1.78), (2.30, 1.43), (4.09, 1.97), (3.38, 1.81), (2.10, 1.40), (4.21, 2.03)),
    ONLINE: ((1.43, 0.98), (3.80, 1.29), (13.7, 2.23), (1.34, 0.82), (1.43, 1.02), (9.61, 2.09)),
    ONLINE_N: ((0.85, 0.83), (1.15, 0.96), (1.69, 1.19), (0.45, 0.62), (0.47, 0.65), (0.99, 0.94)),
    LEARNED: ((2.81, 1.61), (1.69, 1.19), (3.69, 1.87), (3.95, 1.89), (1.68, 1.21), (6.42, 2.41)),
    LEARNED_LOOSE: ((8.35, 2.20), (3.88, 1.55), (8.41, 2.44), (113, 7.7), (13.4, 2.6), (102, 7.7)),
    LEARNED_N: ((2.50, 1.50), (1.31, 1.04), (3.29, 1.76), (2.30, 1.45), (0.96, 0.90), (3.22, 1.75)),
    MM: ((0.70, 0.76), (0.71, 0.76), (1.13, 1.00), (0.38, 0.57), (0.33, 0.52), (0.93, 0.93)),
    MAP_SEED: ((0.58, 0.72), (0.35, 0.55), (0.75, 0.82), (0.61, 0.76), (0.26, 0.49), (0.91, 0.93)),
    MAP: ((0.23, 0.44), (0.26, 0.46), (0.27, 0.48), (0.15, 0.36), (0.12, 0.33), (0.22, 0.44)),
    MAP_HALF: ((0.25, 0.47), (0.29, 0.48), (0.32, 0.52), (0.17, 0.39), (0.13, 0.34), (0.25, 0.48)),
}


def full_reference(generator: str, method: str) -> dict[str, float]:
    """Figures of a row of the full view, none where the implementation has no such row."""
    return dict(zip(FULL_COLUMNS, FULL.get(generator, {}).get(method, ()), strict=False))


def partial_reference(case: str, method: str) -> dict[str, float]:
    """Figures of a row of the partial view, none where the implementation has no such row."""
    if method not in PARTIAL or case not in CASES:
        return {}
    return dict(zip(("gwd2", "gwd"), PARTIAL[method][CASES.index(case)], strict=True))

"""Figures of an independent implementation of yao2021, 100 runs; the paper prints curves only."""

from collections.abc import Mapping

COLUMNS = ("position m", "speed m/s", "heading rad", "length m", "width m", "NEES")
_NAN = float("nan")
_ROWS = {
    ("truck", "A before"): (0.108, 0.0291, 0.0059, 0.0015, 0.0003, 3.5),
    ("truck", "A smoothed"): (0.104, 0.0258, 0.0030, 0.0025, 0.0004),
    ("truck", "A not adapted"): (0.110, 0.0297, 0.0061, 0.0042, 0.0006, 3.7),
    ("truck", "A adapted"): (0.092, 0.0330, 0.0062, 0.0024, 0.0027, 9.0),
    ("truck", "B adapted"): (0.044, 0.0351, 0.0063, 0.0028, 0.0030, 3.7),
    ("tractor", "A before"): (0.181, 0.0365, 0.0145, 0.0025, 0.0139, 10.6),
    ("tractor", "A smoothed"): (0.169, 0.0318, 0.0095, 0.0042, 0.0236),
    ("tractor", "A not adapted"): (0.187, 0.0384, 0.0153, 0.0070, 0.0391, 11.8),
    ("tractor", "A adapted"): (0.135, 0.0321, 0.0071, 0.0037, 0.0255, 18.6),
    ("tractor", "B adapted"): (0.045, 0.0341, 0.0062, 0.0025, 0.0108, 3.7),
}
_OVERLAP = {
    ("truck", "A adapted"): 0.920,
    ("truck", "B adapted"): 0.926,
    ("tractor", "A adapted"): 0.865,
    ("tractor", "B adapted"): 0.901,
}
REFERENCE: Mapping[tuple[str, str], Mapping[str, float]] = {
    key: dict(zip(COLUMNS, row)) | ({"IoU": _OVERLAP[key]} if key in _OVERLAP else {}) for key, row in _ROWS.items()
}

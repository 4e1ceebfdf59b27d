"""Table II of xu2023, 1000 runs: RMSE of position [m] and velocity [m/s] over the stages CV, CA, CT."""

from collections.abc import Mapping
from itertools import product

TABLE_2 = {
    "DRA(CV)": (0.33, 0.10, 0.65, 0.88, 1.78, 3.29),
    "DRA-IMM": (0.34, 0.11, 0.50, 0.48, 1.52, 2.79),
    "EDRA-IMM": (0.31, 0.08, 0.45, 0.40, 1.35, 2.34),
}
COLUMNS = tuple(f"{stage} {unit}" for stage, unit in product(("CV", "CA", "CT"), ("m", "m/s")))

# Which reading of eq. (42) and which course of the radar gave Table II is not printed: it stands beside all of them.
REFERENCE: Mapping[tuple[str, str], Mapping[str, float]] = {
    (case, f"{method}, {reading}"): dict(zip(COLUMNS, values, strict=True))
    for case, reading in (("near", "S"), ("near", "V"), ("far", "V"))
    for method, values in TABLE_2.items()
}

"""NEES of five quantities by scenario, class, view, range and age: means with intervals, and the share of outliers."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import chi2

from testbed.evaluation.intervals import Interval, bootstrap_interval
from testbed.experiments.store import Results

OUTLIER = 0.99  # probability of the chi-square limit beyond which an error counts as an outlier
MOST_OUTLIERS = 0.03
FEWEST = 100  # pairs of a group, below which it is not judged


class Quantity(NamedTuple):
    """One quantity whose covariance is judged, and the range in which its mean NEES should lie."""

    column: str
    name: str
    dof: int
    low: float
    high: float


QUANTITIES = (
    Quantity("nees_position", "position", 2, 1.5, 3.0),
    Quantity("nees_velocity", "velocity", 2, 1.5, 3.0),
    Quantity("nees_heading", "heading", 1, 0.7, 1.6),
    Quantity("nees_length", "length", 1, 0.7, 1.6),
    Quantity("nees_width", "width", 1, 0.7, 1.6),
)
BANDS: Mapping[str, tuple[tuple[float, ...], tuple[str, ...]]] = {  # column -> edges, labels
    "view": (
        (0, 15, 75, 105, 165, 181),
        ("from the front", "front corner", "from the side", "rear corner", "from behind"),
    ),
    "range": ((0, 20, 40, 80, np.inf), ("to 20 m", "20 to 40 m", "40 to 80 m", "over 80 m")),
    "age": ((0, 0.5, 1, 2, np.inf), ("to 0.5 s", "0.5 to 1 s", "1 to 2 s", "over 2 s")),
    "ends": ((0, 1, 2, 3), ("no end hit", "one end hit", "both ends hit")),
}
GROUPS = ("scenario", "class", *BANDS)


class Judged(NamedTuple):
    """One quantity in one group of pairs."""

    mean: Interval  # of the NEES over pairs, from resampled runs
    median: float
    outliers: float  # share beyond the limit
    pairs: int

    def good(self, quantity: Quantity) -> bool:
        """Whether the mean lies in its range and outliers are few."""
        return quantity.low <= self.mean.value <= quantity.high and self.outliers <= MOST_OUTLIERS


def pairs(results: Results, tracker: str) -> pd.DataFrame:
    """The pairs of one tracker, with a column for each of `GROUPS`."""
    columns = ["scenario", "tracker", "seed", "status", "kind", "range", "bearing", "age", "ends"]
    rows = results.rows([*columns, *(q.column for q in QUANTITIES)])
    rows = rows[(rows["status"] == "pair") & (rows["tracker"] == tracker)].rename(
        columns={"kind": "class", "bearing": "view"}
    )
    banded = {name: pd.cut(rows[name], edges, right=False, labels=labels) for name, (edges, labels) in BANDS.items()}
    return rows.assign(**banded)


def judge(rows: pd.DataFrame, quantity: Quantity) -> Judged:
    """The consistency of one quantity over some pairs; runs are what is drawn again for the interval."""
    values = rows[quantity.column].astype(float)
    runs = values.groupby([rows["scenario"], rows["seed"]], observed=True).agg(["sum", "count"]).to_numpy()

    def pooled(index: np.ndarray, axis: int = -1) -> np.ndarray:
        total = runs[index.astype(int)]
        return total[..., 0].sum(axis) / total[..., 1].sum(axis)

    limit = chi2.ppf(OUTLIER, quantity.dof)
    return Judged(
        bootstrap_interval([np.arange(len(runs))], pooled),
        float(values.median()),
        float((values > limit).mean()),
        len(values),
    )


def by_group(rows: pd.DataFrame, group: str) -> dict[str, dict[str, Judged]]:
    """Group -> name of the quantity -> its consistency, of groups with enough pairs."""
    found = {}
    for label, part in rows.groupby(group, observed=True):
        if len(part) >= FEWEST:
            found[str(label)] = {q.name: judge(part, q) for q in QUANTITIES}
    return found

"""The trackers in the order of their mean GOSPA, and whether each is surely behind the first of them."""

from collections.abc import Sequence

import numpy as np

from testbed.evaluation.metric import METRICS
from testbed.experiments.report.tables import Field, Grid, Line, estimate
from testbed.experiments.statistics import Cell, Change, compare, samples
from testbed.experiments.store import Results

MEASURE = "gospa"
SAID = {"worse": "behind", "better": "ahead on shared runs", "the same": "level",
        "unresolved": "not resolved", "too few seeds": "too few seeds to judge"}  # fmt: skip


def order(cells: Sequence[Cell]) -> list[Cell]:
    """The cells of the GOSPA over all runs, the least mean first; without those that have none."""
    found = [c for c in cells if c.measure == MEASURE and np.isfinite(c.mean.value)]
    return sorted(found, key=lambda c: c.mean.value)


def ranking(results: Results, cells: Sequence[Cell]) -> Grid | None:
    """Place, mean and distance to the first on the same seeds, a line a tracker; None for fewer than two of them."""
    ranked = order(cells)
    if len(ranked) < 2:
        return None
    comparison, measure = results.study, METRICS[MEASURE]
    found = samples(results.runs, MEASURE, comparison.scenarios, comparison.seeds)
    first = ranked[0].tracker
    lines = []
    for place, cell in enumerate(ranked, 1):
        behind = None if place == 1 else compare(found[cell.tracker], found[first])
        mean = estimate(cell.mean, measure.digits, mark="best" if place == 1 else "")
        lines.append(Line(cell.tracker, [Field(str(place)), mean, *_behind(behind, measure.digits)]))
    return Grid(
        f"By mean {measure.label} over all runs with 95 % intervals; behind {first}: the mean difference on the same "
        "seeds. Where that is not resolved, the seeds do not say which of the two is better.",
        "tracker",
        ["place", measure.title, f"behind {first} [{measure.unit}]", "verdict"],
        lines,
        comparison.baseline,
        words=("verdict",),
    )


def _behind(d: Change | None, digits: int) -> list[Field]:
    if d is None:
        return [Field(""), Field("first")]
    mark = d.verdict if d.verdict in ("better", "worse") else ""
    needed = f"{d.needed:.0f} seeds needed" if d.verdict == "unresolved" and np.isfinite(d.needed) else ""
    return [estimate(d.mean, digits), Field(SAID[d.verdict], remark=needed, mark=mark)]

"""What a study found, in a few sentences."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from testbed.environment.sources.substitution import GROUP_NAMES, GROUPS
from testbed.evaluation.metric import METRICS
from testbed.experiments.pairs import Attribution, Cell, Correlation


def verdict(
    together: Sequence[Cell],
    sensing: Sequence[Cell],
    shares: Sequence[Attribution],
    ranks: Sequence[Correlation],
    pairs: pd.DataFrame,
) -> list[str]:
    """Sentences: least and largest regret, collisions, sensing, the group that costs most, the error that matters.

    `together` and `sensing` are the cells of the drive score over all scenarios; pairs are those against the truth.
    """
    said = [_range(planner, [c for c in together if c.planner == planner]) for planner in _planners(together)]
    crashed = int((pairs["collisions"] > 0).sum())
    said.append(f"In {crashed} of {len(pairs)} pairs the drive on tracks ends in a collision that the truth avoids.")
    for cell in sensing:
        v = cell.change.mean
        regret = f"{0.0 - v.value:+.2f} s of the drive score{_interval(0.0 - v.high, 0.0 - v.low)}"
        said.append(f"What is in view alone costs {cell.planner} {regret}: the rest is tracking.")
    if shares:
        cost = {g: float(np.mean([-a.share[g].value for a in shares])) for g in GROUPS}
        parts = ", ".join(f"{GROUP_NAMES[g]} {cost[g]:+.2f} s" for g in sorted(cost, key=lambda g: -cost[g]))
        said.append(f"Of the regret against what is in view, on average: {parts}.")
    if ranks:
        first = ranks[0]
        label = METRICS[first.error].label
        said.append(f"The tracking error that ranks the regret best is {label} (rank correlation {first.rho:+.2f}).")
    return said


def _planners(cells: Sequence[Cell]) -> list[str]:
    return list(dict.fromkeys(c.planner for c in cells))


def _range(planner: str, cells: Sequence[Cell]) -> str:
    order = sorted(cells, key=lambda c: -c.change.mean.value)
    least, most = order[0], order[-1]
    texts = [f"{c.condition} ({-c.change.mean.value:+.2f} s{_of(c)})" for c in (least, most)]
    if least is most:
        return f"With {planner} the regret is that of {texts[0]}."
    return f"With {planner} the regret is least on {texts[0]} and largest on {texts[1]}."


def _of(cell: Cell) -> str:
    return _interval(-cell.change.mean.high, -cell.change.mean.low)


def _interval(low: float, high: float) -> str:
    return f" [{low:+.2f}, {high:+.2f}]" if np.isfinite(low) else ""

"""Held-out log-likelihood of spatial models on real detections: where the hierarchical truncated Gaussian stands.

Cross-validated by frame: the recording is cut into blocks of consecutive frames, since neighbouring frames show the
same vehicles in nearly the same place. Each model learns from the detections outside a block and their mirror images,
bin by bin, and is judged on the block as it is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.htg_tables.models import HTG_MODEL, RIVALS, VARIANTS, DensityModel, LogDensity
from studies.plus_minus import PlusMinus
from testbed.evaluation.intervals import student_limit
from testbed.learn.detections import GROWN, Progress, TrainingDetections, read
from testbed.log.text import markdown_table
from trackers.htg.learning import FLIP, LEAST, bin_index

FOLDS = 6
BLOCK = 10  # consecutive scans that count as one draw in the intervals
MOST = 2000  # detections that one bin learns from, evenly taken out
GRID = 120  # cells a side of the grown box, for the share of a density that lies inside
MODELS = (HTG_MODEL, *RIVALS, *VARIANTS)


class HeldOut(NamedTuple):
    """Log-likelihood [nat] of detections that a model was not learned from: sums over each of S scans."""

    model: DensityModel
    plain: NDArray  # (S,) of the density over the plane
    gated: NDArray  # (S,) of the density cut to the grown box and normalised there
    detections: NDArray  # (S,)


def folds(scan: NDArray, number: int) -> NDArray:
    """Fold (N,) of each detection from its scan (N,): blocks of consecutive scans, about as many in each."""
    scans = np.unique(scan)
    if len(scans) < number:
        raise ValueError(f"scan has {len(scans)} scans, cross validation needs at least {number}")
    return np.searchsorted(scans, scan) * number // len(scans)


def cross_validate(
    data: TrainingDetections,
    models: Sequence[DensityModel] = MODELS,
    number: int = FOLDS,
    progress: Progress = lambda done, total, what: None,
) -> list[HeldOut]:
    """Held-out log-likelihood of every model; detections outside the grown box are left out."""
    keep = (np.abs(data.u) < GROWN).all(-1)
    u, aspect = data.u[keep], data.aspect[keep]
    fold, (_, scan) = folds(data.scan[keep], number), np.unique(data.scan[keep], return_inverse=True)
    rows = []
    for i, model in enumerate(models):
        log_p = np.zeros((2, len(u)))
        for f in range(number):
            held = fold == f
            log_p[:, held] = judge(model, u, aspect, held)
            progress(i * number + f + 1, len(models) * number, model.name)
        plain, gated = (np.bincount(scan, x) for x in log_p)
        rows.append(HeldOut(model, plain, gated, np.bincount(scan)))
    return rows


def judge(model: DensityModel, u: NDArray, aspect: NDArray, held: NDArray) -> NDArray:
    """Log density (2, H) of the H detections under the mask held (N,), learned on the others.

    The first row is over the plane, the second normalised to the grown box.
    """
    index, twin = (bin_index(side * aspect, model.bins, model.centred) for side in (1, -1))
    z, bin_ = np.where((index > twin)[:, None], u * FLIP, u), np.minimum(index, twin)  # mirror images share a bin
    log_p = np.zeros((2, len(u)))
    for k in np.unique(bin_[held]):
        rows, own = held & (bin_ == k), ~held & (bin_ == k)
        training = np.concatenate([z[own], z[own & (index == twin)] * FLIP])
        if len(training) < LEAST:
            raise ValueError(f"bin {k} of {model.bins} has {len(training)} detections to learn from, needs {LEAST}")
        density = model.fit(training[:: -(-len(training) // MOST)])
        log_p[:, rows] = density(z[rows]) - [[0.0], [np.log(inside_share(density))]]
    return log_p[:, held]


def inside_share(density: LogDensity) -> float:
    """Probability of the grown box, by the midpoint rule."""
    side = GROWN * (2 * (np.arange(GRID) + 0.5) / GRID - 1)
    u = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    return float(np.exp(density(u)).sum()) * (2 * GROWN / GRID) ** 2


def gap(row: HeldOut, base: HeldOut, gated: bool) -> PlusMinus:
    """Mean advantage [nat] a detection of a row over the base.

    Blocks of `BLOCK` consecutive scans count as independent, scans within one do not: the interval is that of a ratio
    of sums over blocks, with Student's quantile.
    """
    difference = row.gated - base.gated if gated else row.plain - base.plain
    mean = difference.sum() / row.detections.sum()
    first = np.arange(0, len(difference), BLOCK)
    rest = np.add.reduceat(difference - mean * row.detections, first)  # (B,) sums to 0
    B = len(rest)
    spread = np.sqrt(B / (B - 1) * (rest**2).sum()) / row.detections.sum()
    return PlusMinus(float(mean), float(student_limit(spread, B - 1)))


def signed(found: PlusMinus) -> str:
    """An advantage as people read it."""
    return f"{'+' if found.value >= 0 else ''}{found.text(3)}"


def table(rows: Sequence[HeldOut]) -> str:
    """Each model, and its advantage over the first with its 95 % interval."""
    body = []
    for row in rows:
        cells = [row.model.name, str(row.model.parameters)]
        for gated in (True, False):
            mean = (row.gated if gated else row.plain).sum() / row.detections.sum()
            cells += [f"{mean:.3f}", "" if row is rows[0] else signed(gap(row, rows[0], gated))]
        body.append(tuple(cells))
    head = ("model, a bin", "parameters", "log p in the box", "minus HTG", "log p in the plane", "minus HTG")
    return markdown_table(head, body)


def compare(data: str, models: Sequence[DensityModel] = MODELS, progress: Progress = lambda *_: None) -> str:
    """One data source in markdown: what it is, and the table."""
    detections = read(data)
    inside = int((np.abs(detections.u) < GROWN).all(-1).sum())
    rows = cross_validate(detections, models, progress=progress)
    source = f"{detections.source}; {inside} detections in {len(rows[0].detections)} frames."
    return f"{source}\n\n{table(rows)}"

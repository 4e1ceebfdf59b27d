"""Held-out log-likelihood of spatial models on real detections: where the hierarchical truncated Gaussian stands.

Cross-validated by frame: the recording is cut into blocks of consecutive frames, since neighbouring frames show the
same vehicles in nearly the same place. Each model learns from the detections outside a block and their mirror images,
bin by bin, and is judged on the block as it is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.learning_data import GROWN, Detections, Progress, read
from testbed.spatial_models import HTG_MODEL, RIVALS, VARIANTS, LogDensity, SpatialModel
from trackers.htg.learning import FLIP, LEAST, bin_index

FOLDS = 6
MOST = 3000  # detections that one bin learns from, evenly taken out
GRID = 120  # cells a side of the grown box, for the share of a density that lies inside
MODELS = (HTG_MODEL, *RIVALS, *VARIANTS)


class HeldOut(NamedTuple):
    """What one model gives detections that it has not seen, F folds; [nat] mean a detection."""

    model: SpatialModel
    plain: NDArray  # (F,) of the density over the plane
    gated: NDArray  # (F,) of the density cut to the grown box and normalised there
    detections: NDArray  # (F,)


def folds(look: NDArray, number: int) -> NDArray:
    """Fold (N,) of each detection: blocks of consecutive looks with about the same number of looks."""
    looks = np.unique(look)
    if len(looks) < number:
        raise ValueError(f"look has {len(looks)} scans, cross validation needs at least {number}")
    return np.searchsorted(looks, look) * number // len(looks)


def cross_validate(
    data: Detections,
    models: Sequence[SpatialModel] = MODELS,
    number: int = FOLDS,
    progress: Progress = lambda done, total, what: None,
) -> list[HeldOut]:
    """Held-out log-likelihood of every model; detections outside the grown box are left out."""
    keep = (np.abs(data.u) < GROWN).all(-1)
    u, aspect, fold = data.u[keep], data.aspect[keep], folds(data.look[keep], number)
    rows = []
    for i, model in enumerate(models):
        parts = np.zeros((number, 2))
        for f in range(number):
            parts[f] = judge(model, u, aspect, fold == f)
            progress(i * number + f + 1, len(models) * number, model.name)
        rows.append(HeldOut(model, parts[:, 0], parts[:, 1], np.bincount(fold, minlength=number)))
    return rows


def judge(model: SpatialModel, u: NDArray, aspect: NDArray, held: NDArray) -> tuple[float, float]:
    """Mean log density of the held (N,) detections, plain and normalised to the grown box, learned on the others."""
    index, twin = (bin_index(side * aspect, model.bins, model.centred) for side in (1, -1))
    z, bin_ = np.where((index > twin)[:, None], u * FLIP, u), np.minimum(index, twin)  # mirror images share a bin
    plain, gated = np.zeros(len(u)), np.zeros(len(u))
    for k in np.unique(bin_[held]):
        rows, own = held & (bin_ == k), ~held & (bin_ == k)
        training = np.concatenate([z[own], z[own & (index == twin)] * FLIP])
        if len(training) < LEAST:
            raise ValueError(f"bin {k} of {model.bins} has {len(training)} detections to learn from, needs {LEAST}")
        density = model.fit(training[:: -(-len(training) // MOST)])
        plain[rows] = density(z[rows])
        gated[rows] = plain[rows] - np.log(inside_share(density))
    return float(plain[held].mean()), float(gated[held].mean())


def inside_share(density: LogDensity) -> float:
    """Probability of the grown box, by the midpoint rule."""
    side = GROWN * (2 * (np.arange(GRID) + 0.5) / GRID - 1)
    u = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    return float(np.exp(density(u)).sum()) * (2 * GROWN / GRID) ** 2


def table(rows: Sequence[HeldOut]) -> list[str]:
    """Lines of markdown: each model, and its mean advantage over the HTG with the standard error over the folds."""
    lines = [
        "| model, a bin | parameters | log p | minus HTG | log p in the box | minus HTG |",
        "|---|---|---|---|---|---|",
    ]
    first = rows[0]
    for row in rows:
        cells = [row.model.name, str(row.model.parameters)]
        for got, base in ((row.plain, first.plain), (row.gated, first.gated)):
            cells += [
                f"{np.average(got, weights=row.detections):.3f}",
                "" if row is first else _gap(got - base, row.detections),
            ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _gap(difference: NDArray, count: NDArray) -> str:
    mean = np.average(difference, weights=count)
    spread = np.sqrt(np.average((difference - mean) ** 2, weights=count) / (len(count) - 1))
    return f"{mean:+.3f} ± {spread:.3f}"


def compare(data: str, models: Sequence[SpatialModel] = MODELS, progress: Progress = lambda *_: None) -> list[str]:
    """Markdown about one data source: what it is, and the table."""
    detections = read(data)
    inside = int((np.abs(detections.u) < GROWN).all(-1).sum())
    looks = len(np.unique(detections.look))
    rows = cross_validate(detections, models, progress=progress)
    return [f"{detections.source}; {inside} detections in {looks} scans.", "", *table(rows), ""]

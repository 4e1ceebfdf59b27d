"""Whether tracks keep their objects: HOTA, and MOTA and IDF1 as the library motmetrics has them.

Luiten et al. (2021); Bernardin, Stiefelhagen (2008); Ristani et al. (2016). All three take the same scans: objects that
count, reported tracks without those that are assigned to an object that does not count, and the rooted Gaussian
Wasserstein distance d with GOSPA's cut-off c = 5 m, beyond which nothing belongs together. The similarity that HOTA
needs is 1 - d/c. Definitions: docs/methods/metrics.md, "Identities".
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.metrics import CUTOFF

ALPHAS = np.arange(0.05, 0.99, 0.05)  # thresholds of the similarity


class Meeting(NamedTuple):
    """N objects that count and T tracks at one scan."""

    object: NDArray  # (N,) ids
    track: NDArray  # (T,) ids
    near: NDArray  # (K, 2) int, row and column of all pairs within the cut-off
    distance: NDArray  # (K,) [m] rooted Gaussian Wasserstein distance of these

    @property
    def distances(self) -> NDArray:
        """Distances (N, T) [m], inf beyond the cut-off."""
        found = np.full((len(self.object), len(self.track)), np.inf)
        found[*self.near.T] = self.distance
        return found


def meeting(objects: NDArray, tracks: NDArray, distance: NDArray) -> Meeting:
    """The scan of objects (N,) and tracks (T,), ids, at distances (N, T) [m]."""
    near = np.argwhere(distance < CUTOFF)
    return Meeting(objects, tracks, near, distance[*near.T])


def hota(scans: Sequence[Meeting]) -> float:
    """Higher order tracking accuracy, Luiten et al. (2021), in [0, 1]; NaN without an object."""
    from scipy.optimize import linear_sum_assignment  # not at the top: a third of the start of a run without metrics

    objects, tracks = (_index([scan[i] for scan in scans]) for i in (0, 1))
    if not objects:
        return np.nan
    rows = [np.array([objects[i] for i in scan.object.tolist()], int) for scan in scans]
    columns = [np.array([tracks[i] for i in scan.track.tolist()], int) for scan in scans]
    similar = [np.maximum(0.0, 1.0 - scan.distances / CUTOFF) for scan in scans]
    shape = len(objects), len(tracks)
    seen, reported, together = np.zeros(shape[0]), np.zeros(shape[1]), np.zeros(shape)
    for row, column, s in zip(rows, columns, similar, strict=True):
        seen[row] += 1
        reported[column] += 1
        both = s.sum(0) + s.sum(1)[:, None] - s
        together[np.ix_(row, column)] += np.divide(s, both, out=np.zeros_like(s), where=both > 0)
    likely = together / np.maximum(1e-12, seen[:, None] + reported - together)  # how well two fit over the whole run
    pairs = []  # object, track and similarity of every assigned pair
    for row, column, s in zip(rows, columns, similar, strict=True):
        i, j = linear_sum_assignment(likely[np.ix_(row, column)] * s, maximize=True)
        pairs.append(np.stack([row[i], column[j], s[i, j]]))
    return float(np.mean([_at(alpha, np.concatenate(pairs, 1), seen, reported) for alpha in ALPHAS]))  # (MET.33)


def _at(alpha: float, pairs: NDArray, seen: NDArray, reported: NDArray) -> float:
    """HOTA at one threshold, of assigned pairs (3, K) and the numbers of scans of each object and of each track."""
    row, column = pairs[:2, pairs[2] >= alpha - 1e-12].astype(int)
    of, which, count = np.unique(np.stack([row, column]), axis=1, return_inverse=True, return_counts=True)
    association = (count / (seen[of[0]] + reported[of[1]] - count))[which]  # of each true pair, (MET.34)
    return float(np.sqrt(association.sum() / (seen.sum() + reported.sum() - len(row))))


def clear(scans: Sequence[Meeting]) -> dict[str, float]:
    """`mota` and `idf1` by motmetrics, which must be installed; NaN without an object."""
    names = ("mota", "idf1")
    if not any(len(scan.object) for scan in scans):
        return dict.fromkeys(names, np.nan)
    import motmetrics  # pandas comes with it

    accumulator = motmetrics.MOTAccumulator(auto_id=True)
    for scan in scans:
        distance = np.where(np.isfinite(scan.distances), scan.distances, np.nan)
        accumulator.update(scan.object.tolist(), scan.track.tolist(), distance)
    found = motmetrics.metrics.create().compute(accumulator, metrics=list(names), return_dataframe=False)
    return {name: float(found[name]) for name in names}  # (MET.35)


def _index(ids: Sequence[NDArray]) -> dict[int, int]:
    known = np.unique(np.concatenate([np.zeros(0, int), *ids]))
    return {key: place for place, key in enumerate(known.tolist())}

"""Length errors against the visible share of a vehicle, to show whether tracks shrink to what is seen.

Only vehicles that count for `Evaluator` are taken, in every frame. A track whose box is too far from the vehicle's, 5 m
in Gaussian Wasserstein distance, is not assigned to it: such a frame gives no error, but lowers the share of frames
with a track that fits. So the errors and that share have to be read together.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.metrics import rmse
from testbed.evaluation.tracking import Evaluator
from testbed.experiments.series import EDGES, LABELS
from testbed.frame import Frame

FEWEST = 30  # frames with a track that an average needs


class LengthSamples(NamedTuple):
    """n vehicles, each in one frame, and the length that one tracker estimates."""

    visible: NDArray  # (n,) share of the outline facing the sensors that others do not hide
    length: NDArray  # (n,) [m]
    error: NDArray  # (n,) [m] estimated minus true length, NaN without a track that fits


class Profile(NamedTuple):
    """Averages in the bins of visible share, (B,) each; NaN where there are fewer than FEWEST frames."""

    mean: NDArray  # [m]
    rms: NDArray  # [m]
    held: NDArray  # share of frames with a track that fits
    frames: NDArray  # int


class LengthErrors:
    """Observer of a `TrackedEnv` that keeps the length errors of some trackers."""

    def __init__(self, trackers: Sequence[str]) -> None:
        self.evaluators = {name: Evaluator(name) for name in trackers}
        self._rows: dict[str, list[NDArray]] = {name: [np.zeros((0, 3))] for name in trackers}

    def __call__(self, frame: Frame) -> None:
        """Keep the errors of one frame."""
        objects, origin = frame.scene.objects, frame.origin
        for name, evaluator in self.evaluators.items():
            tracks, _ = frame.outputs[name]
            score = evaluator.step(frame.time, frame.scene, origin, tracks)
            counted = np.isin(objects.id, score.counted)
            error = [score.errors[i]["length"] if i in score.errors else np.nan for i in objects.id[counted].tolist()]
            self._rows[name].append(np.stack([origin.visible[counted], objects.size[counted, 0], error], -1))

    @property
    def samples(self) -> dict[str, LengthSamples]:
        """All frames so far, by tracker."""
        return {name: LengthSamples(*np.concatenate(rows).T) for name, rows in self._rows.items()}


def profile(samples: LengthSamples) -> Profile:
    """Averages by visible share."""
    bins = np.searchsorted(EDGES, samples.visible)
    held = np.isfinite(samples.error)
    rows = []
    for k in range(len(LABELS)):
        error, frames = samples.error[held & (bins == k)], int((bins == k).sum())
        enough = len(error) >= FEWEST
        rows.append(
            (
                error.mean() if enough else np.nan,
                rmse(error) if enough else np.nan,
                len(error) / frames if frames >= FEWEST else np.nan,
                frames,
            )
        )
    mean, rms, share, count = np.array(rows).T
    return Profile(mean, rms, share, count.astype(int))

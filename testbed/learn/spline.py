"""`testbed learn-spline`: from detections to a contour of ellipses on a B-spline, with its provenance.

The data are those of `testbed learn-htg`, see `testbed.learn.detections`.
"""

import shlex
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Table

from testbed.command_line.tables import light_table
from testbed.files import write_json
from testbed.learn.detections import Progress, TrainingDetections, check_source, read, without_folders
from testbed.learn.htg import PACKAGES, check_out
from trackers.pmht import model as models
from trackers.pmht.model import SplineModel
from trackers.pmht.offline import LabelledDetections, LearnedContour, OfflineLearning

FEW = 20  # detections of an ellipse, below which its place is hardly known


@dataclass(frozen=True)
class SplineConfig:
    """Settings of `learn`."""

    data: str  # see `testbed.learn.detections`
    count: int = 20000  # detections of the sampler
    seed: int = 0  # of the sampler
    options: OfflineLearning = field(default_factory=OfflineLearning)

    def __post_init__(self) -> None:
        if not isinstance(self.options, OfflineLearning):
            raise ValueError(
                f"options must be OfflineLearning, got {self.options!r}; leave it out for those of a command"
            )
        check_source(self.data, self.count, self.seed)

    def command(self, out: str | Path) -> str:
        """The command line that does the same, where the data lie."""
        words = ["testbed", "learn-spline", without_folders(self.data), "--out", Path(out).name]
        default = SplineConfig(self.data)
        for name in ("count", "seed"):
            if getattr(self, name) != getattr(default, name):
                words += [f"--{name}", str(getattr(self, name))]
        for name in ("ellipses", "points", "visibility"):
            if getattr(self.options, name) != getattr(default.options, name):
                words += [f"--{name}", str(getattr(self.options, name))]
        words += [] if self.options.mirrored else ["--no-mirror"]
        return shlex.join(words)


class LearnedModel(NamedTuple):
    """A learned model, what it was learned from, and where it was written."""

    model: SplineModel
    learned: LearnedContour
    detections: TrainingDetections
    path: Path


def learn(config: SplineConfig, out: str | Path, progress: Progress = lambda done, total, what: None) -> LearnedModel:
    """Read the detections, fit the contour, write it to `out` (.json).

    Raises ValueError or LookupError, in one sentence, for data that cannot be read or are too few.
    """
    path = Path(out)
    check_out(path)
    detections = read(config.data, config.count, config.seed, progress)
    if len(detections.u) < 10 * config.options.ellipses:
        raise ValueError(
            f"data: {config.data} has {len(detections.u)} detections of that class, too few for "
            f"{config.options.ellipses} ellipses; take more data or fewer --ellipses"
        )
    model, learned = fit(detections, config.options, path.stem, progress)
    write_json(path, models.as_json(model, provenance(config, detections, learned, path)))
    return LearnedModel(model, learned, detections, path)


def fit(
    detections: TrainingDetections,
    options: OfflineLearning,
    name: str = "unnamed",
    progress: Progress = lambda *_: None,
) -> tuple[SplineModel, LearnedContour]:
    """The model of some detections."""
    size = np.array([4.6, 1.86]) if detections.size is None else detections.size.mean(0)
    noise = np.zeros((len(detections.u), 2, 2)) if detections.noise is None else detections.noise / 4
    data = LabelledDetections(detections.u / 2, noise, np.pi - detections.aspect)  # their unit box is [-1, 1]^2
    learned = options.run(data, size, lambda done, total: progress(done, total, f"fitting {name}"))
    length, width = (round(float(x), 3) for x in size)
    return SplineModel.of(name, *learned.contour, (length, width), round(learned.interior, 4)), learned


def provenance(
    config: SplineConfig, detections: TrainingDetections, learned: LearnedContour, out: Path
) -> dict[str, Any]:
    """Where the numbers of a model come from, as flat JSON."""
    return {
        "command": config.command(out),
        "data": detections.source,
        "noise": "part of the spread" if detections.noise is None else "data sheet taken out of the spread",
        "detections": len(detections.u),
        "looks": len(np.unique(detections.scan)),
        "counts": [round(float(c)) for c in learned.counts],
        "log_likelihood": round(float(learned.log_likelihood[-1]), 4),
        "options": asdict(config.options),
        "versions": {name: version(name) for name in PACKAGES},
    }


def report(learned: LearnedModel) -> list[Table | str]:
    """The model, one row an ellipse, and lines below it: source, size, cautions."""
    grid = light_table(learned.path.stem)
    for title in ("ellipse", "detections", "x m", "y m", "std along m", "std across m"):
        grid.add_column(title, justify="right", no_wrap=True)
    size = np.array(learned.model.size)
    std = np.sqrt(np.diagonal(learned.model.Sigma, axis1=-2, axis2=-1)) * size
    for l, (at, s, count) in enumerate(zip(learned.model.mu * size, std, learned.learned.counts, strict=True)):
        grid.add_row(str(l), f"{count:.0f}", *(f"{x:.2f}" for x in (*at, *s)))
    source = learned.detections.source
    lines = [
        f"learned from {len(learned.detections.u)} detections: {source}",
        f"typical size {size[0]:.2f} x {size[1]:.2f} m; {learned.model.interior:.0%} of the detections from inside",
    ]
    few = np.flatnonzero(learned.learned.counts < FEW)
    if len(few):
        lines.append(f"caution: ellipses {', '.join(map(str, few))} have fewer than {FEW} detections and stay put")
    return [grid, *map(escape, lines)]

"""`testbed learn-htg` and `learn-spline`: from detections to a model in a JSON file, with its provenance.

A table of hierarchical truncated Gaussians is read by `trackers.htg.bins.load`, a contour of ellipses on a B-spline by
`trackers.pmht.model.load`. Where the numbers come from, and cautions about them, stand under `provenance`, which no
filter reads.
"""

import os
import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Table

from testbed.command_line.tables import light_table
from testbed.files import check_target, make_directory, write_json
from testbed.learn.detections import Progress, TrainingDetections, check_source, read, without_folders
from testbed.limits import check_whole
from trackers.htg import bins as tables
from trackers.htg.bins import HTGTable
from trackers.htg.density import log_mass
from trackers.htg.learning import FitOptions, TableFit, fit_table
from trackers.pmht import model as splines
from trackers.pmht.model import SplineModel
from trackers.pmht.offline import LabelledDetections, LearnedContour, OfflineLearning

PACKAGES = ("eot-testbed", "numpy", "scipy")
MOST_BINS = 360  # one a degree
COLUMNS = ("aspect", "number", "log p", "rho", "a1", "a2", "b1", "b2", "theta", "r1", "r2", "c_D")
ADVICE = (
    "A bin with few detections wants more data or fewer --bins. A side at its limit is open. Next to no c_D suits "
    "htg-map; htg-rm-learned needs --mass-min 0.25. See docs/learning.md."
)
FEW = 20  # detections of an ellipse, below which its place is hardly known
TYPICAL = np.array([4.6, 1.86])  # [m] where the data have no sizes


class LearnedTable(NamedTuple):
    """A learned table, what it was learned from, and where it was written."""

    fit: TableFit
    detections: TrainingDetections
    path: Path

    def report(self) -> list[Table | str]:
        """The table within 80 columns, one row a bin, and lines below it: source, legend, cautions."""
        fit, detections = self.fit, self.detections
        grid = light_table(self.path.stem)
        grid.padding, grid.pad_edge = (0, 0), False
        for title in COLUMNS:
            grid.add_column(escape(title), justify="right", no_wrap=True)
        p, degrees = fit.table.p, np.rad2deg(fit.table.centres)
        for k, mass in enumerate(masses(fit.table)):
            grid.add_row(
                f"{degrees[k]:+.0f}",
                str(fit.counts[k]),
                f"{fit.log_likelihood[k]:.3f}",
                f"{p.rho[k]:.3f}",
                *(f"{x:.2f}" for x in p.bounds[k]),
                f"{np.rad2deg(p.theta[k]):+.0f}",
                *(f"{x:.4f}" for x in p.r[k]),
                f"{mass:.1g}",
            )
        length, width = np.asarray(fit.table.size)
        legend = (
            f"learned from {len(detections.u)} detections: {detections.source}",
            f"typical size {length:.2f} x {width:.2f} m" + (", taken for granted" if detections.size is None else ""),
            "aspect and theta in degrees, 0 where the rear is seen; log p: mean [nat] a detection, mirror images "
            "included; a1 rear, a2 right, b1 front, b2 left; c_D: share of the source outside the box",
        )
        return [grid, *map(escape, (*legend, *cautions(fit)))]


class LearnedSpline(NamedTuple):
    """A learned contour, what it was learned from, and where it was written."""

    model: SplineModel
    learned: LearnedContour
    detections: TrainingDetections
    path: Path

    def report(self) -> list[Table | str]:
        """The model, one row an ellipse, and lines below it: source, size, cautions."""
        grid = light_table(self.path.stem)
        for title in ("ellipse", "detections", "x m", "y m", "std along m", "std across m"):
            grid.add_column(title, justify="right", no_wrap=True)
        size, counts = np.array(self.model.size), self.learned.counts
        std = np.sqrt(np.diagonal(self.model.Sigma, axis1=-2, axis2=-1)) * size
        for l, (at, s, count) in enumerate(zip(self.model.mu * size, std, counts, strict=True)):
            grid.add_row(str(l), f"{count:.0f}", *(f"{x:.2f}" for x in (*at, *s)))
        lines = [
            f"learned from {len(self.detections.u)} detections: {self.detections.source}",
            f"typical size {size[0]:.2f} x {size[1]:.2f} m; {self.model.interior:.0%} of the detections from inside",
        ]
        few = np.flatnonzero(counts < FEW)
        if len(few):
            lines.append(f"caution: ellipses {', '.join(map(str, few))} have fewer than {FEW} detections and stay put")
        return [grid, *map(escape, lines)]


@dataclass(frozen=True)
class TableConfig:
    """Settings of `learn` for a table."""

    data: str  # see `testbed.learn.detections`
    bins: int = 8
    centred: bool = True  # 0 and pi in the middle of a bin
    mirrored: bool = True  # each bin also learns from the mirror image of its opposite
    mass_min: float = 0.0  # least c_D; 0.1 to 0.25 for filters that use pseudo-measurements
    count: int = 60000  # detections of the sampler
    seed: int = 0  # of the sampler

    def __post_init__(self) -> None:
        check_whole("bins", self.bins, 1, MOST_BINS)
        check_source(self.data, self.count, self.seed)
        if not isinstance(self.mass_min, Real):
            raise ValueError(f"mass_min must be a number within 0 and 1, got {self.mass_min!r}; it is a probability")
        self.options  # noqa: B018  raises for a mass_min that is none

    @property
    def options(self) -> FitOptions:
        """Limits of each fit."""
        return FitOptions(mass_min=self.mass_min)

    def command(self, out: str | Path) -> str:
        """The command line that does the same, where the data lie."""
        words = options_of(self, TableConfig(self.data), "bins", "mass_min", "count", "seed")
        words += [] if self.centred else ["--edges"]
        return command_line("learn-htg", self.data, out, words, self.mirrored)

    def learn(self, detections: TrainingDetections, path: Path, progress: Progress) -> LearnedTable:
        """One density an aspect bin, written to `path`, with the mean size of the vehicles where that is known."""
        if len(detections.u) == 0:
            raise ValueError(f"data: {self.data} has no detection of that class; choose :car or :truck")
        fit = fit_table(
            detections.u,
            detections.aspect,
            detections.noise,
            bins=self.bins,
            centred=self.centred,
            mirrored=self.mirrored,
            options=self.options,
            name=path.stem,
            progress=lambda done, total: progress(done, total, f"fitting {path.stem}"),
        )
        if detections.size is not None:
            length, width = (round(float(x), 3) for x in detections.size.mean(0))
            fit = fit._replace(table=replace(fit.table, size=(length, width)))
        facts = {
            "counts": fit.counts.tolist(),
            "log_likelihood": [round(float(x), 4) for x in fit.log_likelihood],
            "mass": [float(f"{x:.3g}") for x in masses(fit.table)],
            "warnings": {str(k): list(w) for k, w in enumerate(fit.warnings) if w},
        }
        write_json(path, tables.as_json(fit.table, provenance(self, detections, path, "r", facts)))
        return LearnedTable(fit, detections, path)


@dataclass(frozen=True)
class SplineConfig:
    """Settings of `learn` for a contour."""

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
        words = options_of(self, SplineConfig(self.data), "count", "seed")
        words += options_of(self.options, OfflineLearning(), "ellipses", "points", "visibility")
        return command_line("learn-spline", self.data, out, words, self.options.mirrored)

    def learn(self, detections: TrainingDetections, path: Path, progress: Progress) -> LearnedSpline:
        """The contour, written to `path`."""
        if len(detections.u) < 10 * self.options.ellipses:
            raise ValueError(
                f"data: {self.data} has {len(detections.u)} detections of that class, too few for "
                f"{self.options.ellipses} ellipses; take more data or fewer --ellipses"
            )
        model, learned = fit_spline(detections, self.options, path.stem, progress)
        facts = {
            "counts": [round(float(c)) for c in learned.counts],
            "log_likelihood": round(float(learned.log_likelihood[-1]), 4),
        }
        write_json(path, splines.as_json(model, provenance(self, detections, path, "the spread", facts)))
        return LearnedSpline(model, learned, detections, path)


def learn(
    config: TableConfig | SplineConfig, out: str | Path, progress: Progress = lambda done, total, what: None
) -> LearnedTable | LearnedSpline:
    """Read the detections, fit the table or the contour, write it to `out` (.json).

    Raises ValueError or LookupError, in one sentence, for data that cannot be read or are too few.
    """
    path = Path(out)
    if path.suffix != ".json":
        raise ValueError(f"out must be a .json file, got {path}")
    check_target(path)
    make_directory(path.parent)
    if path.exists() and not os.access(path, os.W_OK):
        raise ValueError(f"out: {path} is write-protected; choose another file")
    return config.learn(read(config.data, config.count, config.seed, progress), path, progress)


def fit_spline(
    detections: TrainingDetections,
    options: OfflineLearning,
    name: str = "unnamed",
    progress: Progress = lambda *_: None,
) -> tuple[SplineModel, LearnedContour]:
    """The contour of some detections."""
    size = TYPICAL if detections.size is None else detections.size.mean(0)
    noise = np.zeros((len(detections.u), 2, 2)) if detections.noise is None else detections.noise / 4
    data = LabelledDetections(detections.u / 2, noise, np.pi - detections.aspect)  # their unit box is [-1, 1]^2
    learned = options.run(data, size, lambda done, total: progress(done, total, f"fitting {name}"))
    length, width = (round(float(x), 3) for x in size)
    return SplineModel.of(name, *learned.contour, (length, width), round(learned.interior, 4)), learned


def options_of(config: Any, default: Any, *names: str) -> list[str]:
    """Options of a command line for the fields of a record that are not as in another."""
    found: list[str] = []
    for name in names:
        if getattr(config, name) != getattr(default, name):
            found += [f"--{name.replace('_', '-')}", str(getattr(config, name))]
    return found


def command_line(command: str, data: str, out: str | Path, options: Sequence[str], mirrored: bool) -> str:
    """The command in one line, without the folders of one machine."""
    words = ["testbed", command, without_folders(data), "--out", Path(out).name, *options]
    return shlex.join(words if mirrored else [*words, "--no-mirror"])


def provenance(
    config: TableConfig | SplineConfig, detections: TrainingDetections, out: Path, rest: str, facts: dict[str, Any]
) -> dict[str, Any]:
    """Where the numbers of a model come from, as flat JSON; `rest` is what holds noise that is not known."""
    return {
        "command": config.command(out),
        "data": detections.source,
        "noise": f"part of {rest}" if detections.noise is None else f"data sheet taken out of {rest}",
        "detections": len(detections.u),
        "looks": len(np.unique(detections.scan)),
        **facts,
        "options": asdict(config.options),
        "versions": {name: version(name) for name in PACKAGES},
    }


def masses(table: HTGTable) -> Sequence[float]:
    """c_D of each bin: the share of the source that lies outside the box."""
    return np.exp(log_mass(table.p)).tolist()


def cautions(fit: TableFit) -> list[str]:
    """Lines of warnings, each with the aspects [deg] of its bins, and of advice, if there are any."""
    where: dict[str, list[str]] = {}
    for middle, warnings in zip(np.rad2deg(fit.table.centres), fit.warnings, strict=True):
        for text in warnings:
            where.setdefault(text, []).append(f"{middle:+.0f}")
    lines = [f"caution, aspect {', '.join(aspects)}: {text}" for text, aspects in where.items()]
    return [*lines, ADVICE] if lines else []

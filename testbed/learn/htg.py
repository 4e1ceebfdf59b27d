"""`testbed learn-htg`: from detections to a table of hierarchical truncated Gaussians, with its provenance.

The JSON is read by `trackers.htg.bins.load`; where the numbers come from, and cautions about them, stand under
`provenance`, which no filter reads.
"""

import os
import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
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

PACKAGES = ("eot-testbed", "numpy", "scipy")
MOST_BINS = 360  # one a degree
COLUMNS = ("aspect", "number", "log p", "rho", "a1", "a2", "b1", "b2", "theta", "r1", "r2", "c_D")
ADVICE = (
    "A bin with few detections wants more data or fewer --bins. A side at its limit is open. Next to no c_D suits "
    "htg-map; htg-rm-learned needs --mass-min 0.25. See docs/learning.md."
)


@dataclass(frozen=True)
class LearnConfig:
    """Settings of `learn`."""

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
        default = LearnConfig(self.data)
        words = ["testbed", "learn-htg", without_folders(self.data), "--out", Path(out).name]
        for name in ("bins", "mass_min", "count", "seed"):
            if getattr(self, name) != getattr(default, name):
                words += [f"--{name.replace('_', '-')}", f"{getattr(self, name):g}"]
        words += [] if self.centred else ["--edges"]
        words += [] if self.mirrored else ["--no-mirror"]
        return shlex.join(words)


class LearnedTable(NamedTuple):
    """A learned table, what it was learned from, and where it was written."""

    fit: TableFit
    detections: TrainingDetections
    path: Path


def learn(config: LearnConfig, out: str | Path, progress: Progress = lambda done, total, what: None) -> LearnedTable:
    """Read the detections, fit one density an aspect bin, write the table to `out` (.json).

    Raises ValueError or LookupError, in one sentence, for data that cannot be read or are too few.
    """
    path = Path(out)
    check_out(path)
    detections = read(config.data, config.count, config.seed, progress)
    if len(detections.u) == 0:
        raise ValueError(f"data: {config.data} has no detection of that class; choose :car or :truck")
    fit = learn_table(detections, config, path.stem, progress)
    write_json(path, tables.as_json(fit.table, provenance(config, detections, fit, path)))
    return LearnedTable(fit, detections, path)


def check_out(path: Path) -> None:
    """Raise ValueError or OSError, in one sentence, where a table cannot be written; nothing is written yet."""
    if path.suffix != ".json":
        raise ValueError(f"out must be a .json file, got {path}")
    check_target(path)
    make_directory(path.parent)
    if path.exists() and not os.access(path, os.W_OK):
        raise ValueError(f"out: {path} is write-protected; choose another file")


def learn_table(
    detections: TrainingDetections, config: LearnConfig, name: str = "unnamed", progress: Progress = lambda *_: None
) -> TableFit:
    """The table of some detections, with the mean size of the vehicles where that is known."""
    fit = fit_table(
        detections.u,
        detections.aspect,
        detections.noise,
        bins=config.bins,
        centred=config.centred,
        mirrored=config.mirrored,
        options=config.options,
        name=name,
        progress=lambda done, total: progress(done, total, f"fitting {name}"),
    )
    if detections.size is None:
        return fit
    length, width = (round(float(x), 3) for x in detections.size.mean(0))
    return fit._replace(table=replace(fit.table, size=(length, width)))


def provenance(config: LearnConfig, detections: TrainingDetections, fit: TableFit, out: Path) -> dict[str, Any]:
    """Where the numbers of a table come from, as flat JSON."""
    return {
        "command": config.command(out),
        "data": detections.source,
        "noise": "part of r" if detections.noise is None else "data sheet taken out of r",
        "detections": len(detections.u),
        "looks": len(np.unique(detections.scan)),
        "counts": fit.counts.tolist(),
        "log_likelihood": [round(float(x), 4) for x in fit.log_likelihood],
        "mass": [float(f"{x:.3g}") for x in masses(fit.table)],
        "warnings": {str(k): list(w) for k, w in enumerate(fit.warnings) if w},
        "options": asdict(config.options),
        "versions": {name: version(name) for name in PACKAGES},
    }


def masses(table: HTGTable) -> Sequence[float]:
    """c_D of each bin: the share of the source that lies outside the box."""
    return np.exp(log_mass(table.p)).tolist()


def report(learned: LearnedTable) -> list[Table | str]:
    """The table within 80 columns, one row a bin, and lines below it: source, legend, cautions."""
    fit, source = learned.fit, learned.detections.source
    grid = light_table(learned.path.stem)
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
        f"learned from {len(learned.detections.u)} detections: {source}",
        f"typical size {length:.2f} x {width:.2f} m"
        + (", taken for granted" if learned.detections.size is None else ""),
        "aspect and theta in degrees, 0 where the rear is seen; log p: mean [nat] a detection, mirror images included; "
        "a1 rear, a2 right, b1 front, b2 left; c_D: share of the source outside the box",
    )
    return [grid, *map(escape, (*legend, *cautions(fit)))]


def cautions(fit: TableFit) -> list[str]:
    """Lines of warnings, each with the aspects [deg] of its bins, and of advice, if there are any."""
    where: dict[str, list[str]] = {}
    for middle, warnings in zip(np.rad2deg(fit.table.centres), fit.warnings, strict=True):
        for text in warnings:
            where.setdefault(text, []).append(f"{middle:+.0f}")
    lines = [f"caution, aspect {', '.join(aspects)}: {text}" for text, aspects in where.items()]
    return [*lines, ADVICE] if lines else []

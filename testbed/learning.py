"""`testbed learn-htg`: from detections to a table of hierarchical truncated Gaussians, with its provenance.

The JSON is read by `trackers.htg.bins.load`; what no filter needs, where the numbers come from and how far to trust
them, stands under `provenance`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table

from testbed.learning_data import Detections, Progress, read
from testbed.recorder import make_directory
from trackers.htg import bins as tables
from trackers.htg.bins import HTGTable
from trackers.htg.density import log_mass
from trackers.htg.learning import FitOptions, TableFit, fit_table

PACKAGES = ("eot-testbed", "numpy", "scipy")


@dataclass(frozen=True)
class LearnConfig:
    """What `learn` varies."""

    data: str  # see `testbed.learning_data`
    bins: int = 8
    centred: bool = True  # 0 and pi in the middle of a bin
    mirrored: bool = True  # each bin also learns from the mirror image of its opposite
    mass_min: float = 0.0  # least c_D; 0.1 to 0.25 for filters that use pseudo-measurements
    count: int = 60000  # detections of the sampler
    seed: int = 0  # of the sampler

    def __post_init__(self) -> None:
        if self.bins < 1:
            raise ValueError(f"bins must be at least 1, got {self.bins}")
        self.options  # noqa: B018  raises for a mass_min that is none

    @property
    def options(self) -> FitOptions:
        """Limits of each fit."""
        return FitOptions(mass_min=self.mass_min)

    def command(self, out: str | Path) -> str:
        """The command line that does the same."""
        default = LearnConfig(self.data)
        words = ["testbed", "learn-htg", self.data, "--out", Path(out).name]
        for name in ("bins", "mass_min", "count", "seed"):
            if getattr(self, name) != getattr(default, name):
                words += [f"--{name.replace('_', '-')}", f"{getattr(self, name):g}"]
        words += [] if self.centred else ["--edges"]
        words += [] if self.mirrored else ["--no-mirror"]
        return " ".join(words)


class Learned(NamedTuple):
    """A learned table, what it was learned from, and where it was written."""

    fit: TableFit
    detections: Detections
    path: Path


def learn(config: LearnConfig, out: str | Path, progress: Progress = lambda done, total, what: None) -> Learned:
    """Read the detections, fit one density an aspect bin, write the table to `out` (.json).

    Raises ValueError or LookupError, in one sentence, for data that cannot be read or are too few.
    """
    path = Path(out)
    if path.suffix != ".json":
        raise ValueError(f"out must be a .json file, got {path}")
    make_directory(path.parent)
    detections = read(config.data, config.count, config.seed, progress)
    if len(detections.u) == 0:
        raise ValueError(f"data: {config.data} has no detection of that class; choose :car or :truck")
    fit = learn_table(detections, config, path.stem, progress)
    tables.save(fit.table, path, provenance(config, detections, fit, path))
    return Learned(fit, detections, path)


def learn_table(
    detections: Detections, config: LearnConfig, name: str = "unnamed", progress: Progress = lambda *_: None
) -> TableFit:
    """The table of some detections."""
    return fit_table(
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


def provenance(config: LearnConfig, detections: Detections, fit: TableFit, out: Path) -> dict[str, Any]:
    """Where the numbers of a table come from, as flat JSON."""
    return {
        "command": config.command(out),
        "data": detections.source,
        "noise": "part of r" if detections.noise is None else "data sheet taken out of r",
        "detections": len(detections.u),
        "looks": len(np.unique(detections.look)),
        "counts": fit.counts.tolist(),
        "log_likelihood": [round(float(x), 4) for x in fit.log_likelihood],
        "mass": [float(f"{x:.3g}") for x in masses(fit.table)],
        "warnings": {str(k): list(w) for k, w in enumerate(fit.warnings) if w},
        "options": asdict(config.options),
        "versions": {name: version(name) for name in PACKAGES},
    }


def masses(table: HTGTable) -> Sequence[float]:
    """Return c_D of each bin: the share of the source that lies outside the box."""
    return np.exp(log_mass(table.p)).tolist()


def report(learned: Learned) -> Table:
    """One row a bin: where it looks from, how much it has seen, what it found."""
    fit = learned.fit
    grid = Table(title=f"{learned.path.stem}: {learned.detections.source}")
    for title in ("aspect", "detections", "log p", "rho", "a1", "a2", "b1", "b2", "theta", "r1", "r2", "c_D", "doubts"):
        grid.add_column(title, justify="left" if title in ("aspect", "doubts") else "right")
    p, B = fit.table.p, len(fit.table)
    for k in range(B):
        middle = -180.0 + 360.0 / B * (k + 0.5 * (not fit.table.centred))
        numbers = [p.rho[k], *p.bounds[k], p.theta[k], *p.r[k]]
        cells = [f"{x:.3f}" for x in numbers]
        grid.add_row(
            f"{middle:+.0f} deg",
            str(fit.counts[k]),
            f"{fit.log_likelihood[k]:.3f}",
            *cells,
            f"{masses(fit.table)[k]:.2g}",
            "; ".join(fit.warnings[k]),
        )
    return grid

"""Depth profiles of sensors, learned from detections of known vehicles: `python -m testbed.learn.profile`.

Each profile is also scored on the detections of all others: what the profile of another radar costs.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from testbed.files import write_json
from testbed.learn.detections import TrainingDetections, read
from trackers.geometry import unit
from trackers.scan import DepthProfile
from trackers.size.learning import LIMITS, Known, fit, log_density

RIGS = ("surround", "nuscenes-like", "imaging", "lidar-1deg")
REAL = "astyx"  # the real extract


def known(detections: TrainingDetections, most: int, rng: np.random.Generator) -> Known:
    """At most so many of the detections, in metres on the axes of their vehicles."""
    if detections.size is None:
        raise ValueError(f"data: {detections.source} has no sizes; depths are in metres")
    k = rng.choice(len(detections.u), min(len(detections.u), most), replace=False)
    half = detections.size[k] / 2
    R = detections.noise
    var = np.zeros(half.shape) if R is None else R[k].diagonal(axis1=-2, axis2=-1) * half**2
    return Known(detections.u[k] * half, unit(-detections.aspect[k]), 2 * half, var)


def both_kinds(data: str, count: int) -> Known:
    """As many detections of cars as of trucks, from a data source without its class."""
    rng = np.random.default_rng(0)
    parts = [known(read(f"{data}:{kind}", count), count, rng) for kind in ("car", "truck")]
    return Known(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def learn_all(sources: dict[str, str], count: int) -> dict[str, Any]:
    """Profile of each source by name, and mean log density [nat] of its detections under each profile."""
    data = {name: both_kinds(source, count) for name, source in sources.items()}
    start = DepthProfile()
    profiles = {name: fit(z, start)[0] for name, z in data.items()}
    every = {"default": start, **profiles}
    return {
        "profiles": {
            name: {key: float(f"{asdict(profile)[key]:.3g}") for key in LIMITS} for name, profile in profiles.items()
        },
        "log_density": {
            name: {other: round(float(log_density(p, z).mean()), 3) for other, p in every.items()}
            for name, z in data.items()
        },
    }


def main(
    out: Annotated[Path, typer.Option(help="Results, a .json file.")],
    extract: Annotated[Path | None, typer.Option(help="Folder of the real extract.")] = None,
    count: Annotated[int, typer.Option(min=500, help="Detections of cars, and of trucks.")] = 8000,
) -> None:
    """Learn the profiles of our radars and of the real one, and score each on the detections of all."""
    sources = {rig: f"sampler:{rig}" for rig in RIGS}
    if extract is not None:
        sources[REAL] = str(extract)
    found = learn_all(sources, count)
    command = f"python -m testbed.learn.profile --count {count}"
    write_json(out, {"command": command, **found})
    for name, profile in found["profiles"].items():
        typer.echo(f"{name}: {', '.join(f'{key} {value:g}' for key, value in profile.items())}")
        typer.echo(f"  log density {found['log_density'][name]}")


if __name__ == "__main__":
    typer.run(main)

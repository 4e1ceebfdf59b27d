"""Depth profiles of sensors, learned from detections of vehicles whose boxes are known.

Maximum likelihood of the density of the association at the true size. Each profile is also scored on the detections of
all others: what the profile of another radar costs. Equations: docs/methods/size-from-both-ends.md, section 8.
"""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, logit, ndtr

from testbed.files import write_json
from testbed.learn.detections import TrainingDetections, read
from trackers.geometry import unit
from trackers.scan import DepthProfile, SensorModel
from trackers.size.hits import face_depth, inside_depth
from trackers.size.profile import Profiles
from trackers.size.spatial import density

RIGS = ("surround", "nuscenes-like", "imaging", "lidar-1deg")
REAL = "astyx"  # the real extract
OUTLIERS = 0.01  # share of the detections that are spread evenly over AREA
AREA = 48.0  # [m^2]
LIMITS = {  # of what is learned
    "inside": (0.0, 1.0),
    "inside_depth": (0.1, 20.0),
    "depth": (0.0, 1.0),
    "depth_std": (0.005, 1.0),
    "slant": (0.0, 1.0),
    "grazing": (0.0, 1.0),
    "surface_std": (0.02, 0.6),
}
EVEN_ABOVE = 10.0  # [m] an inside depth beyond this is even


class Known(NamedTuple):
    """G detections of vehicles whose boxes are known."""

    xy: NDArray  # (G, 2) [m] in the axes of the box
    sight: NDArray  # (G, 2) unit line of sight in these axes
    size: NDArray  # (G, 2) [m]
    var: NDArray  # (G, 2) [m^2] noise along the axes


def log_density(profile: DepthProfile, z: Known) -> NDArray:
    """Log densities (G,) [1/m^2] at the true size, for sensors far away."""
    p = Profiles.of((SensorModel(profile=profile),)).at(np.zeros(len(z.xy), int))
    shown = np.abs(z.sight) ** (1 - profile.grazing) * z.size[:, ::-1]
    share = shown / shown.sum(-1, keepdims=True)
    behind = z.size / 2 + np.sign(z.sight) * z.xy
    var = z.var + profile.surface_std**2
    sigma, inner, spread = np.sqrt(var), *p.rounding.transpose(2, 0, 1)
    even = (ndtr(behind / sigma) - ndtr((behind - z.size + inner) / np.hypot(sigma, spread))) / (z.size - inner)
    depth, deep = (of(p, z.sight) for of in (face_depth, inside_depth))
    found = density((1 - profile.inside) * share, profile.inside * share, depth, behind, z.size, var, even, deep)
    return np.log((1 - OUTLIERS) * found + OUTLIERS / AREA)


def fit(z: Known, start: DepthProfile, rounds: int = 3) -> tuple[DepthProfile, float]:
    """The profile of greatest likelihood, everything but `LIMITS` as in `start`, and its mean log density [nat]."""
    low, high = np.array(list(LIMITS.values())).T

    def profile(q: NDArray) -> DepthProfile:
        values = (low + (high - low) * expit(q)).tolist()
        return replace(start, **dict(zip(LIMITS, values, strict=True)))

    def loss(q: NDArray) -> float:
        return -float(log_density(profile(q), z).mean())

    first = np.array([min(getattr(start, name), EVEN_ABOVE) for name in LIMITS])
    q = logit(np.clip((first - low) / (high - low), 0.01, 0.99))
    for _ in range(rounds):  # a simplex that has shrunk is begun anew
        found = minimize(loss, q, method="Nelder-Mead", options={"maxfev": 1000, "adaptive": True})
        q = found.x
    best = profile(q)
    if best.inside_depth > EVEN_ABOVE:
        best = replace(best, inside_depth=np.inf)
    return best, -float(found.fun)


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
    command = f"python -m studies depth-profiles --count {count}"
    write_json(out, {"command": command, **found})
    for name, profile in found["profiles"].items():
        typer.echo(f"{name}: {', '.join(f'{key} {value:g}' for key, value in profile.items())}")
        typer.echo(f"  log density {found['log_density'][name]}")

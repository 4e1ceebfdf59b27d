"""A contour as ellipses on a closed B-spline, learned once and stored as JSON.

Equations: docs/methods/spline-pmht.md. In the unit frame, in which a vehicle is a box [-1/2, 1/2]^2 with x ahead and y
to the left. The spline has integer knots, period n_c and a parameter r in [0, n_c), counter-clockwise.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import dot
from trackers.json_file import read_json

FORMAT = "spline-model-1"
SHIPPED = Path(__file__).parent / "models"
DEGREE = 3
OUTLINE = 48  # points of a drawn contour
Pairs = tuple[tuple[float, float], ...]
Triples = tuple[tuple[float, float, float], ...]
MOST_ELLIPSES = 1000  # of a chain; a body has some dozens


@dataclass(frozen=True)
class SplineModel:
    """Control points, and the covariances of the detections of each ellipse."""

    name: str
    points: Pairs  # control points p_j, n_c of them
    spread: Triples  # xx, xy, yy of Sigma_l, L of them
    size: tuple[float, float] = (4.6, 1.86)  # [m] typical length and width
    interior: float = 0.0  # share of the detections that come from anywhere inside

    def __post_init__(self) -> None:
        chain(len(self.spread), len(self.points), DEGREE)
        if not np.isfinite(self.p).all() or not (np.linalg.eigvalsh(self.Sigma) > 0).all():
            raise ValueError(f"{self.name}: points must be finite and spread positive definite; learn the model again")
        if not 0 <= self.interior < 1:
            raise ValueError(f"{self.name}: interior must be a share of at least 0 and below 1, got {self.interior}")
        if not all(0 < s < np.inf for s in self.size):
            raise ValueError(f"{self.name}: size must be positive, got {self.size}; it is length and width in metres")

    @classmethod
    def of(
        cls, name: str, p: NDArray, Sigma: NDArray, size: tuple[float, float], interior: float = 0.0
    ) -> "SplineModel":
        """From arrays p (n_c, 2) and Sigma (L, 2, 2)."""
        spread = np.stack([Sigma[:, 0, 0], Sigma[:, 0, 1], Sigma[:, 1, 1]], -1)
        return cls(name, tuple(map(tuple, p.tolist())), tuple(map(tuple, spread.tolist())), size, interior)

    @cached_property
    def p(self) -> NDArray:
        """Control points (n_c, 2)."""
        return np.array(self.points)

    @cached_property
    def Sigma(self) -> NDArray:
        """Covariances (L, 2, 2)."""
        xx, xy, yy = np.array(self.spread).T
        return np.stack([xx, xy, xy, yy], -1).reshape(-1, 2, 2)

    @property
    def mu(self) -> NDArray:
        """Centres (L, 2) of the ellipses."""
        return chain(len(self.spread), len(self.points), DEGREE) @ self.p  # (PMHT.3)


@lru_cache(maxsize=8)
def outline_basis(n_c: int, count: int = OUTLINE) -> NDArray:
    """Weights (count, n_c) of the control points at the points of a drawn contour."""
    return basis(np.arange(count) * (n_c / count), n_c, DEGREE)


def curve(p: NDArray, count: int = OUTLINE) -> NDArray:
    """Points (..., count, 2) on the curves of the control points p (..., n_c, 2), (PMHT.1)."""
    return outline_basis(p.shape[-2], count) @ p


def outlines(p: NDArray, Sigma: NDArray, outward: float) -> NDArray:
    """Drawn contours (..., C, 2) in the unit frame: the curve, or `outward` standard deviations outside it."""
    ring = curve(p)
    if not outward:
        return ring
    C, L = ring.shape[-2], Sigma.shape[-3]
    t = np.roll(ring, -1, -2) - np.roll(ring, 1, -2)
    n = np.stack([t[..., 1], -t[..., 0]], -1) / np.maximum(np.sqrt(dot(t, t)), 1e-12)[..., None]
    at = Sigma[..., np.round(np.arange(C) * (L / C)).astype(int) % L, :, :]
    depth = np.sqrt((n[..., None, :] @ at @ n[..., None])[..., 0])
    return ring + outward * depth * n  # (PMHT.4)


def as_json(model: SplineModel, provenance: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What the JSON file of a model holds; what no filter needs stands under `provenance`."""
    return {
        "format": FORMAT,
        "name": model.name,
        "size": list(model.size),
        "interior": model.interior,
        "points": [[round(x, 6) for x in row] for row in model.points],
        "spread": [[float(f"{x:.6g}") for x in row] for row in model.spread],
        "provenance": dict(provenance or {}),
    }


def load(path: Path) -> SplineModel:
    """The model in a JSON file; raises ValueError for a file that holds none."""
    try:
        data = read_json(path)
        if data["format"] != FORMAT:
            raise ValueError(f"its format is {data['format']!r}, not {FORMAT!r}")
        points = tuple((float(x), float(y)) for x, y in data["points"])
        spread = tuple((float(a), float(b), float(c)) for a, b, c in data["spread"])
        length, width = data["size"]
        interior = float(data.get("interior", 0.0))
        return SplineModel(str(data["name"]), points, spread, (float(length), float(width)), interior)
    except (ValueError, KeyError, TypeError, OverflowError, np.linalg.LinAlgError) as error:
        raise ValueError(f"{path} holds no spline model ({error}); `testbed learn-spline` writes one") from None


@lru_cache(maxsize=32)
def find(name: str) -> SplineModel:
    """The model of that name, or in the .json file of that path.

    Raises LookupError where there is none, ValueError for a file that holds none.
    """
    path = Path(name) if name.endswith(".json") else SHIPPED / f"{name}.json"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in SHIPPED.glob("*.json"))) or "none"
        raise LookupError(f"no spline model {name!r}; known: {known}, or the path of a .json")
    return load(path)


def resolve(model: "str | SplineModel | tuple[SplineModel, ...]") -> tuple[SplineModel, ...]:
    """The models of "a", "a+b", of a model or of several, which must all have the same numbers of points and ellipses.

    Raises ValueError otherwise.
    """
    if isinstance(model, SplineModel):
        return (model,)
    found = tuple(find(name) for name in model.split("+")) if isinstance(model, str) else model
    if len({(len(m.points), len(m.spread)) for m in found}) != 1:
        raise ValueError(f"model must be of models with equal numbers of points and ellipses, got {model!r}")
    return found


def cardinal(t: NDArray, degree: int) -> NDArray:
    """The B-spline B_d(t) (...) with knots 0, 1, ..., d + 1, at t (...)."""
    if degree == 0:
        return np.where((t >= 0) & (t < 1), 1.0, 0.0)
    rise, fall = t / degree, (degree + 1 - t) / degree
    return rise * cardinal(t, degree - 1) + fall * cardinal(t - 1, degree - 1)  # (PMHT.2)


def basis(r: NDArray, n_c: int, degree: int) -> NDArray:
    """Weights (R, n_c) of the control points at the parameters r (R,); rows sum to 1."""
    if n_c < degree + 1:
        raise ValueError(f"n_c must be at least degree + 1 = {degree + 1}, got {n_c}; take more control points")
    return cardinal((r[:, None] - np.arange(n_c)) % n_c, degree)  # (PMHT.1)


def slope_basis(r: NDArray, n_c: int, degree: int) -> NDArray:
    """Weights (R, n_c) of the control points in the derivative c'(r) at r (R,)."""
    t = (r[:, None] - np.arange(n_c)) % n_c
    return cardinal(t, degree - 1) - cardinal(t - 1, degree - 1)


@lru_cache(maxsize=64)
def chain(L: int, n_c: int, degree: int = 3) -> NDArray:
    """N (L, n_c), read-only: mu = N p are the centres of L ellipses, (PMHT.3)."""
    if L > MOST_ELLIPSES:
        raise ValueError(f"L must be at most {MOST_ELLIPSES} ellipses, got {L}")
    if n_c > L:
        raise ValueError(f"L must be at least n_c = {n_c} for every control point to count, got {L}")
    N = basis(np.arange(L) * (n_c / L), n_c, degree)  # (PMHT.3)
    N.flags.writeable = False
    return N

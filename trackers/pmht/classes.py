"""Which class of contour an object has: the likelihood of its detections under a catalogue of learned contours.

Equations: docs/methods/spline-pmht.md. Each class is a hypothesis about the complete body. Its contour, placed so that
the end which was seen lies where the track has it, is fitted to the pooled detections by the PMHT of the filter itself,
without motion: position, length and width, each with a prior of the class. The probability of a class is the likelihood
of its fit times its share in traffic. Each detection counts for less than one: those of one body are not independent.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers
from trackers.pmht.association import (
    BOX_COLUMN,
    RelativeDetections,
    columns,
    determinant,
    log_density,
    responsibilities,
    squares,
    synthesise,
)
from trackers.pmht.filter import typical_visibility
from trackers.pmht.model import SHIPPED, SplineModel, load
from trackers.pmht.visibility import directions, weights

FOLDER = SHIPPED / "classes"
NAMES = ("car", "van", "truck", "bus", "articulated", "tractor", "motorcycle")


class ClassFits(NamedTuple):
    """Each of C classes fitted to T objects."""

    evidence: NDArray  # (T, C) log likelihood, log prior of place and size, and log share of the class, at the fit
    offset: NDArray  # (T, C, 2) [m] of the centre, in the frame of the body
    size: NDArray  # (T, C, 2) [m]
    size_std: NDArray  # (T, C, 2) [m]


@dataclass(frozen=True)
class Catalogue:
    """The classes, and how objects are compared with them."""

    names: tuple[str, ...] = NAMES
    shares: tuple[float, ...] = (0.6, 0.12, 0.1, 0.05, 0.06, 0.02, 0.05)  # of the classes in traffic
    folder: str | None = None  # with a NAME.json for each class; None: those that come with the package
    counts: float = 0.3  # independent detections that each detection counts for, (PMHT.35)
    length_std: float = 0.12  # of the logarithm of the length within a class
    width_std: float = 0.05
    place_std: float = 0.6  # [m] of the seen end about where the track has it
    blur: float = 0.03  # [m] error of the pose that the detections were decoupled with
    outliers: float = 1e-5  # [1/m^2] density of what no contour explains
    iterations: int = 3
    unseen: float = 0.1  # (PMHT.22)
    grazing: float = 0.5  # (PMHT.21)

    def __post_init__(self) -> None:
        if len(self.shares) != len(self.names):
            raise ValueError(f"shares must be one number for each of {len(self.names)} names, got {self.shares}")
        positive = ("shares", "counts", "length_std", "width_std", "place_std", "outliers", "iterations")
        check_numbers(self, positive)
        if max(self.unseen, self.grazing) > 1:
            raise ValueError(f"unseen and grazing must be at most 1, got {self.unseen} and {self.grazing}")

    @cached_property
    def models(self) -> tuple[SplineModel, ...]:
        """One contour a class."""
        folder = FOLDER if self.folder is None else Path(self.folder)
        if missing := [name for name in self.names if not (folder / f"{name}.json").is_file()]:
            raise ValueError(f"folder {folder} has no model {missing[0]}.json; `testbed learn-spline` makes one")
        return tuple(load(folder / f"{name}.json") for name in self.names)

    @cached_property
    def mu(self) -> NDArray:
        """Centres (C, 2, L) of the ellipses in the unit frame."""
        return np.stack([model.mu.T for model in self.models])

    @cached_property
    def Sigma(self) -> NDArray:
        """Covariances (C, 3, L) of the ellipses as columns."""
        return np.stack([columns(model.Sigma) for model in self.models])

    @cached_property
    def size(self) -> NDArray:
        """Mean length and width (C, 2) [m] of the classes."""
        return np.array([model.size for model in self.models])

    @cached_property
    def visible(self) -> NDArray:
        """Visibility tables (C, A, L) of the contours at their typical sizes."""
        return np.stack([typical_visibility(model, self.grazing) for model in self.models])

    @property
    def size_std(self) -> NDArray:
        """Standard deviations (2,) of log length and log width within a class."""
        return np.array([self.length_std, self.width_std])

    def fit(self, detections: RelativeDetections, sensor: NDArray, size: NDArray, ends: NDArray) -> ClassFits:
        """The classes fitted to the detections (T, 2, D) [m] of T objects in the frame of the body.

        sensor (T, D, 2) [m] are the places of their sensors in that frame, size (T, 2) [m] is that of the tracks, ends
        (T, 2, 2) bool are the ends that were seen: rear and front, right and left.
        """
        noise = detections.R[:, None] + self.blur**2 * np.array([[1.0], [0.0], [1.0]])
        z = RelativeDetections(detections.z[:, None], noise, detections.mask[:, None])
        class_size = np.broadcast_to(self.size, (len(size), *self.size.shape))  # (T, C, 2)
        beyond = (class_size - size[:, None]) / 2
        one = ends[..., 0].astype(int) - ends[..., 1]  # 1 where the low end alone was seen
        start = one[:, None] * beyond  # (PMHT.34), prior mean of o
        loose = np.where(one[:, None] == 0, beyond, 0.0)
        prior = np.stack([start, class_size], -1)  # (T, C, 2, 2): axis, offset and size
        std = np.stack([np.hypot(self.place_std, loose), class_size * self.size_std], -1)
        theta = prior
        c = self.mu * theta[..., 1, None] + theta[..., 0, None]
        toward = directions(c, np.zeros(class_size.shape[:-1]), sensor[:, None])
        visible = np.broadcast_to(self.visible, (len(size), *self.visible.shape))
        pi = np.maximum(weights(visible, toward, self.unseen), 1e-12)  # (T, C, D, L), (PMHT.22)
        for _ in range(self.iterations):
            on, rest = self._densities(z, theta, pi)
            w = responsibilities(on, z.mask, rest)
            theta, var = self._solved(z, theta, w, prior, std)
        on, rest = self._densities(z, theta, pi)
        share = np.array([model.interior for model in self.models])[:, None, None]
        each = np.log((1 - share) * (np.exp(on).sum(-1, keepdims=True) + rest))[..., 0]
        deviation = (theta - prior) / std
        fit = self.counts * np.where(z.mask, each, 0.0).sum(-1)
        evidence = np.log(self.shares) + fit - 0.5 * (deviation**2).sum((-1, -2))  # (PMHT.35)
        return ClassFits(evidence, theta[..., 0], theta[..., 1], np.sqrt(var[..., 1]))

    def _densities(self, z: RelativeDetections, theta: NDArray, pi: NDArray) -> tuple[NDArray, NDArray]:
        """Log of pi_l N_il (T, C, D, L), and the density (T, C, D, 1) [1/m^2] of inside and outliers beside them."""
        s, o = theta[..., 1], theta[..., 0]
        scale = squares(s)
        on = log_density(z, self.mu * s[..., None] + o[..., None], self.Sigma * scale)
        within = np.exp(log_density(z, o[..., None], BOX_COLUMN * scale))
        share = np.array([model.interior for model in self.models])[:, None, None]
        return on + np.log(pi), share / (1 - share) * within + self.outliers

    def _solved(
        self, z: RelativeDetections, theta: NDArray, w: NDArray, prior: NDArray, std: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Offset and size (T, C, 2, 2) by axis given the weights w (T, C, D, L), and their variances, (PMHT.34)."""
        synthetic = synthesise(w, z)
        V = self.Sigma * squares(theta[..., 1]) + synthetic.R
        part = self.counts * synthetic.M / determinant(V)
        W = np.stack([V[..., 2, :], -V[..., 1, :], V[..., 0, :]], -2) * part[..., None, :]  # (T, C, 3, L)
        tie = (1 / std**2).reshape(*std.shape[:-2], 4)
        H = tie[..., None] * np.eye(4)
        h = tie * prior.reshape(tie.shape)
        J = np.stack([np.ones(self.mu.shape), self.mu], -2)  # (C, axis, 2, L)
        for a in range(2):
            for b in range(2):
                JW = J[:, a] * W[..., a + b, None, :]  # xx, xy, yy
                H[..., 2 * a : 2 * a + 2, 2 * b : 2 * b + 2] += JW @ J[:, b].mT
                h[..., 2 * a : 2 * a + 2] += (JW @ synthetic.z[..., b, :, None])[..., 0]
        cov = np.linalg.inv(H)
        new = (cov @ h[..., None])[..., 0].reshape(theta.shape)  # (PMHT.34)
        new[..., 1] = np.maximum(new[..., 1], 0.5 * prior[..., 1])
        return new, cov.diagonal(axis1=-2, axis2=-1).reshape(theta.shape)

    def probability(self, evidence: NDArray) -> NDArray:
        """Probabilities (..., C) from log evidence (..., C)."""
        p = np.exp(evidence - evidence.max(-1, keepdims=True))
        return p / p.sum(-1, keepdims=True)

    def by_size(self, size: NDArray, size_std: NDArray) -> NDArray:
        """Probabilities (..., C) of objects by their size (..., 2) [m] and its std (..., 2) [m] alone."""
        var = self.size_std**2 + ((size_std / size) ** 2)[..., None, :]
        d = np.log(size)[..., None, :] - np.log(self.size)
        return self.probability(np.log(self.shares) - 0.5 * (d**2 / var + np.log(var)).sum(-1))  # (PMHT.36)

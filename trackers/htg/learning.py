"""Offline learning of the hierarchical truncated Gaussian of `trackers.htg.density`: maximum likelihood.

Equations: docs/methods/hierarchical-truncated-gaussians.md; source: Xia et al. (2020), eq. (6)-(9), corrected. Noise
that a data sheet explains can be given for each detection; r is then what remains, and a tracker adds the noise of its
own radar. Of such noise only the variances along the axes of the hole count, as in the filters.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers.geometry import wrap_angle
from trackers.htg.bins import PARAMETERS, HTGTable
from trackers.htg.density import HTG, log_mass
from trackers.htg.likelihood import Found, Objective, descend, mean_log_density

SIDES = ("a1", "a2", "b1", "b2")
LEAST = 20  # detections that a fit needs
FLIP = np.array([1.0, -1.0])  # mirrors about the long axis
STARTS = ((0.25, 0.03, 0.7, 1.5), (0.02, 0.1, 0.85, 1.2))  # rho, r, closed and open sides
LEADERS = 4  # starts that run to the end
FLAT = 1e-9  # relative change of the mean log-likelihood at which an optimiser stops


@dataclass(frozen=True)
class FitOptions:
    """Where the parameters may lie and what is held fixed."""

    rho: tuple[float, float] = (0.01, 1.0)  # scale of the source; its limits
    bound_max: float = 3.0  # largest side of the box
    r: tuple[float, float] = (1e-4, 0.5)  # noise; its limits
    theta: float | None = None  # [rad] turn of the box; None: free
    mass_min: float = 0.0  # c_D below this is penalised; 0: free
    penalty: float = 30.0  # weight of max(0, log mass_min - log c_D)^2 beside the mean of -log p
    screen: int = 1500  # detections on which the starts compete; the best goes on with all
    thin: int = 300  # fewer detections than this are warned of

    def __post_init__(self) -> None:
        for name in ("rho", "r"):
            low, high = getattr(self, name)
            if not 0 < low < high:
                raise ValueError(f"{name} must be two growing positive limits, got {(low, high)}")
        if not 0 <= self.mass_min < 1:
            raise ValueError(f"mass_min must be within 0 and 1, got {self.mass_min}; it is a probability")


class HTGFit(NamedTuple):
    """The maximum-likelihood density of a set of detections."""

    p: HTG  # theta in [-pi/4, pi/4), or as given
    log_likelihood: float  # [nat] of all detections, without the penalty
    warnings: tuple[str, ...]  # reasons to doubt the fit


def objective(x: NDArray, u: NDArray, noise: NDArray, options: FitOptions) -> tuple[float, NDArray]:
    """Mean of -log p with the penalty on a small c_D, (HTG.41), and its gradient (8,)."""
    mean, gradient, log_c, slope = mean_log_density(x, u, noise)
    if options.mass_min > 0:
        short = max(0.0, np.log(options.mass_min) - log_c)
        return options.penalty * short**2 - mean, -2 * options.penalty * short * slope - gradient
    return -mean, -gradient


def fit(u: ArrayLike, noise: ArrayLike | None = None, options: FitOptions | None = None) -> HTGFit:
    """Maximum-likelihood HTG of detections at u (N, 2) in unit coordinates.

    noise (N, 2, 2) is the covariance of each there, known from a data sheet; None: all noise goes into r.
    """
    options = FitOptions() if options is None else options
    u, noise = _check(u, noise)
    stride = max(1, len(u) // options.screen)
    few = (u[::stride], noise[::stride] if noise.ndim == 3 else noise)
    x, value = race(lambda x: objective(x, *few, options), options)
    if stride > 1:
        x, value = descend(lambda x: objective(x, u, noise, options), x, limits(options), FLAT)
    p = unpack(x)
    if options.theta is None:
        p = canonical(p)
    return HTGFit(p, len(u) * mean_log_density(x, u, noise)[0], doubts(p, len(u), options))


def _check(u: ArrayLike, noise: ArrayLike | None) -> tuple[NDArray, NDArray]:
    u = np.asarray(u, float)
    if u.ndim != 2 or u.shape[1] != 2 or len(u) < LEAST:
        raise ValueError(f"u must be (N, 2) with at least {LEAST} detections in unit coordinates, got {u.shape}")
    known = np.zeros((2, 2)) if noise is None else np.asarray(noise, float)
    if known.shape not in ((2, 2), (len(u), 2, 2)):
        raise ValueError(f"noise must be (N, 2, 2) with N = {len(u)}, got {known.shape}")
    bad = int((~np.isfinite(u)).any(-1).sum()) + int((~np.isfinite(known)).sum())
    if bad:
        raise ValueError(f"u and noise have {bad} values that are not finite; take those detections out")
    return u, known


def starts(options: FitOptions) -> list[NDArray]:
    """Parameter vectors (8,) to begin with: closed boxes, and boxes open to one side or to two neighbouring ones.

    Detections of a vehicle lie on one side or on two; from four equal bounds the descent often ends in a worse optimum.
    The wide sources lead to blobs beyond the box, the narrow ones to layers on it.
    """
    turn = options.theta or 0.0
    found = []
    for rho, r, near, far in STARTS:
        one = [[near if i in (k, (k + second) % 4) else far for i in range(4)] for k in range(4) for second in (0, 1)]
        closed = [[near] * 4, [far] * 4]
        boxes = [(turn, box) for box in closed + one]
        if options.theta is None:
            boxes += [(np.pi / 4, box) for box in closed]
        noise = [np.log(r)] * 2
        found += [np.array([np.log(rho), *box, theta, *noise]) for theta, box in boxes]
    low, high = np.transpose(limits(options))
    return [np.clip(x, low, high) for x in found]


def limits(options: FitOptions) -> list[tuple[float, float]]:
    """Limits of the parameter vector; theta may leave [-pi/4, pi/4) on the way."""
    turn = (-np.pi, np.pi) if options.theta is None else (options.theta, options.theta)
    low, high = options.rho
    return [(np.log(low), np.log(high)), *[(0.0, options.bound_max)] * 4, turn, *[tuple(np.log(options.r))] * 2]


def race(f: Objective, options: FitOptions) -> Found:
    """Best minimum over all starts: all run 20 steps, the leaders to the end."""
    box = limits(options)
    heats = sorted((descend(f, x, box, FLAT, runs=1, steps=20) for x in starts(options)), key=lambda found: found[1])
    return min((descend(f, x, box, FLAT) for x, _ in heats[:LEADERS]), key=lambda found: found[1])


def pack(p: HTG) -> NDArray:
    """The vector (8,) of parameters p ()."""
    return np.array([np.log(p.rho), *p.bounds, p.theta, *np.log(p.r)])


def unpack(x: NDArray) -> HTG:
    """The parameters of a vector (8,)."""
    return HTG(np.asarray(np.exp(x[0])), x[1:5], np.asarray(x[5]), np.exp(x[6:8]))


def canonical(p: HTG, reference: ArrayLike = 0.0) -> HTG:
    """Return the same density with theta in [-pi/4, pi/4) about `reference` [rad], (HTG.45).

    A quarter turn of the box with its sides renamed changes nothing: each density has four descriptions.
    """
    reference = np.asarray(reference, float)
    turn = wrap_angle(p.theta - reference)
    quarters = np.floor((turn + np.pi / 4) / (np.pi / 2)).astype(int)
    side = (np.arange(4) - quarters[..., None]) % 4  # a quarter turn takes a1, a2, b1, b2 to a2, b1, b2, a1
    axis = (np.arange(2) + quarters[..., None]) % 2
    theta = reference + turn - quarters * np.pi / 2
    return HTG(p.rho, np.take_along_axis(p.bounds, side, -1), theta, np.take_along_axis(p.r, axis, -1))


def mirror(p: HTG) -> HTG:
    """The density of detections mirrored about the long axis of the vehicle, (HTG.44)."""
    return HTG(p.rho, p.bounds[..., [0, 3, 2, 1]], -p.theta, p.r)


def doubts(p: HTG, count: int, options: FitOptions) -> tuple[str, ...]:
    """Warnings about a fit: few detections, parameters at their limits, next to no source outside the box."""
    found = [f"only {count} detections"] if count < options.thin else []
    for name, value, (low, high) in zip(PARAMETERS, pack(p), limits(options), strict=True):
        margin = 1e-3 * (high - low)
        if name in SIDES:
            if value > high - margin:
                found.append(f"{name} ran to its limit {high:g}")
        elif name != "theta" and not low + margin < value < high - margin:
            found.append(f"{name} ran to its limit {np.exp(low if value < (low + high) / 2 else high):g}")
    mass = float(np.exp(log_mass(p)))
    if mass < 1e-3:
        found.append(f"c_D is {mass:.1e}: too small for pseudo-measurements")
    return tuple(found)


class TableFit(NamedTuple):
    """A learned table with the counts, likelihoods and warnings of its B bins."""

    table: HTGTable
    counts: NDArray  # (B,) detections in the bin, mirrored ones left out
    log_likelihood: NDArray  # (B,) [nat] mean a detection, mirrored ones included
    warnings: tuple[tuple[str, ...], ...]  # B times


def fit_table(
    u: ArrayLike,
    aspect: ArrayLike,
    noise: ArrayLike | None = None,
    bins: int = 8,
    centred: bool = True,
    mirrored: bool = True,
    options: FitOptions | None = None,
    name: str = "unnamed",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> TableFit:
    """One fit for each bin of the aspect angle, with the mean and covariance of the detections there, noise included.

    u and noise are those of `fit`, aspect (N,) [rad] is that of (HTG.12). In a `centred` table 0 and pi lie in the
    middle of a bin; `mirrored`: each bin also learns from the mirror image of its opposite, as vehicles are symmetric.
    """
    options = FitOptions() if options is None else options
    aspect = np.asarray(aspect, float)
    u, noise = _check(u, noise)
    if aspect.shape != (len(u),) or not np.isfinite(aspect).all():
        raise ValueError(f"aspect must be ({len(u)},) finite angles, one a detection, got {aspect.shape}: {aspect}")
    index = bin_index(aspect, bins, centred)
    twin = (bins - (not centred) - np.arange(bins)) % bins  # the bin of -aspect, (HTG.44)
    known = np.broadcast_to(noise, (len(u), 2, 2))
    todo = [k for k in range(bins) if not mirrored or k <= twin[k]]
    counts = np.bincount(index, minlength=bins)
    pooled = counts + mirrored * counts[twin]
    k = int(pooled.argmin())
    if pooled[k] < LEAST:
        middle = np.rad2deg(empty_table(bins, centred).centres[k])
        raise ValueError(
            f"bin {k} of {bins}, at an aspect of {middle:+.0f} deg, has {pooled[k]} detections, needs {LEAST}; "
            "give more data or fewer bins"
        )
    progress(0, len(todo))
    found: dict[int, HTGFit] = {}
    moments: dict[int, tuple[NDArray, NDArray]] = {}
    for done, k in enumerate(todo):
        z, R = pool(u, known, index == k, index == twin[k] if mirrored else None)
        found[k], moments[k] = fit(z, R, options), (z.mean(0), np.cov(z.T))
        if mirrored and twin[k] != k:
            p = mirror(found[k].p)
            found[twin[k]] = found[k]._replace(p=p, warnings=doubts(p, len(z), options))
            moments[twin[k]] = moments[k][0] * FLIP, np.cov((z * FLIP).T)
        progress(done + 1, len(todo))
    fits = [found[k] for k in range(bins)]
    p = HTG(*(np.stack([getattr(f.p, leaf) for f in fits]) for leaf in HTG._fields))
    mean, cov = (np.stack([moments[k][i] for k in range(bins)]) for i in range(2))
    log_likelihood = np.array([f.log_likelihood for f in fits]) / pooled
    return TableFit(
        HTGTable(p, mean, cov, centred=centred, name=name), counts, log_likelihood, tuple(f.warnings for f in fits)
    )


def bin_index(aspect: NDArray, bins: int, centred: bool) -> NDArray:
    """Bin (...) of aspect angles (...) [rad] in a table with so many, as `HTGTable.bin_of`."""
    return empty_table(bins, centred).bin_of(aspect)


def empty_table(bins: int, centred: bool) -> HTGTable:
    """A table with nothing in its bins."""
    none = np.zeros(bins)
    p = HTG(none, np.zeros((bins, 4)), none, np.zeros((bins, 2)))
    return HTGTable(p, np.zeros((bins, 2)), np.zeros((bins, 2, 2)), centred=centred)


def pool(u: NDArray, noise: NDArray, own: NDArray, opposite: NDArray | None) -> tuple[NDArray, NDArray]:
    """Detections and noise under the mask own (N,), and the mirror images of those under opposite (N,)."""
    if opposite is None:
        return u[own], noise[own]
    flip = np.outer(FLIP, FLIP)
    return np.concatenate([u[own], u[opposite] * FLIP]), np.concatenate([noise[own], noise[opposite] * flip])

"""Learned densities by aspect: the side of a vehicle that faces the sensor decides where its detections lie.

The aspect angle (HTG.12) is 0 when the sensor sees the rear and +-pi when it sees the front. `centred` bins have 0 and
+-pi in the middle of a bin, where the aspects of a highway are; the paper's have edges there.
Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers.estimate import Estimate
from trackers.geometry import rotation, unit, wrap_angle
from trackers.htg.density import HTG, log_density, log_mass
from trackers.json_file import read_json
from trackers.scan import Scan

FORMAT = "htg-table-1"
SHIPPED = Path(__file__).parent / "tables"
TYPICAL = (4.6, 1.86)  # [m] length and width of a car
TRUCK_ABOVE = 6.5  # [m] no car is longer, and hardly a truck shorter
HUGE = 1e6  # that no number of a table reaches, an open side apart
PAPER_FRAME = (("anchor", 0.0), ("scale", 1.0), ("shift", 0.0))
PARAMETERS = ("rho", "a1", "a2", "b1", "b2", "theta", "r1", "r2")


class UnitFrame(NamedTuple):
    """Unit coordinates of a bin, (HTG.14); each field (..., 2) along the length and the width."""

    anchor: NDArray  # in [-1, 1]
    scale: NDArray  # > 0
    shift: NDArray
    size: NDArray  # [m] typical length and width


@dataclass(frozen=True, eq=False)
class HTGTable:
    """Densities of B equal bins of the aspect angle, from -pi upwards; equal only to itself.

    With a finite `above` the table is of two classes: the second half of its bins is for longer bodies.
    """

    p: HTG  # leading axis B
    mean: NDArray  # (B, 2) of the training data in unit coordinates, noise included
    cov: NDArray  # (B, 2, 2)
    centred: bool = True  # bin 0 lies around +-pi, not from -pi onwards
    name: str = "unnamed"
    anchor: NDArray = field(default_factory=lambda: np.zeros((1, 2)))  # (B or 1, 2) see `warp`; 0 in the paper
    size: ArrayLike = TYPICAL  # (2,) or (B, 2) [m] typical of the data; at this size every anchor gives the same u
    scale: NDArray = field(default_factory=lambda: np.ones((1, 2)))  # (B or 1, 2) of u, (HTG.14); 1 in the paper
    shift: NDArray = field(default_factory=lambda: np.zeros((1, 2)))  # (B or 1, 2); 0 in the paper
    above: float = np.inf  # [m] length above which a body is of the second class

    def __len__(self) -> int:
        return len(self.p.rho)

    @property
    def plain(self) -> bool:
        """Whether all bins are in the unit coordinates of the paper, (HTG.1)."""
        return not self.anchor.any() and not self.shift.any() and bool((self.scale == 1).all())

    @property
    def aspects(self) -> int:
        """Number of bins of one class."""
        return len(self) // 2 if np.isfinite(self.above) else len(self)

    @property
    def centres(self) -> NDArray:
        """Aspect angles (B,) [rad] in the middle of the bins."""
        B = self.aspects
        return -np.pi + (np.arange(len(self)) % B + 0.5 * (not self.centred)) * (2 * np.pi / B)

    def bin_of(self, aspect: ArrayLike, length: ArrayLike = 0.0) -> NDArray:
        """Bin (...) of aspect angles (...) [rad] of bodies of length (...) [m]."""
        B = self.aspects
        turn = (np.asarray(aspect) + np.pi) * (B / (2 * np.pi))
        return np.floor(turn + 0.5 * self.centred).astype(int) % B + B * (np.asarray(length) > self.above)  # (HTG.13)

    def bin_at(self, centre: NDArray, heading: NDArray, length: NDArray, sensor: NDArray) -> NDArray:
        """Bin (...) of bodies at centre (..., 2) [m] with heading (...) and length (...), for sensors (..., 2) [m]."""
        return self.bin_of(aspect_angle(centre, heading, sensor), length)

    def of(self, index: NDArray) -> HTG:
        """Parameters (...) of the bins index (...)."""
        return HTG(*(leaf[index] for leaf in self.p))

    def warp(self, half: NDArray, index: NDArray) -> tuple[NDArray, NDArray]:
        """Scale h and shift t, (..., 2) [m], of u = (e - t) / h for body coordinates e (..., 2) [m].

        half (..., 2) [m] is half the size of the body, index (...) the bin. Anchor 0 is the unit coordinate of the
        paper, e / half. At anchor +-1 the distance from that end is in metres: how deep behind the bumper detections
        lie does not depend on the length of the vehicle, and must not inform about it.
        """
        return warp(half, self.frame(index))

    def frame(self, index: NDArray) -> UnitFrame:
        """The unit coordinates of the bins index (...)."""
        return UnitFrame(*(leaf[index] for leaf in frames(self)))


def warp(half: NDArray, frame: UnitFrame) -> tuple[NDArray, NDArray]:
    """Scale and shift, (..., 2) [m], as in `HTGTable.warp`, (HTG.14)."""
    anchor, scale, shift, size = frame
    share = np.abs(anchor)
    h = (1 - share) * half + share * size / 2  # (HTG.14)
    return scale * h, anchor * (half - h) + shift * h  # (HTG.14)


def growth(half: NDArray, frame: UnitFrame) -> tuple[NDArray, NDArray]:
    """Derivatives (..., 2) of log scale, and of the shift over the scale, with respect to log half (..., 2)."""
    anchor, scale, shift, size = frame
    share = np.abs(anchor)
    h = (1 - share) * half + share * size / 2
    ratio = half / h
    return (1 - share) * ratio, (anchor * share + shift * (1 - share)) * ratio / scale  # (HTG.15)


@lru_cache(maxsize=64)
def frames(table: HTGTable) -> UnitFrame:
    """The unit coordinates of all bins, leaves (B, 2)."""
    leaves = (table.anchor, table.scale, table.shift, table.size)
    return UnitFrame(*(np.broadcast_to(leaf, (len(table), 2)) for leaf in leaves))


@lru_cache(maxsize=64)
def log_masses(table: HTGTable) -> NDArray:
    """Log c_D (B,) of the bins."""
    return log_mass(table.p)


@lru_cache(maxsize=64)  # the same object at each call, so that the caches of tables hold
def metric_ends(table: HTGTable) -> HTGTable:
    """The table with the end that faces the sensor as anchor, in the bins centred on an axis of the body.

    In these bins one end is visible and the other is not, and the detections show of that axis only where the near end
    is. In the other bins both axes are visible from end to end and their detections scale with the size. The longer of
    two classes keeps the coordinates of the paper: a radar sees under a truck from end to end.
    """
    near = unit(np.pi - table.centres)  # direction of the sensor in body axes
    ends = np.where(np.abs(near) > 1 - 1e-9, np.sign(near), 0.0)
    ends[table.aspects :] = 0.0
    return replace(table, anchor=ends)


def by_length(short: HTGTable, long: HTGTable, above: float = TRUCK_ABOVE) -> HTGTable:
    """One table of two classes, the second for bodies longer than above [m].

    Raises ValueError unless both are of one class with the same bins.
    """
    if len(short) != len(long) or short.centred != long.centred or min(short.above, long.above) < np.inf:
        raise ValueError(f"tables {short.name!r} and {long.name!r} must have the same bins; learn them with one --bins")

    def both(name: str) -> NDArray:
        return np.concatenate([np.broadcast_to(getattr(t, name), (len(t), 2)) for t in (short, long)])

    p = HTG(*(np.concatenate(pair) for pair in zip(short.p, long.p, strict=True)))
    return HTGTable(
        p,
        both("mean"),
        np.concatenate([short.cov, long.cov]),
        short.centred,
        f"{short.name} up to {above} m, {long.name}",
        **{name: both(name) for name in UnitFrame._fields},
        above=above,
    )


def aspect_angle(centre: NDArray, heading: NDArray, sensor: NDArray) -> NDArray:
    """Aspect (...) [rad] of bodies at centre (..., 2) [m] with heading (...) [rad] for sensors at (..., 2) [m]."""
    d = centre - sensor
    return wrap_angle(heading - np.arctan2(d[..., 1], d[..., 0]))  # (HTG.12)


def as_json(table: HTGTable, provenance: dict[str, Any] | None = None) -> dict[str, Any]:
    """What the JSON file of a table holds.

    Keys: `format`, `centred`, one list of B numbers per parameter (`rho`, `a1`, `a2`, `b1`, `b2`, `theta`, `r1`, `r2`;
    null stands for an open side), `mean` (B, 2), `cov` (B, 2, 2), optionally `anchor`, `scale`, `shift`
    (B, 2) and `size` (2,), and `provenance`, which no filter reads.
    """
    if np.isfinite(table.above):
        raise ValueError(f"table {table.name!r} is of two classes; save each of the tables that it was made of")
    p = table.p
    columns = (p.rho, *np.moveaxis(p.bounds, -1, 0), p.theta, p.r[:, 0], p.r[:, 1])
    parameters = {
        name: [None if np.isinf(x) else float(x) for x in column] for name, column in zip(PARAMETERS, columns)
    }
    content = {"format": FORMAT, "centred": bool(table.centred), **parameters}
    content |= {"mean": table.mean.tolist(), "cov": table.cov.tolist()}
    content |= {"anchor": table.anchor.tolist(), "size": np.asarray(table.size).tolist()}
    content |= {"scale": table.scale.tolist(), "shift": table.shift.tolist(), "provenance": provenance or {}}
    return content


@lru_cache(maxsize=64)
def load(name_or_path: str) -> HTGTable:
    """A shipped table by name, or one of your own by the path of its JSON file; see `as_json` for the keys.

    Raises LookupError where there is neither, ValueError for a file that is not such a table.
    """
    path = Path(name_or_path)
    if path.suffix != ".json":
        path = SHIPPED / f"{name_or_path}.json"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in SHIPPED.glob("*.json"))) or "none"
        raise LookupError(f"no table {name_or_path!r}; shipped: {known}; or give the path of a .json file")
    return parse(read_json(path), path.stem)


def resolve(table: str | HTGTable) -> HTGTable:
    """The table itself, or the one of that name: a shipped table, a path, or two joined by "+" (cars + trucks)."""
    return named(table) if isinstance(table, str) else table


@lru_cache(maxsize=64)
def named(name: str) -> HTGTable:
    """One table of one or two classes; see `resolve` and, for the errors, `load` and `by_length`."""
    short, plus, long = name.partition("+")
    return by_length(load(short), load(long)) if plus else load(short)


def parse(content: dict[str, Any], name: str) -> HTGTable:
    """A table from the content of its file; raises ValueError for anything that is not one."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ValueError(f"{name} is not a table of format {FORMAT!r}; make one with `testbed learn-htg`")
    missing = {*PARAMETERS, "centred", "mean", "cov"} - set(content)
    if missing:
        raise ValueError(f"{name} lacks {', '.join(sorted(missing))}; make it again with `testbed learn-htg`")
    column = {k: _numbers(name, k, content[k]) for k in PARAMETERS}
    mean, cov = _numbers(name, "mean", content["mean"]), _numbers(name, "cov", content["cov"])
    B = len(column["rho"]) if column["rho"].ndim else 0
    if any(c.shape != (B,) for c in column.values()) or mean.shape != (B, 2) or cov.shape != (B, 2, 2) or B == 0:
        found = ", ".join(f"{k} {a.shape}" for k, a in {**column, "mean": mean, "cov": cov}.items())
        raise ValueError(f"{name} has {B} bins, but {found}; expected ({B},) each, mean ({B}, 2) and cov ({B}, 2, 2)")
    p = HTG(
        rho=column["rho"],
        bounds=np.stack([column[k] for k in ("a1", "a2", "b1", "b2")], -1),
        theta=column["theta"],
        r=np.stack([column["r1"], column["r2"]], -1),
    )
    if not all((np.abs(leaf) < HUGE).all() for leaf in (p.rho, p.theta, p.r, mean, cov)):
        raise ValueError(f"{name} needs finite numbers below {HUGE:g}, open sides apart")
    if not ((p.rho > 0).all() and (p.r > 0).all() and (p.bounds >= 0).all() and (p.bounds < HUGE).any(-1).all()):
        raise ValueError(f"{name} needs rho > 0, r > 0, bounds >= 0 and a finite bound in every bin")
    frame = {k: _numbers(name, k, content.get(k, [[default] * 2])) for k, default in PAPER_FRAME}
    for key, leaf in frame.items():
        if leaf.shape not in ((1, 2), (B, 2)) or not (np.abs(leaf) < HUGE).all():
            raise ValueError(f"{name} needs {key} as ({B}, 2) finite numbers, got {leaf.tolist()}")
    if np.abs(frame["anchor"]).max() > 1 or frame["scale"].min() <= 0:
        raise ValueError(
            f"{name} needs anchors within -1 and 1 and scales > 0, got {frame['anchor']} and {frame['scale']}"
        )
    size = _numbers(name, "size", content.get("size", TYPICAL))
    if size.shape != (2,) or not ((size > 0) & (size < HUGE)).all():
        raise ValueError(f"{name} needs size as two positive lengths, got {size.tolist()}")
    anchor, scale, shift = (frame[k] for k, _ in PAPER_FRAME)
    return HTGTable(p, mean, cov, bool(content["centred"]), name, anchor, tuple(size.tolist()), scale, shift)


def _numbers(name: str, key: str, value: Any) -> NDArray:
    """An array of numbers from JSON, in which null is infinite; ValueError where it is none."""
    try:
        found = np.array(value, float)  # null becomes NaN
    except (ValueError, TypeError, OverflowError):
        raise ValueError(f"{name} needs {key} as numbers, in rows of equal lengths") from None
    return np.where(np.isnan(found), np.inf, found)


def log_spatial(
    table: HTGTable, estimate: Estimate, scan: Scan, track: NDArray, detection: NDArray, sigma: float
) -> NDArray:
    """Log density (G,) [1/m^2] of pairs of track (G,) and detection (G,) under the bin of that detection's aspect.

    The noise of the detection and the uncertainty of the centre blur the density; unknown noise is sigma [m].
    """
    M = scan.mask.shape[-1]
    sensor = np.broadcast_to(scan.pose[:, :2], (M, 2))[detection]
    pose, half = estimate.pose[track], estimate.size[track] / 2
    index = table.bin_at(pose[:, :2], pose[:, 2], estimate.size[track, 0], sensor)
    p = table.of(index)
    h, shift = table.warp(half, index)
    C = scan.position_noise(sigma)[detection] + estimate.cov[track, :2, :2]
    body = rotation(pose[:, 2])
    e = (body.mT @ (scan.xy[detection] - pose[:, :2])[..., None])[..., 0]
    axes = body @ (rotation(p.theta) / h[:, :, None])  # columns: turned axes of unit coordinates, pulled back
    noise = (axes * (C @ axes)).sum(-2)  # (HTG.40)
    return log_density((e - shift) / h, p, noise, log_masses(table)[index]) - np.log(h[:, 0] * h[:, 1])  # (HTG.40)

"""Contour trackers on one object, many runs at once, and their errors."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from studies.papers.hoher2022.uturn import DT, Truth
from testbed.evaluation.metrics import areas, gaussian_wasserstein, region_iou, rmse
from trackers import Scan
from trackers.geometry import extent_matrix
from trackers.random_matrix.koch import Koch, KochState
from trackers.random_matrix.rays import outline, root_of
from trackers.random_matrix.virtual_measurements import ContourState, VirtualMeasurements

SETTLED = 20  # steps before the errors count
POLYGON = 64  # corners of the polygon that stands for an ellipse


@dataclass(frozen=True)
class ContourMethod:
    """One algorithm of the comparison."""

    name: str
    filter: Koch | VirtualMeasurements
    sigmas: float = 1.0  # of a random matrix alone: its ellipse in roots of the extent
    naive: bool = False  # the ellipse overwrites the filter's state after every step


class ContourTrack(NamedTuple):
    """Ellipses or boxes of a method after K steps of R runs."""

    centre: NDArray  # (R, K, 2) [m]
    size: NDArray  # (R, K, 2) [m]
    tilt: NDArray  # (R, K) [rad]
    position: NDArray  # (R, K, 2) [m] of the filter


def blank(runs: int) -> KochState:
    """The start of the report: nothing known, x0 = 0, P0 = diag(10, 5, 1), X0 = 100 I, nu0 = 4."""
    P = np.tile(np.diag([10.0, 5.0, 1.0]), (runs, 1, 1))
    return KochState(np.zeros((runs, 6)), P, np.full(runs, 4.0), np.tile(100 * np.eye(2), (runs, 1, 1)), np.zeros(runs))


def axes(X: NDArray, sigmas: float, near: NDArray) -> tuple[NDArray, NDArray]:
    """Full length, width (..., 2) [m] of the ellipses of extents X, and tilt (...) within a quarter turn of `near`."""
    w, V = np.linalg.eigh(X)
    tilt = np.arctan2(V[..., 1, 1], V[..., 0, 1])
    tilt = tilt + np.pi * np.round((near - tilt) / np.pi)
    return 2 * sigmas * np.sqrt(w[..., ::-1]), tilt


def first_contour(koch: KochState) -> ContourState:
    """The report's first ellipse: the filter's position and the extent by nu - 6 where that exists."""
    nu = koch.nu
    X = koch.X / np.where(nu > 6.5, nu - 6, nu - 3)[..., None, None]
    size, _ = axes(X, 1.0, koch.heading)
    steps = np.ones(nu.shape, int)
    return ContourState(koch, koch.x[..., :2], size, koch.heading, size / 2, steps)


def track(method: ContourMethod, scans: list[Scan], start: KochState | ContourState | None = None) -> ContourTrack:
    """Track the object through K scans with leading axis R, from a start or from that of the report."""
    f = method.filter
    koch = f if isinstance(f, Koch) else f.koch
    state: KochState | ContourState
    steps = []
    for k, scan in enumerate(scans):
        if k == 0 and start is None:
            state, _ = koch.update(koch.predict(blank(len(scan.mask)), DT), scan)
            if isinstance(f, VirtualMeasurements):
                state = f.adapt(first_contour(state), scan)
        else:
            before = start if k == 0 else state
            state, _ = f.update(f.predict(before, DT), scan)  # type: ignore[arg-type]
        if method.naive:
            state = overwrite(state)  # type: ignore[arg-type]
        steps.append(describe(method, state))
    return ContourTrack(*(np.stack(leaves, 1) for leaves in zip(*steps, strict=True)))


def overwrite(state: ContourState) -> ContourState:
    """Naive feedback: position and extent of the filter become those of the ellipse."""
    koch = state.koch
    x = np.concatenate([state.centre, koch.x[..., 2:]], -1)
    X = (koch.nu - 3)[..., None, None] * extent_matrix(state.tilt, state.size)
    return state._replace(koch=koch._replace(x=x, X=X))


def describe(method: ContourMethod, state: KochState | ContourState) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Centre, size, tilt and filter position of a state."""
    if isinstance(state, ContourState):
        return state.centre, state.size, state.tilt, state.koch.x[..., :2]
    size, tilt = axes(state.extent, method.sigmas, state.heading)
    return state.x[..., :2], size, tilt, state.x[..., :2]


class ContourErrors(NamedTuple):
    """Errors of R runs at K steps."""

    centre: NDArray  # (R, K) [m] distance
    tilt: NDArray  # (R, K) [deg], modulo half a turn
    length: NDArray  # (R, K) [m] signed
    width: NDArray  # (R, K) [m] signed
    gwd: NDArray  # (R, K) [m] rooted
    iou: NDArray  # (R, K) with the true outline
    position: NDArray  # (R, K) [m] distance of the filter's position


def errors(found: ContourTrack, truth: Truth) -> ContourErrors:
    """Errors after every step."""
    p, heading = truth.poses[:, :2], truth.poses[:, 2]
    tilt = np.degrees((found.tilt - heading + np.pi / 2) % np.pi - np.pi / 2)
    X, Y = extent_matrix(found.tilt, found.size), extent_matrix(heading, truth.size)
    grow = np.sqrt(np.pi / (POLYGON / 2 * np.sin(2 * np.pi / POLYGON)))  # polygon of the ellipse's area
    ring = outline(found.centre, grow * root_of(found.size, found.tilt), POLYGON + 1)[..., :-1, :]
    body = areas(truth.outlines)
    shapely.prepare(body)
    d = found.size - truth.size
    return ContourErrors(
        centre=np.linalg.norm(found.centre - p, axis=-1),
        tilt=tilt,
        length=d[..., 0],
        width=d[..., 1],
        gwd=np.sqrt(gaussian_wasserstein(found.centre, X, p, Y)),
        iou=region_iou(areas(ring), body),
        position=np.linalg.norm(found.position - p, axis=-1),
    )


MEASURES = {
    "centre [m]": 2, "tilt [deg]": 1, "length [m]": 2, "length bias [m]": 2, "width [m]": 2, "width bias [m]": 2,
    "GW [m]": 2, "IoU": 2, "position [m]": 2,
}  # fmt: skip
LEGEND = "root mean square errors and biases of the contour; GW and IoU are means; position is that of the filter"


def measure(e: ContourErrors, since: int = SETTLED) -> dict[str, float]:
    """RMSE, bias and means over all runs from step `since` on; names as in MEASURES."""
    e = ContourErrors(*(a[:, since:] for a in e))

    values = (
        rmse(e.centre), rmse(e.tilt), rmse(e.length), e.length.mean(), rmse(e.width), e.width.mean(),
        e.gwd.mean(), e.iou.mean(), rmse(e.position),
    )  # fmt: skip
    return dict(zip(MEASURES, map(float, values), strict=True))

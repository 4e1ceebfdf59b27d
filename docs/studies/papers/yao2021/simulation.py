"""The experiment of yao2021: a truck or a tractor on two circles and a straight, seen from all sides.

The paper describes the contours in words and prints no turn rates: the numbers are ours.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from scenarios.contours import mirrored
from studies.papers.yao2021.contour_em import ContourEM, decoupled
from studies.papers.yao2021.sequential import OneByOne
from testbed.evaluation.metrics import areas, region_iou
from trackers.geometry import rotation, to_world, wrap_angle
from trackers.held_gaussian import LENGTH, WIDTH
from trackers.linalg import quadratic
from trackers.motion.turn import OMEGA, PHI, SPEED
from trackers.pmht.filter import SplinePmht
from trackers.pmht.joint import EllipseUpdate
from trackers.pmht.learner import frame_shift, shifted
from trackers.pmht.learning import SplineContour
from trackers.pmht.model import SplineModel, curve
from trackers.pmht.state import SplineState, predicted, turned
from trackers.range_rate import RangeRates
from trackers.scan import Scan
from trackers.smoother import smooth_moments

STEPS, ADAPT_AT = 242, 101  # scans; the contour is adapted after the last of the first circle
STEP = 1.0  # [s]
DETECTIONS = 20.0  # Poisson mean of a scan
BAND, NOISE = 0.2, 0.05  # [m] band inside the contour where detections come from, sensor noise
SIZE = np.array([5.0, 2.0])  # [m]
START = np.array([0.0, 0.0, 0.0, 11.2, 0.0, *SIZE])
PRIOR = np.array([0.0, 0.0, 0.0, 11.2, 0.01, *SIZE])
PRIOR_VAR = np.array([0.5**2, 0.5**2, 0.1**2, 0.05, 0.035**2, 0.005**2, 0.005**2])
LOST = 2.0  # [m] at the end
CONTOURS = {
    "truck": np.array(mirrored(((2.5, 0.45), (2.2, 0.7), (1.2, 0.75), (1.0, 1.0), (-2.5, 1.0)))),
    "tractor": np.array(
        mirrored(((2.5, 0.45), (2.1, 0.7), (1.3, 0.7), (1.1, 0.5), (-0.4, 0.5), (-0.7, 1.0), (-2.5, 1.0)))
    ),
}


def truth() -> NDArray:
    """States (242, 7): a left circle, a right one, a straight."""
    omega = np.concatenate([np.full(101, np.pi / 101), np.full(121, -np.pi / 121), np.zeros(20)])
    x = np.empty((STEPS, 7))
    x[0] = START
    x[:, OMEGA] = omega
    for k in range(1, STEPS):
        now = x[k - 1].copy()
        now[OMEGA] = omega[k]
        x[k] = turned(now, STEP)
    return x


def band_points(outline: NDArray, count: int, rng: np.random.Generator) -> NDArray:
    """Points (count, 2) [m] uniform over the band inside an outline (C, 2) [m]."""
    body = shapely.Polygon(outline)
    band = body.difference(body.buffer(-BAND, join_style="mitre"))
    shapely.prepare(band)
    low, high = outline.min(0), outline.max(0)
    found: list[NDArray] = []
    while sum(map(len, found)) < count:
        draw = rng.uniform(low, high, (2 * count, 2))
        found.append(draw[shapely.contains_xy(band, draw)])
    return np.concatenate(found)[:count]


class SimulatedRuns(NamedTuple):
    """All scans of R runs on the same course."""

    x: NDArray  # (K, 7) the truth, the same in every run
    xy: NDArray  # (K, R, M, 2) [m]
    mask: NDArray  # (K, R, M)

    def scan(self, k: int) -> Scan:
        """The scans of step k."""
        return Scan.from_xy(self.xy[k], self.mask[k])


def simulate(outline: NDArray, runs: int, rng: np.random.Generator) -> SimulatedRuns:
    """The same course `runs` times, each time with other detections."""
    x = truth()
    count = rng.poisson(DETECTIONS, (STEPS, runs))
    M = int(count.max())
    body = band_points(outline, STEPS * runs * M, rng).reshape(STEPS, runs * M, 2)
    xy = to_world(x[:, :3], body) + NOISE * rng.standard_normal(body.shape)
    return SimulatedRuns(x, xy.reshape(STEPS, runs, M, 2), np.arange(M) < count[..., None])


class ForwardPass(NamedTuple):
    """What a smoother needs of K steps: moments after updates, predictions before them, and cross covariances."""

    m: NDArray  # (K, R, 7)
    P: NDArray  # (K, R, 7, 7)
    m_pred: NDArray
    P_pred: NDArray
    D: NDArray


def begin(filter: SplinePmht, runs: int, contour: SplineContour | None = None) -> SplineState:
    """The prior, with a contour of its own for each run or the filter's model."""
    model = filter.models[0]
    m, P = np.tile(PRIOR, (runs, 1)), np.tile(np.diag(PRIOR_VAR), (runs, 1, 1))
    p, Sigma = (model.p, model.Sigma) if contour is None else contour
    p, Sigma = np.broadcast_to(p, (runs, *p.shape[-2:])), np.broadcast_to(Sigma, (runs, *Sigma.shape[-3:]))
    return SplineState(m, P, p, Sigma, np.zeros((runs, 1, Sigma.shape[1])))


def track(
    filter: SplinePmht, runs: SimulatedRuns, state: SplineState, first: int, last: int
) -> tuple[SplineState, ForwardPass]:
    """Filter the scans first to last - 1 from the state after scan first - 1, or from the prior before scan 0."""
    kept: list[tuple[NDArray, ...]] = []
    for k in range(first, last):
        m_pred, P_pred, D = state.m, state.P, np.zeros(state.P.shape)
        if k > 0:
            m_pred, P_pred, D = predicted(state.m, state.P, filter.walk, STEP)
        state, _ = filter.update(state._replace(m=m_pred, P=P_pred), runs.scan(k))
        kept.append((state.m, state.P, m_pred, P_pred, D))
    return state, ForwardPass(*(np.stack(column) for column in zip(*kept, strict=True)))


@dataclass(frozen=True)
class AdaptationMethod:
    """One way to track and to adapt."""

    name: str
    form: str | EllipseUpdate = "joint"
    widened: float = 1.0  # times Sigma_l in the association
    shift: bool = True  # move the frame to the middle of the adapted contour
    passes: int = 2
    stiffness: float = 0.5  # lambda for each detection

    def filter(self, model: SplineModel) -> SplinePmht:
        """The paper's filter."""
        return SplinePmht(model, "none", self.form, rates=RangeRates(weight=0.0), sigma=NOISE, widened=self.widened)


A = AdaptationMethod("A", OneByOne(), shift=False, passes=1, stiffness=0.0)
B = AdaptationMethod("B")


class Adapted(NamedTuple):
    """The state at the end of the first circle, with the contour that was learned on it."""

    state: SplineState
    smoothed: ForwardPass  # of the offline model
    contour: SplineContour
    z: NDArray  # (R, K M, 2) decoupled detections
    mask: NDArray  # (R, K M)


def adapt(
    method: AdaptationMethod, filter: SplinePmht, runs: SimulatedRuns, state: SplineState, forward: ForwardPass
) -> Adapted:
    """Learn each run's contour from its scans 0 to T - 1; state and forward pass are those of the offline model."""
    off = contour = SplineContour(state.p, state.Sigma)
    L = off.Sigma.shape[-3]
    first = forward
    for k in range(method.passes):
        if k > 0:
            state, forward = track(filter, runs, begin(filter, len(state.m), contour), 0, ADAPT_AT)
        ms, Ps = smooth_moments(*forward)
        first = forward._replace(m=ms, P=Ps) if k == 0 else first
        z, mask = pooled(decoupled(ms, runs.xy[:ADAPT_AT]), runs.mask[:ADAPT_AT])
        stiffness = method.stiffness * mask.sum(-1)
        contour = ContourEM().run(contour, z, mask, np.full((1, L), -np.log(L)), stiffness, off.p)
        if method.shift:
            o = frame_shift(contour.p)
            contour = contour._replace(p=contour.p - o[..., None, :])
            state, z = state._replace(m=shifted(state.m, o)), z - o[..., None, :]
    return Adapted(state._replace(p=contour.p, Sigma=contour.Sigma), first, contour, z, mask)


def pooled(z: NDArray, mask: NDArray) -> tuple[NDArray, NDArray]:
    """Detections (K, R, M, 2) of all scans of each run together, (R, K M, 2) and their mask."""
    R = z.shape[1]
    return np.moveaxis(z, 1, 0).reshape(R, -1, 2), np.moveaxis(mask, 1, 0).reshape(R, -1)


class StageErrors(NamedTuple):
    """Errors of R runs at K steps."""

    position: NDArray  # (K, R, 2) [m] along and across the heading
    speed: NDArray  # (K, R) [m/s]
    heading: NDArray  # (K, R) [rad]
    length: NDArray  # (K, R) [m]
    width: NDArray  # (K, R) [m]
    nees: NDArray  # (K, R) of x, y, v and heading; 4 is ideal


def errors(m: NDArray, P: NDArray, x: NDArray) -> StageErrors:
    """Errors of moments m (K, R, 7), P (K, R, 7, 7) about the truth x (K, 7)."""
    e = m - x[:, None]
    e[..., PHI] = wrap_angle(e[..., PHI])
    four, along = e[..., :OMEGA], e[..., None, :2] @ rotation(x[:, None, PHI])
    nees = quadratic(four, P[..., :OMEGA, :OMEGA])
    return StageErrors(along[..., 0, :], e[..., SPEED], e[..., PHI], e[..., LENGTH], e[..., WIDTH], nees)


class AdaptationRuns(NamedTuple):
    """All runs of a method on a contour."""

    stages: dict[str, StageErrors]  # "before" and "smoothed": scans 1 to 101; "not adapted" and "adapted": the others
    lost: dict[str, NDArray]  # (R,) bool, off by more than 2 m at the end of a stage
    adapted: Adapted

    @property
    def kept(self) -> NDArray:
        """Runs (R,) that no stage lost."""
        return ~np.any(list(self.lost.values()), axis=0)


def run_stages(method: AdaptationMethod, model: SplineModel, runs: SimulatedRuns) -> AdaptationRuns:
    """Track the first circle, adapt, and go on with and without the new contour."""
    filter = method.filter(model)
    state, before = track(filter, runs, begin(filter, runs.mask.shape[1]), 0, ADAPT_AT)
    adapted = adapt(method, filter, runs, state, before)
    _, without = track(filter, runs, state, ADAPT_AT, STEPS)
    _, with_ = track(filter, runs, adapted.state, ADAPT_AT, STEPS)
    parts = {"before": before, "smoothed": adapted.smoothed, "not adapted": without, "adapted": with_}
    x = {name: runs.x[:ADAPT_AT] if name in EARLY else runs.x[ADAPT_AT:] for name in parts}
    stages = {name: errors(part.m, part.P, x[name]) for name, part in parts.items()}
    lost = {n: np.linalg.norm(e.position[-1], axis=-1) > LOST for n, e in stages.items() if n != "smoothed"}
    return AdaptationRuns(stages, lost, adapted)


EARLY = ("before", "smoothed")


def overlap(contour: SplineContour, outline: NDArray, inset: float = 0.1) -> NDArray:
    """Intersection over union (R,) of the curves with an outline (C, 2) [m] shrunk by `inset` [m]."""
    ring = areas(curve(contour.p, 400) * SIZE)
    return region_iou(ring, shapely.Polygon(outline).buffer(-inset, join_style="mitre"))

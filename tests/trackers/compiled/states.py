"""States and scans from which the compiled and the numpy form take one step each, and how both are compared."""

import os
from contextlib import closing

import gymnasium as gym
import numpy as np

import testbed  # noqa: F401  registers the ids
from sensors import find as find_radar
from trackers import find
from trackers.composed import Composed
from trackers.estimate import prior
from trackers.multi.tracker import MultiObjectTracker
from trackers.scan import Scan
from trackers.shade import Shade

STATES = int(os.environ.get("STATES", 20))  # of each scenario, in the slow tests
RADAR = find_radar("surround")
NAMES = ("imm-spline", "imm-htg")  # of the filters that have a compiled form
COMPILED = {name: find(name).on(RADAR.models) for name in NAMES}
NUMPY = {name: find(name, compiled=False).on(RADAR.models) for name in NAMES}


def recorded(name, scenario, decisions, seed=0):
    """Arguments of all calls of predict and update in a closed loop: ("predict", state, dt), ("update", state, ...)."""
    calls = []

    class Watched(Composed):
        def predict(self, state, dt):
            calls.append(("predict", state, dt))
            return super().predict(state, dt)

        def update(self, state, scan, *others):
            calls.append(("update", state, scan, *others))
            return super().update(state, scan, *others)

        update_among = update

    parts = NUMPY[name].place, NUMPY[name].motion, NUMPY[name].size
    tracker = MultiObjectTracker(Watched(*parts, compiled=False), RADAR.models, as_whole=True)
    with closing(gym.make(f"testbed/{scenario}-v0", tracker=tracker, radar="surround:compiled=off")) as env:
        env.reset(seed=seed)
        for _ in range(decisions):
            if any(env.step(1)[2:4]):
                break
    return [call for call in calls if call[1].motion.mu.size and not (call[0] == "predict" and call[2] == 0)]


def drawn(name, rng, T, M):
    """A state of T tracks that have seen something, however wild, and a scan with M detections of each, some masked."""
    filter = NUMPY[name]
    heading = rng.uniform(-np.pi, np.pi, T) + rng.choice([0, 2 * np.pi], T)
    length = rng.choice([1.9, 4.4, 6.4, 6.6, 16.0], T)
    size = np.stack([length, 0.3 * length + 0.4], -1).clip(0.6, 2.8)
    size[:, 0] = length
    pose = np.column_stack([rng.uniform(-40, 40, (T, 2)), heading])
    state = filter.init(prior(pose, rng.normal(0, 8, (T, 2)), rng.normal(0, 0.1, T), size))
    x, grids = state.motion, state.size
    m = x.m + rng.normal(0, 1, x.m.shape) * [0.3, 0.3, 0.1, 3.0, 0.1, 0.1, 0.03]
    m[rng.random(T) < 0.3, :, 3] -= 9.0  # backwards
    A = rng.normal(0, 0.3, x.P.shape) * np.sqrt(np.einsum("...ii->...i", x.P))[..., None]
    mu = rng.dirichlet(np.ones(x.mu.shape[-1]) * rng.choice([0.1, 3.0]), T)
    ahead, curvature = rng.choice([0.0, -0.4, -0.6], T), rng.choice([0.0, 0.03, -0.15], T)
    length, width = (A + np.cumsum(rng.normal(0, 0.4, A.shape), -2) - rng.exponential(2, A.shape) for A in grids[1:3])
    anchor, bent = rng.choice([-1.0, 0.0, 1.0], (T, 2)), rng.choice([0.0, 1.0, 9.0], T)
    behind = rng.exponential(rng.choice([0.0, 0.1, 3.0], (T, 2, 1)), (T, 2, filter.size.length.depths))
    belief = filter.size.belief(*(np.exp(A - A.max((1, 2), keepdims=True)) for A in (length, width)), behind, bent)
    size = grids._replace(
        anchor=anchor,
        length=length,
        width=width,
        belief=belief,
        behind=behind,
        bent=bent,
        fully_visible=rng.random(T) < 0.5,
        aside=rng.choice([0.0, 2.0, 20.0], T),
    )
    state = state._replace(motion=x._replace(mu=mu, m=m, P=x.P + A @ A.mT, ahead=ahead, curvature=curvature), size=size)
    return state, detections(rng, filter.estimate(state), M)


def detections(rng, box, M):
    """A scan (T, M) of boxes, by any of the sensors, from any side; of some boxes it lies far away."""
    T = len(box.pose)
    which = np.sort(rng.integers(0, len(RADAR.models), (T, M)), -1)
    aside = rng.uniform(-1.2, 1.2, (T, M, 2)) * box.size[:, None] / 2
    cos, sin = (f(box.pose[:, None, 2]) for f in (np.cos, np.sin))
    around = np.stack([cos * aside[..., 0] - sin * aside[..., 1], sin * aside[..., 0] + cos * aside[..., 1]], -1)
    point = box.pose[:, None, :2] + around + rng.choice([0.0, 0.0, 6.0], (T, 1, 2))
    reach = np.array([model.max_range for model in RADAR.models])[which]
    bearing = rng.uniform(-np.pi, np.pi, T)[:, None] + rng.choice([0.0, 2.0], (T, 1)) * which
    near = rng.uniform(0.5, 1.01, (T, M)) * np.minimum(reach, 40.0)
    place = point - near[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], -1)
    first = (which[:, :, None] == which[:, None, :]).argmax(-1) if M else which  # a sensor is at one place
    pose = np.concatenate([place, (bearing + rng.uniform(-0.7, 0.7, (T, 1)))[..., None]], -1)[
        np.arange(T)[:, None], first
    ]
    d = point - pose[..., :2]
    rate = rng.normal(0, 8, (T, M))
    rate[rng.random((T, M)) < 0.2] = rate[rng.random(T) < 0.4] = np.nan
    polar = np.stack([np.hypot(d[..., 0], d[..., 1]), np.arctan2(d[..., 1], d[..., 0]) - pose[..., 2], rate], -1)
    noise = RADAR.sigma[which]
    noise[rng.random(T) < 0.2] = np.nan
    mask = rng.random((T, M)) < 0.8
    mask[rng.random(T) < 0.2] = False
    polar[~mask] = rng.choice([np.nan, 0.0])
    return Scan(polar, mask, pose, rng.normal(0, 5, (T, M, 2)), noise, which)


def shaded(rng, T):
    """A scan that is nobody's, its owners, and what hides T tracks or some of them."""
    S, O = len(RADAR.models), rng.integers(0, 4)
    middle, half = rng.uniform(-np.pi, np.pi, (S, O)), rng.uniform(0.05, 1.5, (S, O))
    shade = Shade(
        rng.integers(0, T + 2, O), middle, half, rng.choice([0.0, 0.01, 0.1], (S, O)), rng.uniform(1, 30, (S, O))
    )
    return Scan.from_xy(np.zeros((1, 2))), np.array([-1]), shade


def assert_same(new, old, name="state", part=1e-8):
    """Both agree to this part of each number, or a tenth of it; of grids of logarithms the likelihoods do."""
    if isinstance(old, tuple):
        assert type(new) is type(old)
        for i, (a, b) in enumerate(zip(new, old, strict=True)):
            assert_same(a, b, f"{name}.{getattr(old, '_fields', range(len(old)))[i]}", part)
    elif old is None:
        assert new is None
    elif isinstance(old, np.ndarray):
        if name.endswith(("size.length", "size.width")):
            new, old = (np.exp(A - A.max((-2, -1), keepdims=True, initial=-1e300)) for A in (new, old))
        np.testing.assert_allclose(new, old, rtol=part, atol=part / 10, err_msg=name)
        assert new.shape == old.shape
        assert new.dtype == old.dtype
    else:
        assert new == old


def check(name, call, part=1e-8):
    """One step of both forms, and the estimates of what comes out."""
    kind, state, *arguments = call
    compiled, numpy = COMPILED[name], NUMPY[name]
    new, old = (getattr(filter, kind)(state, *arguments) for filter in (compiled, numpy))
    assert_same(new, old, "state", part)
    state, reference = (new, old) if kind == "predict" else (new[0], old[0])
    assert_same(compiled.estimate(state), numpy.estimate(reference), "estimate", part)
    assert_same(compiled.box(state), numpy.box(reference), "box", part)
    if kind == "update":
        assert_same(new[1].nis, old[1].nis, "nis", part)
        assert_same(compiled.reach(state), numpy.reach(reference), "reach", part)

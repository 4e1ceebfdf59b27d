"""The body of the data-region trackers, alone: a minute from straight behind, and through a U-turn."""

from functools import cache
from itertools import product

import numpy as np
import pytest

from sensors import RADARS
from sensors.scene import Ego, boxes_scene
from studies.papers.xu2023.enumeration import Enumeration
from studies.papers.xu2023.simulation import CAR, STEP, advance, detect, start
from trackers import Scan, find, prior
from trackers.batch import stack
from trackers.composed import Composed, composed
from trackers.dra.state import P1, P2, PLACE, VELOCITY, VX, W, X
from trackers.geometry import box_corners, cross, rotation, wrap_angle
from trackers.imm import moments

TRACKERS = ("dra", "dra-imm", "edra-imm")
FORMS = ("sequential", "soft", pytest.param(Enumeration(), id="joint", marks=pytest.mark.slow))
MINUTE = 600  # steps
BEHIND = -30.0  # [m] the radar of the reproduction's cases behind: the body keeps its heading, or it follows
AHEAD = 25.0  # [m] of the car before our radar


LOW, HIGH = np.array([3.4, 1.5]), np.array([5.8, 2.2])  # [m] what is a car, from the smallest to the largest


@cache
def paper_minute():
    """Targets (11,) and scans of the paper's radar on its straight part; the body keeps its heading, or it follows."""
    rng = np.random.default_rng(11)
    x = np.repeat(start()[None], 2, 0)
    radar = x.copy()
    radar[:, X] += BEHIND
    steps = []
    for _ in range(MINUTE):
        free, following = advance(x[:1], 0, rng, False), advance(x[1:], 0, rng, True)
        x, radar = np.concatenate([free, following]), advance(radar, 0, rng, False)
        steps.append((x, detect(x, radar, rng)))
    return start(), steps


@cache
def radar_minute():
    """The same of one car before the long-range radar of our car; what it detected, without false alarms."""
    rng, radar = np.random.default_rng(12), RADARS["front"]
    x = start()
    x[PLACE] = AHEAD, 0.0
    first, steps = x.copy(), []
    for k in range(MINUTE):
        x = x.copy()
        x[X] += STEP * x[VX]
        pose = np.array([x[X] - AHEAD, 0.0, 0.0])
        ego = Ego(pose, x[VELOCITY], 0.0, CAR, box_corners(pose, CAR))
        scene = boxes_scene([[*x[PLACE], 0.0]], [CAR], [x[VELOCITY]], ego=ego, time=k * STEP)
        scan, origin = radar.scan(scene, rng)
        steps.append((x, scan._replace(mask=origin.object == 0)))
    return first, steps


@cache
def u_turn():
    """Half a circle of 9 m radius at 4.7 m/s, then 3 s straight on, seen from a place beside it."""
    rng, w = np.random.default_rng(13), np.pi / 6
    x = start()[None]
    x[0, PLACE], x[0, VELOCITY] = (0.0, 0.0), (4.7, 0.0)
    radar = np.zeros_like(x)
    radar[0, PLACE], radar[0, VX] = (-25.0, 6.0), 1e-6  # stands, and points along x
    first, steps = x[0], []
    for k in range(120):
        x = x.copy()
        x[0, W] = w if 15 <= k < 75 else 0.0
        turn = rotation(x[0, W] * STEP)
        for pair in (VELOCITY, P1, P2):
            x[0, pair] = turn @ x[0, pair]
        x[0, PLACE] += STEP * x[0, VELOCITY]
        scan = detect(x, radar, rng)
        steps.append((x[0], Scan(scan.polar[0], scan.mask[0], scan.pose[0], scan.velocity[0], scan.noise)))
    return first, steps


def follow(filter, world):
    """Estimates, labels (steps, ...) as the signed area of the body, and true headings, over all steps.

    sizes is the prior of sizes that the multi-object tracker sets against the drift of the vertices.
    """
    first, steps = world
    lead = steps[0][0].shape[:-1]
    pose = np.zeros((*lead, 3))
    pose[..., :2] = first[PLACE] + [0.3, 0.2]
    velocity = np.broadcast_to(first[VELOCITY], (*lead, 2))
    state = filter.init(prior(pose, velocity=velocity, size_std=(0.4, 0.1)))
    estimates, areas, headings = [], [], []
    for x, scan in steps:
        state = filter.predict(state, STEP)
        state, _ = filter.update(state, scan)
        inner = state.place if isinstance(filter, Composed) else state
        m, _ = moments(inner.m, inner.P, inner.mu)
        along = x[..., P1] + x[..., P2]
        estimates.append(filter.estimate(state))
        areas.append(cross(m[..., P2], m[..., P1]))
        headings.append(np.arctan2(along[..., 1], along[..., 0]))
    return stack(estimates), np.array(areas), np.array(headings)


QUICK = (("dra", "sequential", radar_minute), ("edra-imm", "soft", paper_minute))  # each form and radar once
MINUTES = [
    pytest.param(*case, marks=() if case in QUICK else pytest.mark.slow)
    for case in product(TRACKERS, ("sequential", "soft", Enumeration()), (paper_minute, radar_minute))
]


@pytest.mark.parametrize(("name", "form", "world"), MINUTES)
def test_a_minute_straight_behind_leaves_a_car_and_the_names_of_its_vertices(name, form, world):
    """With the sizes of the layer around it; on the paper's radar and on ours."""
    estimate, area, heading = follow(composed(find(name, form=form), size="ends"), world())
    assert (estimate.size[-1] > LOW).all()
    assert (estimate.size[-1] < HIGH).all()
    assert area.min() > 0.5 * CAR.prod() / 2
    assert np.abs(wrap_angle(estimate.pose[..., 2] - heading)).max() < 0.15


@pytest.mark.slow
def test_alone_the_prior_of_rays_keeps_the_length_and_an_even_one_does_not():
    """Our radar sees the rear alone; an even prior expects every fifth detection in front and pulls the front back."""
    rays, _, _ = follow(find("edra-imm", form="soft"), radar_minute())
    even, _, _ = follow(find("dra-imm", form="soft"), radar_minute())
    assert rays.size[-1, 0] > 4.0 > 3.7 > even.size[-1, 0]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", TRACKERS)
def test_the_body_keeps_its_shape_and_heading_through_a_u_turn(name, form):
    estimate, area, heading = follow(composed(find(name, form=form), size="ends"), u_turn())
    np.testing.assert_allclose(estimate.size[-1], CAR, rtol=0.2)
    assert area.min() > 0.5 * CAR.prod() / 2
    error = np.abs(wrap_angle(estimate.pose[..., 2] - heading))
    assert error.max() < 0.4
    assert error[-10:].max() < 0.1


def test_a_single_model_without_turns_loses_the_body_in_a_u_turn():
    """The negative twin: constant velocity with the recommended noise takes range rates of the turn for places."""
    estimate, _, heading = follow(find("dra", parameters="recommended"), u_turn())
    assert np.abs(wrap_angle(estimate.pose[..., 2] - heading)).max() > 0.8

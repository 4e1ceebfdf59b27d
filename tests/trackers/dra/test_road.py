"""What vehicles on a road ask of data-region association: a heading at standstill, a bounded body, an honest length."""

from dataclasses import replace

import numpy as np
import pytest

from trackers import Scan, find, prior
from trackers.dra import Parameters
from trackers.dra.state import vertices
from trackers.geometry import rotation, unit, wrap_angle
from trackers.random_matrix.feldmann import visible_offset

SIZE = np.array([4.6, 1.86])
PAPER = Parameters()  # no floor of the length's std, a heading along any velocity


def outline(rng, pose, n=8, noise=0.1):
    """Detections (..., n, 2) of the two sides of a car that a sensor at the origin sees, even along them."""
    M = rotation(pose[..., 2])
    eye = (M.mT @ -pose[..., :2, None])[..., 0]
    shown = np.where(np.abs(eye) > SIZE / 2, np.abs(eye), 0) * SIZE[::-1]
    end = rng.random((*pose.shape[:-1], n)) < (shown[..., 0] / shown.sum(-1))[..., None]
    along, aside = rng.uniform(-0.5, 0.5, (2, *end.shape))
    near = np.sign(eye)[..., None, :] / 2
    body = np.stack([np.where(end, near[..., 0], along), np.where(end, aside, near[..., 1])], -1) * SIZE
    return pose[..., None, :2] + body @ M.mT + rng.normal(0, noise, (*end.shape, 2))


def followed(f, speed, rates, vague, cars=12, scans=50, seed=0):
    """Last poses (cars, 3) and estimate of cars 20 m ahead, driving away or standing, of many headings."""
    rng = np.random.default_rng(seed)
    heading = np.zeros(cars) if speed else np.linspace(-np.pi, np.pi, cars, endpoint=False) + 0.3
    place = np.stack([np.full(cars, 20.0), np.linspace(-6, 6, cars) if speed else np.full(cars, 3.0)], -1)
    velocity = speed * unit(heading)
    size, std = ((8.0, 2.2), (3.0, 0.3)) if vague else (SIZE, (0.55, 0.11))
    for k in range(scans):
        pose = np.concatenate([place + 0.1 * k * velocity, heading[:, None]], -1)
        scan = Scan.from_xy(outline(rng, pose), noise=(0.1, 0.004, 0.1))
        if rates:
            polar = scan.polar.copy()
            polar[..., 2] = (scan.sight * velocity[:, None]).sum(-1) + rng.normal(0, 0.1, polar.shape[:-1])
            scan = scan._replace(polar=polar)
        if k == 0:
            start = np.concatenate([scan.xy.mean(-2), (heading + rng.normal(0, 0.1, cars))[:, None]], -1)
            start[:, :2] -= 0.85 * visible_offset(start, np.broadcast_to(size, (cars, 2)), np.zeros((cars, 2)))
            state = f.init(
                prior(
                    start,
                    velocity=velocity + rng.normal(0, 0.7, (cars, 2)),
                    size=np.broadcast_to(size, (cars, 2)),
                    size_std=std,
                    heading_std=0.1,
                    velocity_std=1.0,
                    position_std=0.6,
                )
            )
        else:
            state = f.predict(state, 0.1)
        state, _ = f.update(state, scan)
    return pose, f.estimate(state)


def heading_error(f, rates, vague):
    """RMS error of the heading [deg] of standing cars after 5 s."""
    pose, box = followed(f, 0.0, rates, vague)
    return np.degrees(np.sqrt(np.mean(wrap_angle(box.pose[:, 2] - pose[:, 2]) ** 2)))


@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize(("name", "most"), [("dra", 45), ("edra-imm", 25)])
def test_a_standing_car_keeps_its_heading(name, most, rates):
    assert heading_error(find(name), rates, vague=False) < most


@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize(("name", "least"), [("dra", 45), ("edra-imm", 40)])
def test_with_a_heading_along_any_velocity_a_standing_car_turns(name, least, rates):
    f = find(name)
    assert heading_error(replace(f, parameters=replace(f.numbers, heading_speed=0.0)), rates, vague=False) > least


@pytest.mark.parametrize("rates", [False, True])
def test_a_car_that_may_have_any_length_does_not_grow(rates):
    _, box = followed(find("edra-imm"), 0.0, rates, vague=True)
    assert box.size[:, 0].max() < 8.5


def test_with_the_numbers_of_the_paper_it_grows():
    _, box = followed(replace(find("edra-imm"), parameters=PAPER), 0.0, rates=True, vague=True)
    assert box.size[:, 0].max() > 10


def length_nees(f):
    _, box = followed(f, 8.0, True, vague=False, cars=24)
    return np.mean(((box.size[:, 0] - SIZE[0]) / box.size_std[:, 0]) ** 2)


def test_with_the_floor_the_length_is_less_certain():
    assert length_nees(find("edra-imm")) < 8


def test_without_a_floor_the_length_is_too_certain():
    f = find("edra-imm")
    assert length_nees(replace(f, parameters=replace(f.numbers, least_length_std=0.0))) > 16


def test_the_floor_is_one_of_the_length_alone():
    f = replace(find("edra-imm"), parameters=Parameters(least_length_std=0.2))
    base = replace(f, parameters=Parameters())
    box = prior(np.array([20.0, 3.0, 0.4]), velocity=(8.0, 2.0), size=SIZE, size_std=(0.3, 0.1), heading_std=0.05)
    corners = vertices(box.pose[2], box.size).reshape(2, 2) + box.pose[:2]
    scan = Scan.from_xy(np.concatenate([corners, corners - 4.6 * unit(0.4)]), noise=(0.1, 0.004, 0.1))
    (state, _), (other, _) = f.update(f.init(box), scan), base.update(base.init(box), scan)
    new, old = f.estimate(state), base.estimate(other)
    assert old.size_std[0] < 0.2 * old.size[0]
    np.testing.assert_allclose(new.size_std[0], 0.2 * new.size[0], rtol=0.02)
    np.testing.assert_allclose(new.size_std[1], old.size_std[1], rtol=1e-6)
    np.testing.assert_allclose(new.heading_std, old.heading_std, rtol=1e-6)
    np.testing.assert_allclose(new.pose, old.pose, rtol=1e-9)

"""The density of detections over the five regions: what the association of many objects asks of the filter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers import MultiObjectTracker, Scan, SensorModel, find, prior
from trackers.dra.regions import log_density
from trackers.dra.state import swung, vertices
from trackers.filter import Abilities
from trackers.geometry import cross, rotation, unit

SIZE = np.array([4.8, 1.8])
NAMES = ("dra", "dra-imm", "edra-imm")


@pytest.mark.parametrize("prior_of", [(0.2, 0.2, 0.2, 0.2, 0.2), (0.1, 0.05, 0.5, 0.05, 0.3)])
def test_the_density_of_detections_integrates_to_one(prior_of):
    x, y = np.meshgrid(np.arange(-5, 5, 0.05), np.arange(-4, 4, 0.05))
    e = np.stack([x.ravel(), y.ravel()], -1)
    std, P = np.full(e.shape, [0.3, 0.4]), np.tile(prior_of, (len(e), 1))
    total = np.exp(log_density(e, np.tile(SIZE, (len(e), 1)), std, P)).sum() * 0.05**2
    np.testing.assert_allclose(total, 1, atol=1e-4)


def test_on_the_rear_side_the_density_is_that_of_a_line_with_noise():
    rear_only, std = np.array([[0, 0, 1.0, 0, 0]]), np.array([[0.1, 1e-3]])
    got = np.exp(log_density(np.array([[-2.4, 0.3]]), SIZE[None], std, rear_only))
    np.testing.assert_allclose(got, 1 / (0.1 * np.sqrt(2 * np.pi)) / SIZE[1], rtol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), name=st.sampled_from(NAMES))
def test_the_density_turns_and_moves_with_the_world(seed, name):
    rng = np.random.default_rng(seed)
    angle, shift = rng.uniform(-3, 3), rng.normal(0, 50, 2)
    f, xy, sensor = find(name), rng.normal(0, 2, (6, 2)), np.array([-20.0, 5.0, 0.3])
    R = rotation(angle)
    track, detection = np.zeros(6, int), np.arange(6)

    def log_p(place, heading, points, eye):
        state = f.init(prior((*place, heading), velocity=8 * unit(np.array(heading)), size_std=(0.3, 0.1)))
        states = type(state)(*(a[None] for a in state))
        return f.log_spatial(states, Scan.from_xy(points, pose=eye), track, detection)

    eye = np.array([*(R @ sensor[:2] + shift), sensor[2] + angle])
    np.testing.assert_allclose(
        log_p(shift, angle, xy @ R.T + shift, eye), log_p((0.0, 0.0), 0.0, xy, sensor), rtol=1e-6, atol=1e-6
    )


def test_with_rays_the_density_is_highest_at_the_side_that_the_sensor_sees():
    state = find("edra-imm").init(prior(np.array([[20.0, 0, 0]]), velocity=np.array([[10.0, 0]])))
    ends = Scan.from_xy(np.array([[20 - 2.3, 0.0], [20 + 2.3, 0.0]]), pose=np.zeros(3))
    rear, front = find("edra-imm").log_spatial(state, ends, np.zeros(2, int), np.arange(2))
    assert rear > front + 1


def test_all_three_tell_the_multi_object_tracker_where_detections_lie():
    sensor = SensorModel(mount=(0.0, 0.0, 0.0), max_range=100.0, fov=2.0)
    for name in NAMES:
        assert Abilities.of(find(name)).has("log_spatial")
        assert MultiObjectTracker(find(name), (sensor,)).can.log_spatial is not None


@given(angle=st.floats(-3, 3), length=st.floats(2, 18), width=st.floats(0.8, 2.9), variance=st.floats(1e-6, 1e-2))
def test_a_body_that_swings_becomes_uncertain_in_heading_and_in_nothing_else(angle, length, width, variance):
    m, size = np.zeros(11), np.array([length, width])
    m[7:] = vertices(np.array(angle), size)
    added = swung(m, np.zeros((11, 11)), variance)
    along, left = np.concatenate([unit(np.array(angle))] * 2), np.concatenate([unit(np.array(angle + np.pi / 2))] * 2)
    np.testing.assert_allclose(along @ added[7:, 7:] @ along, 0, atol=1e-9)  # length
    left_of = left * [1, 1, -1, -1]
    np.testing.assert_allclose(left_of @ added[7:, 7:] @ left_of, 0, atol=1e-9)  # width
    np.testing.assert_allclose(left @ added[7:, 7:] @ left / length**2, variance, rtol=1e-9)
    assert cross(m[9:11], m[7:9]) > 0
    assert not added[:7].any()

"""The compiled form of the radar gives the same scans as the numpy form, from the same random numbers."""

from contextlib import closing
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import testbed  # noqa: F401  registers the ids
from scenarios import SCENARIOS
from sensors import RADARS, find
from sensors import compiled as form
from sensors.scene import boxes_scene
from trackers.compiled import REFUSED, available

pytestmark = pytest.mark.skipif(not available(), reason="needs the extra `fast`")
SURROUND = RADARS["surround"]
# All that a scan can hold: cells, scatter, depth, an even and an exponential one, a full circle of rays, wheels.
MIXED = replace(SURROUND, sensors=(
    *SURROUND.sensors,
    replace(RADARS["lidar-1deg"].sensors[0], max_range=60.0, share_volume=0.5, depth_volume=0.4, depth_contour=0.0),
    replace(RADARS["nuscenes-like"].sensors[1], share_scatter=0.4, count_shape=0.0, grazing=0.9),
    replace(RADARS["nuscenes-like"].sensors[2], fold_rate=7.0, wheels=0.6, cell_power=0.5),
))  # fmt: skip


def check_equal(radar, scene, seed=0):
    """Scan and origin of both forms agree to rounding, and so does the state of the generator afterwards."""
    numpy, compiled = np.random.default_rng(seed), np.random.default_rng(seed)
    a, b = replace(radar, compiled=False).scan(scene, numpy), radar.scan(scene, compiled)
    for part, other in zip(a, b, strict=True):
        for name, x, y in zip(part._fields, part, other, strict=True):
            np.testing.assert_allclose(y, x, rtol=1e-12, atol=1e-12, err_msg=name)
    assert numpy.random() == compiled.random()
    return a[0]


def check_scenario(name, decisions):
    with closing(gym.make(f"testbed/{name}-v0", tracker="truth", radar="front")) as env:
        env.reset(seed=5)
        for seed in range(decisions):
            scene = env.get_wrapper_attr("truth")
            assert form.look(SURROUND._fan, SURROUND._beams(np.zeros((6, 3))).pose, scene) is not None
            check_equal(SURROUND, scene, seed)
            check_equal(MIXED, scene, seed)
            if any(env.step(1)[2:4]):
                break


@pytest.mark.parametrize("name", ["cut-in", "truck-convoy", "articulated-turn"])
def test_scans_of_a_scenario_are_the_same(name):
    check_scenario(name, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_scans_of_every_scenario_are_the_same(name):
    check_scenario(name, 40)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.booleans())
def test_scans_of_boxes_anywhere_are_the_same(seed, boxes, walled):
    """Boxes that overlap, stand around a sensor, or have an edge in its line."""
    rng = np.random.default_rng(seed)
    spread = rng.choice([3.0, 20.0, 80.0])
    pose = rng.uniform(-spread, spread, (boxes, 3)) * [1, 0.3, 0.05]
    pose[0] = rng.choice([0.0, np.pi / 2]), rng.choice([0.0, 1.0]), 0.0
    scene = boxes_scene(
        pose, rng.uniform(0.5, 16.0, (boxes, 2)), rng.normal(0, 20, (boxes, 2)), rng.normal(0, 1, boxes)
    )
    if walled:
        scene = scene._replace(walls=rng.uniform(-40, 40, (6, 2, 2)))
    check_equal(MIXED, scene, seed)


def test_what_has_no_compiled_form_or_is_refused_goes_the_other_way(monkeypatch):
    scene = boxes_scene(np.array([[12.0, 0.0, 0.0], [20.0, 0.0, 0.0]]), np.array([[4.6, 1.8]] * 2))
    looks = []
    monkeypatch.setattr("sensors.radar.look", lambda *given: looks.append(form.look(*given)) or looks[-1])
    for name in ("surround-ghosts", "imaging", "imaging-roadside", "surround:compiled=off"):
        find(name).scan(scene, np.random.default_rng(0))
    assert looks == []
    apart = scene._replace(bodies=scene.bodies._replace(owner=np.array([1, 0])))
    check_equal(SURROUND, apart)
    check_equal(SURROUND, boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))))
    assert looks == [None, None]
    monkeypatch.setenv(REFUSED, "off")
    SURROUND.scan(scene, np.random.default_rng(0))
    assert len(looks) == 2

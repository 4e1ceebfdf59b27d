"""Depths lie along the line of sight: sides that are seen aslant are where their detections are, (ENDS.52)."""

import numpy as np
import pytest

from tests.trackers.size.bodies import DT, NOISE, WHOLE, scan_of
from trackers.estimate import prior
from trackers.geometry import unit
from trackers.scan import DepthProfile, SensorModel
from trackers.size.hits import face_depth
from trackers.size.posterior import SizePosterior
from trackers.size.profile import Profiles

LENGTH, WIDTH, CENTRE = 4.5, 1.85, np.array([22.25, 4.5])  # of a car ahead in the next lane, its side seen at 0.2 rad
DEPTH = 0.12  # [m] mean, along the line of sight


def of_the_next_lane(rng, n=12):
    """n detections (n, 2) of its rear and of its near side, a fifth of them from inside."""
    sine = np.abs(unit(np.arctan2(*CENTRE[::-1])))
    shown = np.sqrt(sine) * [WIDTH, LENGTH]
    rear = rng.random(n) < shown[0] / shown.sum()
    x = np.where(rear, -LENGTH / 2, rng.uniform(-LENGTH / 2, LENGTH / 2, n))
    y = np.where(rear, rng.uniform(-WIDTH / 2, WIDTH / 2, n), -WIDTH / 2)
    xy = CENTRE + np.stack([x, y], -1)
    u = xy / np.hypot(*xy.T)[:, None]
    room = np.minimum(*((CENTRE + np.array([LENGTH, WIDTH]) / 2 - xy) / u).T)  # to where the ray leaves the car
    depth = np.where(rng.random(n) < 0.2, rng.random(n) * room, np.minimum(rng.exponential(DEPTH, n), room))
    return xy + depth[:, None] * u + rng.normal(0, NOISE, (n, 2))


def width_told(slant, scans=60):
    """Width [m] by the detections alone, about the box as it is."""
    sensors = (SensorModel(max_range=np.inf, fov=2 * np.pi, profile=DepthProfile(slant=slant)),)
    f, rng = SizePosterior(sensors=sensors, fleet=WHOLE, standing=6), np.random.default_rng(0)
    box, state = prior((*CENTRE, 0.0), size=(LENGTH, WIDTH)), f.born(())
    for _ in range(scans):
        state, _ = f.corrected(f.predicted(state, DT), box.pose, box, scan_of(of_the_next_lane(rng)), None)
    p = np.exp(state.width - state.width.max()).sum(-1)
    return p @ f.width.sizes / p.sum()


def test_a_car_of_the_next_lane_is_as_wide_as_it_is():
    """The negative twin expects its side as deep inside as a face that is seen straight."""
    width = width_told(1.0)
    assert width == pytest.approx(WIDTH, abs=0.06)
    assert width_told(0.0) > width + 0.06


@pytest.mark.parametrize("slant", [0.0, 0.5, 1.0])
def test_the_depth_of_a_face_by_hand(slant):
    profile = DepthProfile(depth=0.2, depth_std=0.1, slant=slant)
    sheets = Profiles.of((SensorModel(profile=profile),)).at(np.zeros(2, int))
    found = face_depth(sheets, np.array([[0.6, -0.8], [-1.0, 0.0]]))
    less = np.array([[0.6, 0.8], [1.0, 0.0]]) ** slant
    np.testing.assert_allclose(found[..., 0], 0.2 * less)
    np.testing.assert_allclose(found[..., 1], 0.1 * less)


@pytest.mark.parametrize(
    ("given", "slant"), [({}, 1.0), ({"hides_within": 0.01}, 0.0), ({"inside_depth": 1.3}, 0.0), ({"slant": 0.5}, 0.5)]
)
def test_outlines_and_an_inside_that_thins_out_have_none_unless_they_say_so(given, slant):
    assert DepthProfile(**given).slant == slant


@pytest.mark.parametrize("field", ["depth", "depth_std", "surface_std", "inside_depth", "grazing"])
def test_a_value_that_is_not_a_number_is_refused(field):
    with pytest.raises(ValueError, match=field):
        DepthProfile(**{field: np.nan})


@pytest.mark.parametrize("slant", [-0.1, 1.1, np.nan])
def test_a_slant_beyond_its_range_is_refused(slant):
    with pytest.raises(ValueError, match="slant must be within 0 and 1"):
        DepthProfile(slant=slant)

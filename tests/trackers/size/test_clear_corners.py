"""A contour filter with a size posterior where end and side of a vehicle are both in clear view of a dense sensor."""

from dataclasses import replace

import numpy as np
import pytest

import sensors
from testbed.evaluation.metrics import box_iou
from testbed.learn.detections import lone_vehicle
from tests.trackers.size.bodies import DT, sized
from trackers import find, prior
from trackers.scan import DepthProfile

# Vehicles at rest, obliquely ahead, of which an end and a side are seen: outline, pose and size.
VEHICLES = (
    ("car", (14.0, 3.0, 0.6), (3.9, 1.75)),
    ("car", (18.0, -5.0, 0.5), (5.1, 2.0)),
    ("car", (12.0, 4.0, 2.6), (4.5, 1.85)),
    ("truck", (20.0, 6.0, 0.5), (8.5, 2.5)),
)
SCANS, SETTLED = 24, 12


def mean_iou(radar, filter):
    """Mean box IoU of all vehicles in the scans from `SETTLED` on.

    All begin as cars of 4.6 m, half a metre off.
    """
    found = []
    for seed, (outline, pose, size) in enumerate(VEHICLES):
        rng, pose, size = np.random.default_rng(seed), np.array(pose), np.array(size)
        state = filter.init(prior(pose + np.array([0.3, 0.4, 0.05]), size=(4.6, 1.86)))
        for k in range(SCANS):
            scan, origin = radar.scan(lone_vehicle(outline, pose, size), rng)
            own = scan._replace(mask=scan.mask & (origin.object == 0))
            state = filter.update(filter.predict(state, DT), own)[0]
            if k >= SETTLED:
                e = filter.estimate(state)
                found.append(box_iou(e.pose, e.size, pose, size))
    return np.mean(found)


def with_profile(radar, profile):
    """The spline filter with a size posterior, with the data sheets of a radar but for where its detections lie."""
    return sized(find("pmht-spline"), sensors=tuple(replace(model, profile=profile) for model in radar.models))


@pytest.mark.parametrize("name", ["lidar-1deg", "imaging"])
def test_where_corners_are_clear_a_size_posterior_is_no_worse_than_the_filter_alone(name):
    radar = sensors.find(name)
    assert mean_iou(radar, sized(find("pmht-spline"), sensors=radar.models)) > mean_iou(radar, find("pmht-spline"))


@pytest.mark.parametrize(("name", "other"), [("lidar-1deg", "imaging"), ("imaging", "lidar-1deg")])
def test_with_the_profile_of_another_sensor_it_is_worse(name, other):
    radar = sensors.find(name)
    own = mean_iou(radar, sized(find("pmht-spline"), sensors=radar.models))
    assert mean_iou(radar, with_profile(radar, sensors.find(other).models[0].profile)) < own - 0.01


@pytest.mark.parametrize("name", ["lidar-1deg", "imaging"])
def test_with_the_default_profile_it_is_worse(name):
    radar = sensors.find(name)
    own = mean_iou(radar, sized(find("pmht-spline"), sensors=radar.models))
    assert mean_iou(radar, with_profile(radar, DepthProfile())) < own - 0.01

"""The length from the end in view, where the one that faces the sensors is out of it; with the negative twin."""

import numpy as np
import pytest

from tests.trackers.size.bodies import DT, WHOLE, scan_of, sized
from trackers import SensorModel, find, prior
from trackers.size.evidence import open_near_end
from trackers.size.hits import Boxes, hits_of
from trackers.size.profile import Profiles

BEHIND = SensorModel(mount=(0.0, 0.0, np.pi), max_range=150.0, fov=np.radians(20.0))
REAR, SIDE = -19.1, 3.07  # [m] of a car in the next lane behind, of whose side the view ends at -17.4
IN_VIEW, SHORT = (-18.2, SIDE + 0.43, 0.0), (2.1, 0.86)  # the box of a motorcycle, where detections are


def side_in_view(rng, n=3):
    """Detections (n, 2) of the side that faces the radar, as far as it is in view."""
    x = rng.uniform(REAR, -SIDE / np.tan(np.radians(10.0)), n)
    return np.stack([x, np.full(n, SIDE + 0.1)], -1) + rng.normal(0, 0.1, (n, 2))


def turned(scan):
    """The scan of a radar that faces backwards, in whose field of view the detections are; nothing moves."""
    polar, noise, pose = scan.polar.copy(), scan.noise.copy(), np.array([[0.0, 0.0, np.pi]])
    polar[:, 1:] = np.stack([polar[:, 1] - np.pi, np.zeros(len(polar))], -1)
    noise[:, 2] = 0.1
    return scan._replace(polar=polar, pose=pose, noise=noise)


def after(scans=25, **parameters):
    """The estimate after so many scans of what is in view of the car, and the anchor of its length."""
    f = sized(find("pmht-spline"), fleet=WHOLE, sensors=(BEHIND,), **parameters)
    state, rng = f.init(prior(IN_VIEW, size=SHORT, position_std=0.3)), np.random.default_rng(0)
    for _ in range(scans):
        state = f.update(f.predict(state, DT), turned(scan_of(side_in_view(rng))))[0]
    return f.estimate(state), state.size.anchor[0]


def test_a_car_of_which_the_rear_part_is_in_view_is_counted_from_its_rear():
    e, anchor = after()
    assert anchor == -1
    assert e.size[0] > 3.0
    assert e.size_std[0] > 0.4  # its front may be anywhere
    assert abs(e.pose[0] - e.size[0] / 2 - REAR) < 3 * e.edges[1] < 1.0


def test_counted_from_the_front_it_would_be_a_motorcycle():
    e, anchor = after(open_above=np.inf)
    assert anchor == 1
    assert e.size[0] < 2.6
    assert e.size_std[0] < 0.6


def boxes_seen(pose, size, anchor=1.0):
    """Whether the near end of a box is open, of a detection by the radar behind."""
    hits = hits_of(
        turned(scan_of(np.array([[-18.0, SIDE]]))), (np.array([0]),), np.zeros(1, int), np.array([pose]),
        Profiles.of((BEHIND,)), 0.1,
    )  # fmt: skip
    return open_near_end(hits, Boxes(np.array([pose]), np.array([size]), np.array([[anchor, -1.0]])), np.zeros(1, int))


@pytest.mark.parametrize(
    ("pose", "anchor", "found"),
    [
        ((-17.0, 4.0, 0.0), 1.0, True),  # from -19 to -15: of the rear 0.3 m are in view, of the front nothing
        ((-17.0, 4.0, 0.0), -1.0, False),  # the rear is
        ((-21.0, 4.0, 0.0), 1.0, False),  # both are
        ((-13.0, 4.0, 0.0), 1.0, False),  # neither is
    ],
)
def test_an_end_is_open_where_the_other_one_alone_is_in_view(pose, anchor, found):
    assert boxes_seen(pose, (4.0, 1.8), anchor).tolist() == [found]

"""Platoons: how far apart they start, and that they keep it."""

from itertools import pairwise

import numpy as np
import pytest

from scenarios.networks import straight
from scenarios.stage import Flow, Stage

LANE = ("a", "b", 1)


def platoon(headway, kinds=("car", "car", "car")):
    """Vehicles of a flow at 20 m/s without spread, front to back."""
    return Stage(straight(), np.random.default_rng(0)).fill(Flow(LANE, 300.0, 20.0, kinds, 0.0, headway))


def test_a_longer_headway_sets_a_platoon_further_apart():
    """At the steady gap of the IDM, (5 + 20 T) / sqrt(1 - 1.2^-4) [m]: 1 s more is 20 / 0.71955 = 27.795 m more."""
    near, far = ([v.position[0] for v in platoon(headway)] for headway in (0.8, 1.8))
    np.testing.assert_allclose(np.diff(near) - np.diff(far), 27.795, atol=1e-3)


@pytest.mark.parametrize("headway", [0.8, 1.2, 2.5])
def test_followers_of_a_platoon_neither_brake_nor_close_up(headway):
    """Their model has the headway of the flow: another one would brake or accelerate at once."""
    vehicles = platoon(headway, ("truck", "car", "van"))
    for leader, follower in pairwise(vehicles):
        assert follower.acceleration(follower, leader) == pytest.approx(0.0, abs=0.1)

"""Platoons: how far apart they start, and that they keep it. Sizes: drawn apart from everything else."""

from itertools import pairwise

import numpy as np
import pytest

from scenarios.bodies import rear_extent
from scenarios.courses import follow_lane
from scenarios.drivers import steady_gap
from scenarios.longitudinal import AXIS
from scenarios.networks import straight
from scenarios.stage import Flow, Stage

LANE = ("a", "b", 1)
KINDS = ("car", "van", "articulated", "truck", "bus", "motorcycle", "tractor")


def platoon(headway, kinds=("car", "car", "car")):
    """Vehicles of a flow at 20 m/s without spread, front to back."""
    return Stage(straight(), np.random.default_rng(0)).fill(Flow(LANE, 300.0, 20.0, kinds, 0.0, headway))


def test_a_longer_headway_sets_a_platoon_further_apart():
    """At the steady gap of the IDM, (5 + 20 T) / sqrt(1 - 1.2^-4) [m]: 1 s more is 20 / 0.71955 = 27.795 m more."""
    near, far = ([v.position[0] for v in platoon(headway)] for headway in (0.8, 1.8))  # of the same sizes
    np.testing.assert_allclose(np.diff(near) - np.diff(far), 27.795, atol=1e-3)


@pytest.mark.parametrize("headway", [0.8, 1.2, 2.5])
def test_followers_of_a_platoon_neither_brake_nor_close_up(headway):
    """Their model has the headway of the flow: another one would brake or accelerate at once."""
    vehicles = platoon(headway, ("truck", "car", "van"))
    for leader, follower in pairwise(vehicles):
        assert follower.acceleration(follower, leader) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("from_rear", [False, True])
def test_vehicles_of_all_lengths_start_at_the_same_bumper_gap(from_rear):
    stage = Stage(straight(), np.random.default_rng(0))
    placed = stage.fill(Flow(LANE, 600.0, 20.0, KINDS, 0.0, 1.2, from_rear))
    gaps = [a.position[0] - rear_extent(a) - b.position[0] - b.LENGTH / 2 for a, b in pairwise(placed)]
    np.testing.assert_allclose(gaps, steady_gap(20.0, 24.0, 1.2))
    front = placed[0].position[0] + placed[0].LENGTH / 2
    rear = placed[-1].position[0] - rear_extent(placed[-1])
    assert abs((rear if from_rear else front) - 600.0) <= 4.0


@pytest.mark.parametrize("kind", KINDS)
def test_prescribed_vehicles_and_drivers_both_vary_in_size(kind):
    stage = Stage(straight(), np.random.default_rng(0))
    driven = [stage.drive(kind, LANE, 100.0 * k, 20.0) for k in range(5)]
    prescribed = [stage.prescribe(kind, follow_lane(AXIS, 100.0 * k, 20.0)) for k in range(5)]
    lengths = [v.LENGTH / 2 + rear_extent(v) for v in (*driven, *prescribed)]
    assert len(set(lengths)) > 5  # some buses and trailers have one greater length


def test_sizes_do_not_draw_from_the_stream_of_the_traffic():
    rng, untouched = np.random.default_rng(5), np.random.default_rng(5)
    stage = Stage(straight(), rng)
    sizes = [stage.size(kind) for kind in KINDS]
    assert rng.uniform() == untouched.uniform()
    again = Stage(straight(), np.random.default_rng(5))
    np.testing.assert_array_equal(sizes, [again.size(kind) for kind in KINDS])
    following = Stage(straight(), rng)  # of the next episode
    assert not np.array_equal(sizes, [following.size(kind) for kind in KINDS])

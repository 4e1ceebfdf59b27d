"""A batch equals its members, for every registered filter, on the scans of a rig in traffic.

Drawn detections are not enough for this law: all objects then have as many detections at the same distances, and need
as many iterations. Here some fill the view of two radars and others have one detection or none.
"""

from dataclasses import replace

import numpy as np
import pytest

from sensors.rigs import RADARS
from testbed.check.draws import arrays
from tests.testbed.evaluation.road_world import CAR, RATE, TRUCK, Vehicle, World, record
from trackers import TRACKERS, find, prior
from trackers.batch import take
from trackers.composed import Composed

PLACES = [(-2, -1, TRUCK), (4, 1, CAR), (18, 0, TRUCK), (-15, 0, CAR), (14, -1, CAR), (-3, -2, CAR), (9, -2, CAR)]
WORLD = World(tuple(Vehicle(s, lane, 24.0 + 2 * lane, size) for s, lane, size in PLACES))

# Filters not listed agree to the last bit. The first three predict all rows of a batch in one matrix product, which is
# added up in another order for one row. The others pad to the member with most detections, and sums with more zeros
# are rounded otherwise; of two such sums in (DRA.25), which almost cancel, the difference is taken.
# Size posteriors have such products over all rows.
ROUNDING = {
    "rm-koch": 1e-12,
    "rm-vmm": 1e-12,
    "dra": 1e-10,
    "dra-imm": 1e-9,
    "edra-imm": 1e-9,
    "pmht-spline-adaptive": 1e-12,
    "imm-htg": 1e-11,
    "imm-spline": 1e-11,
}
EVERY = 3  # scans; members are compared at one of them


@pytest.fixture(scope="module")
def recorded():
    """Scenes and scans of a second, and which detections (T, M) are of which object."""
    steps = record(WORLD, 1.0, seed=3, radar=lambda time: RADARS["surround"])
    objects = np.arange(len(PLACES))[:, None]
    return [(scene.objects, scan, scan.mask & (origin.object == objects)) for scene, scan, origin in steps]


def filter_of(name):
    """The registered filter on the rig; one that adapts a few objects at a time may adapt all of them."""
    f = find(name)
    f = f.on(RADARS["surround"].models) if isinstance(f, Composed) else f
    return replace(f, at_once=len(PLACES)) if hasattr(f, "at_once") else f


def about(objects):
    """Priors that are off by what a track is."""
    rng = np.random.default_rng(1)
    return prior(
        objects.pose + rng.normal(0, [0.3, 0.3, 0.03], objects.pose.shape),
        velocity=objects.velocity + rng.normal(0, 0.5, objects.velocity.shape),
        size=objects.size * rng.uniform(0.85, 1.15, objects.size.shape),
    )


@pytest.mark.parametrize("name", TRACKERS)
def test_a_batch_equals_its_members(name, recorded):
    f, state = filter_of(name), None
    for k, (objects, scan, mask) in enumerate(recorded):
        before, dt = (f.init(about(objects)), 0.0) if state is None else (state, 1 / RATE)
        polar = np.broadcast_to(scan.polar, (*mask.shape, 3))
        state, info = f.update(f.predict(before, dt), scan._replace(polar=polar, mask=mask))
        whole = arrays((state, f.estimate(state), info.n, info.eps, info.S))
        for i, own in enumerate(mask) if k % EVERY == 0 else ():
            one, its = f.update(f.predict(take(before, i), dt), scan._replace(mask=own))
            alone = arrays((one, f.estimate(one), its.n, its.eps, its.S))
            for a, b in zip(whole, alone, strict=True):
                np.testing.assert_allclose(a[i], b, rtol=ROUNDING.get(name, 0), atol=ROUNDING.get(name, 0))

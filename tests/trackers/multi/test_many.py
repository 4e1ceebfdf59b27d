"""What is found by search among many tracks is what looking at all pairs finds, to the last digit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.trackers.multi.known_objects import scan_of
from trackers import SensorModel, prior
from trackers.geometry import unit
from trackers.multi import association
from trackers.multi.association import Association
from trackers.multi.visibility import NEARER, SHADOW, SensorArray, first_hits, first_hits_of_few

SENSORS = SensorArray.of((SensorModel(max_range=200.0, fov=np.pi),))


def traffic(rng, T, extent=60.0):
    """T tracks around the origin, as uncertain as tracks are."""
    pose = np.c_[rng.uniform(-extent, extent, (T, 2)), rng.uniform(-np.pi, np.pi, T)]
    return prior(
        pose, velocity=rng.normal(0, 10, (T, 2)), size=rng.uniform((2.0, 1.0), (16.0, 3.0), (T, 2)),
        size_std=rng.uniform(0.05, 1.0, (T, 2)), position_std=rng.uniform(0.1, 2.0, T),
    )  # fmt: skip


@pytest.mark.parametrize("noise", [(0.1, 0.002, 0.1), (1.0, 0.03, 0.5)])
@given(st.integers(2, 25), st.integers(2, 150), st.integers(0, 2**32 - 1))
def test_claims_by_search_are_those_of_all_pairs(noise, T, M, seed):
    rng = np.random.default_rng(seed)
    estimate = traffic(rng, T)
    near = estimate.pose[rng.integers(0, T, M), :2] + rng.normal(0, 4, (M, 2))
    gate = Association()
    z, _ = gate.prepare(scan_of(near, noise, rng.normal(0, 10, M)), SENSORS)
    existence, expected = rng.uniform(0.1, 1.0, T), rng.uniform(0.0, 9.0, (1, T))
    found = []
    for few in (0, 10**9):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(association, "FEW_PAIRS", few)
            found.append(gate.claim(None, None, estimate, existence, expected, z))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_of_two_tracks_that_claim_alike_the_first_owns():
    gate = Association(own_above=0.2)
    z, _ = gate.prepare(scan_of([(48.0, 0.1), (48.0, -0.1)], (0.1, 0.001, 0.1), 20.0), SENSORS)
    twins = prior(np.tile([50.0, 0.0, 0.0], (3, 1)), velocity=(20.0, 0.0))
    claims = gate.claim(None, None, twins, np.full(3, 0.9), np.full((1, 3), 5.0), z)
    assert claims.owner.tolist() == [0, 0]
    assert len(claims.gain) == 6


@given(st.integers(2, 60), st.integers(0, 2**32 - 1))
def test_rays_at_the_boxes_in_their_way_see_what_rays_at_all_boxes_see(G, seed):
    rng = np.random.default_rng(seed)
    T = int(rng.integers(1, 30))
    estimate, t = traffic(rng, T, extent=30.0), rng.integers(0, T, G)
    pose = np.c_[rng.uniform(-3, 3, (G, 2)), rng.uniform(-np.pi, np.pi, G)]
    d = estimate.pose[t, :2] - pose[:, :2]
    span = np.linspace(-0.5, 0.5, 9) * rng.uniform(0.0, 1.5, (G, 1))
    direction = unit(np.arctan2(d[:, 1], d[:, 0])[:, None] + span)
    occluder = np.flatnonzero(rng.uniform(size=T) < 0.7)
    own, first = first_hits(pose, direction, t, estimate, occluder)
    every, nearest = first_hits_of_few(pose, direction, t, estimate, occluder)
    np.testing.assert_array_equal(own, every)
    np.testing.assert_array_equal(first > own - NEARER - SHADOW, nearest > every - NEARER - SHADOW)
    before = nearest < own.max(-1, keepdims=True)
    np.testing.assert_array_equal(first[before], nearest[before])

"""Posterior of size and class against enumeration of all classes, lengths and widths."""

import numpy as np
import pytest

from trackers.size.belief import posterior
from trackers.size.fleet import FLEET, Fleet, Prior, VehicleClass
from trackers.size.grid import LENGTH, WIDTH

GRIDS = (LENGTH, WIDTH)


def on_grids(fleet):
    return Prior.of(fleet, LENGTH.sizes, WIDTH.sizes)


def drawn(rng, lead=()):
    """Likelihoods of length and width, greatest ones 1."""
    out = []
    for grid in GRIDS:
        A = rng.normal(0, 3, (*lead, len(grid.sizes), len(grid.offsets)))
        out.append(np.exp(A - A.max((-2, -1), keepdims=True)))
    return out


def test_the_posterior_is_that_of_all_pairs_of_length_and_width_in_all_classes():
    """Exact for lengths and widths that are independent given the class, (ENDS.16) to (ENDS.18)."""
    length, width = drawn(np.random.default_rng(0))
    fleet = Fleet()
    p_L, p_W = fleet.of_length(LENGTH.sizes), fleet.of_width(WIDTH.sizes)
    joint = np.einsum("c,ck,kn,cm,mo->cknmo", fleet.shares, p_L, length, p_W, width)
    joint /= joint.sum()
    got = posterior(GRIDS, on_grids(fleet), length, width)
    np.testing.assert_allclose(got.kind, joint.sum((1, 2, 3, 4)), rtol=1e-9)
    np.testing.assert_allclose(got.length, joint.sum((0, 2, 3, 4)), rtol=1e-9)
    np.testing.assert_allclose(got.width, joint.sum((0, 1, 2, 4)), rtol=1e-9)
    L, o = LENGTH.sizes[:, None], LENGTH.offsets
    p = joint.sum((0, 3, 4))
    centre = o - L / 2
    assert got.size[0] == pytest.approx((p * L).sum())
    assert got.offset[0] == pytest.approx((p * o).sum())
    assert got.offset_var[0] == pytest.approx((p * (o - got.offset[0]) ** 2).sum())
    cell = LENGTH.step**2 / 12
    assert got.centre_var[0] == pytest.approx((p * (centre - (p * centre).sum()) ** 2).sum() + cell / 4)
    assert got.size_var[0] == pytest.approx((p * (L - got.size[0]) ** 2).sum() + cell)


def test_probabilities_sum_to_one_and_a_batch_equals_the_loop():
    length, width = drawn(np.random.default_rng(1), (3, 2))
    got = posterior(GRIDS, on_grids(Fleet()), length, width)
    for p in (got.kind, got.length, got.width):
        np.testing.assert_allclose(p.sum(-1), 1.0, rtol=1e-12)
    one = posterior(GRIDS, on_grids(Fleet()), length[2, 1], width[2, 1])
    for a, b in zip(got, one, strict=True):
        np.testing.assert_allclose(a[2, 1], b, rtol=1e-12)


def test_without_detections_the_belief_is_the_fleet():
    flat = [np.exp(grid.born(())) for grid in GRIDS]
    got = posterior(GRIDS, on_grids(Fleet()), *flat)
    np.testing.assert_allclose(got.kind, Fleet().shares, rtol=1e-9)
    mean = sum(c.share * c.length[0] for c in FLEET)
    assert got.size[0] == pytest.approx(mean, abs=0.05)


def test_a_width_says_which_lengths_are_likely():
    """2.5 m is a truck, a bus or a trailer; nothing else is known of the length."""
    length = np.exp(LENGTH.born(()))
    width = np.exp(WIDTH.born(()) - 0.5 * ((WIDTH.sizes - 2.5) / 0.05)[:, None] ** 2)
    got = posterior(GRIDS, on_grids(Fleet()), length, width)
    assert got.size[0] > 10.0
    assert got.kind[:3].sum() < 0.01


def test_seen_from_behind_a_truck_may_be_longer_than_its_load():
    """Detections that end 6.3 m from the rear: a truck of 6.3 m, or one of 9 m whose cab is hidden, (ENDS.33)."""
    length = np.exp(LENGTH.born(()) - 0.5 * ((LENGTH.sizes - 6.3) / 0.1)[:, None] ** 2)
    width = np.exp(WIDTH.born(()) - 0.5 * ((WIDTH.sizes - 2.5) / 0.05)[:, None] ** 2)
    fleet = Fleet((VehicleClass("truck", 1.0, (9.0, 1.75), (2.48, 0.07), load=(0.5, 0.7)),))
    behind, beside = (
        posterior(GRIDS, on_grids(fleet), length, width, np.array([1.0, 0.0])),
        posterior(GRIDS, on_grids(fleet), length, width, np.array([0.0, 1.0])),
    )
    p = fleet.of_length(LENGTH.sizes)[0]
    ell = length.sum(-1)
    joint = p * (ell + np.interp(0.7 * LENGTH.sizes, LENGTH.sizes, ell)) / 2
    np.testing.assert_allclose(behind.length, joint / joint.sum(), atol=1e-9)
    assert behind.size[0] > 8.3
    assert np.sqrt(behind.size_var[0]) > 1.0
    assert beside.size[0] == pytest.approx(6.35, abs=0.1)


def test_in_a_bend_a_bus_may_be_the_trailer_of_a_longer_truck():
    """Detections that end 13.3 m from the rear, (ENDS.33), of a body that is bent or not."""
    length = np.exp(LENGTH.born(()) - 0.5 * ((LENGTH.sizes - 13.3) / 0.1)[:, None] ** 2)
    width = np.exp(WIDTH.born(()) - 0.5 * ((WIDTH.sizes - 2.55) / 0.05)[:, None] ** 2)
    fleet = Fleet()
    straight, bent = (posterior(GRIDS, on_grids(fleet), length, width, np.array([0.0, p])) for p in (0.0, 1.0))
    articulated = fleet.names.index("articulated")
    assert straight.kind[articulated] < 0.3 < 0.6 < bent.kind[articulated]
    assert straight.size[0] == pytest.approx(13.3, abs=0.2)
    assert abs(bent.size[0] - 16.2) < 2 * np.sqrt(bent.size_var[0])
    assert np.sqrt(bent.size_var[0]) > 1.0


@pytest.mark.parametrize("load", [(1.2, 0.7), (0.5, 0.0), (0.5, 1.3)])
def test_a_load_that_is_no_share_is_refused(load):
    with pytest.raises(ValueError, match="load"):
        VehicleClass("truck", 1.0, (9.0, 1.75), (2.48, 0.07), load=load)


def test_a_fleet_without_shares_is_refused():
    with pytest.raises(ValueError, match="shares"):
        Fleet(classes=())
    with pytest.raises(ValueError, match="share"):
        Fleet(classes=(VehicleClass("car", 0.0, (4.5, 0.4), (1.8, 0.1)),))

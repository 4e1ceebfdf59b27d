"""Posterior of size and class against enumeration of all classes, lengths and widths."""

from dataclasses import replace

import numpy as np
import pytest

from trackers.size.belief import posterior, with_loads
from trackers.size.fleet import FLEET, Fleet, Load, Prior, VehicleClass
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


TRUCK = VehicleClass("truck", 1.0, (9.0, 1.75), (2.48, 0.07), load=Load(0.5, 0.7, 0.3, 0.6))


def spread(upto, before, beyond, view=0):
    """Detections (2, D) in cells, of one view: so many evenly before a depth [m], and as many in the 3 m beyond it."""
    depth, n = LENGTH.step * np.arange(LENGTH.depths), np.zeros((2, LENGTH.depths))
    inside, ahead = (depth > 0) & (depth <= upto), (depth > upto) & (depth <= upto + 3.0)
    n[view] = before * inside / inside.sum() + beyond * ahead / ahead.sum()
    return n


@pytest.mark.parametrize(("view", "ahead"), [(0, 0.3), (1, 0.6)])
def test_a_load_weighs_each_detection_from_behind_by_where_it_lies(view, ahead):
    """(ENDS.46), (ENDS.47) by hand, detection by detection, in the middle of cells of which none is cut."""
    rng, n = np.random.default_rng(0), np.zeros((2, LENGTH.depths))
    cell = rng.integers(1, LENGTH.depths, 30)
    np.add.at(n[view], cell, 1.0)
    got = with_loads(LENGTH, on_grids(Fleet((TRUCK,))), n)[0]
    depth = (cell - 0.5) * LENGTH.step
    for k in np.flatnonzero(np.isclose(0.7 * LENGTH.sizes / LENGTH.step % 1, 0.0)):  # loads end with a cell
        L = LENGTH.sizes[k]
        density = np.where(depth < 0.7 * L, 1.0, ahead) / (0.7 + 0.3 * ahead)
        q = 0.5 + 0.5 * np.prod(density[depth < L])
        assert got[k] == pytest.approx(Fleet((TRUCK,)).of_length(LENGTH.sizes)[0, k] * q)


def test_the_density_with_a_load_is_one_over_the_body():
    part, ratio = TRUCK.load.part, np.exp(TRUCK.load.log_ratios)
    np.testing.assert_allclose(part * ratio[0] + (1 - part) * ratio[1], 1.0)


def test_a_truck_is_longer_than_what_fills_its_load_and_not_if_its_cab_is_seen():
    """40 detections that end 6.3 m from the rear are of a truck of 9 m if cabs hardly show, and of 6.3 m if they do.

    Of a cab that shows, a fifth of them makes it 9 m.
    """
    width = np.exp(WIDTH.born(()) - 0.5 * ((WIDTH.sizes - 2.5) / 0.05)[:, None] ** 2)
    fleet, better = (on_grids(Fleet((replace(TRUCK, load=Load(0.9, 0.7, ahead)),))) for ahead in (0.05, 0.3))

    def size(n, fleet=fleet):
        """Mean length by detections (2, D) that are even over the body but for loads, and without these."""
        depth = LENGTH.step * (np.arange(LENGTH.depths) - 0.5)
        inside = depth < LENGTH.sizes[:, None]
        log_l = np.where(inside, -np.log(LENGTH.sizes)[:, None], -6.0) @ n.sum(0)
        length = np.exp(LENGTH.born(()) + log_l[:, None] - log_l.max())
        return posterior(GRIDS, fleet, length, width, n).size[0], posterior(GRIDS, fleet, length, width).size[0]

    hidden, blind = size(spread(6.3, 40.0, 0.0))
    assert hidden > 7.8
    assert blind < 7.0
    assert size(spread(6.3, 40.0, 0.0), better)[0] < 7.5
    assert size(spread(6.3, 32.0, 8.0), better)[0] == pytest.approx(9.3, abs=0.4)


def test_that_a_body_is_bent_and_what_its_load_shows_are_one_mixture():
    """All of the probability of a class, however a load and a bend weigh the lengths: none is negative."""
    rng = np.random.default_rng(2)
    (length, width), n = drawn(rng, (5,)), rng.exponential(3.0, (5, 2, LENGTH.depths))
    got = posterior(GRIDS, on_grids(Fleet()), length, width, n, rng.random(5))
    for p in (got.kind, got.length, got.width):
        assert (p >= 0).all()
        np.testing.assert_allclose(p.sum(-1), 1.0, rtol=1e-12)


def test_in_a_bend_a_bus_may_be_the_trailer_of_a_longer_truck():
    """Detections that end 13.3 m from the rear, (ENDS.33), of a body that is bent or not."""
    length = np.exp(LENGTH.born(()) - 0.5 * ((LENGTH.sizes - 13.3) / 0.1)[:, None] ** 2)
    width = np.exp(WIDTH.born(()) - 0.5 * ((WIDTH.sizes - 2.55) / 0.05)[:, None] ** 2)
    fleet = Fleet()
    straight, bent = (posterior(GRIDS, on_grids(fleet), length, width, bent=np.array(p)) for p in (0.0, 1.0))
    articulated = fleet.names.index("articulated")
    assert straight.kind[articulated] < 0.3 < 0.6 < bent.kind[articulated]
    assert straight.size[0] == pytest.approx(13.3, abs=0.2)
    assert abs(bent.size[0] - 16.2) < 2 * np.sqrt(bent.size_var[0])
    assert np.sqrt(bent.size_var[0]) > 1.0


@pytest.mark.parametrize("load", [(1.2, 0.7), (0.5, 0.0), (0.5, 1.3), (0.5, 0.7, 0.0), (0.5, 0.7, 0.2, 1.1)])
def test_a_load_that_is_no_share_is_refused(load):
    with pytest.raises(ValueError, match="load"):
        VehicleClass("truck", 1.0, (9.0, 1.75), (2.48, 0.07), load=Load(*load))


def test_a_fleet_without_shares_is_refused():
    with pytest.raises(ValueError, match="shares"):
        Fleet(classes=())
    with pytest.raises(ValueError, match="share"):
        Fleet(classes=(VehicleClass("car", 0.0, (4.5, 0.4), (1.8, 0.1)),))

"""Size posteriors in the multi-object tracker."""

import numpy as np
import pytest

from testbed.check.draws import arrays
from tests.trackers.rear_sides import RADAR, Road, drive
from tests.trackers.size.bodies import INNER
from trackers import MultiObjectTracker
from trackers.compiled import REFUSED
from trackers.composed import composed
from trackers.multi.visibility import predict_visibility
from trackers.size.fleet import Fleet

CARS = [(30, 0, 0, 25.0), (50, 4, 0, 28.0), (60, -4, 0, 22.0)]
TRACKER = MultiObjectTracker(composed(INNER, size="ends"), (RADAR,))


def test_sizes_are_those_of_the_posterior_and_stay_open_while_one_end_is_seen():
    tracks, _ = drive(TRACKER, Road(CARS), 2.0)
    e = tracks.reported.estimate
    assert len(e.size) == 3
    assert e.class_probability.shape == (3, len(Fleet().names))
    assert (e.size_std[:, 0] > 0.15).all()  # rears only: no size is drawn to one of a class
    assert (e.size_std[:, 0] < 1.5).all()
    alone, _ = drive(MultiObjectTracker(INNER, (RADAR,)), Road(CARS), 2.0)
    assert alone.reported.estimate.class_probability is None


def test_of_a_near_end_that_others_hide_less_is_known_and_the_far_end_is_where_it_was(monkeypatch):
    world, hidden = Road(CARS), []
    tracks, _ = drive(TRACKER, world, 2.0)
    world.advance()
    scan = world.scan()

    def view(*args):
        found = predict_visibility(*args)
        return found._replace(end_hidden=np.isin(np.arange(len(found.end_hidden)), hidden))

    monkeypatch.setenv(REFUSED, "off")
    monkeypatch.setattr("trackers.multi.tracker.predict_visibility", view)
    seen, _ = TRACKER.step(tracks, scan, world.dt)
    hidden = [1]
    less, _ = TRACKER.step(tracks, scan, world.dt)
    np.testing.assert_array_equal(less.estimate.edges[[0, 2]], seen.estimate.edges[[0, 2]])
    assert less.estimate.edges[1, 1] > 1.2 * seen.estimate.edges[1, 1]
    np.testing.assert_allclose(less.estimate.size[1], seen.estimate.size[1], atol=0.3)


def test_order_and_padding_of_detections_change_nothing():
    rng = np.random.default_rng(4)
    world = Road(CARS)
    tracks = others = TRACKER.start()
    for k in range(20):
        scan = world.scan()
        order = rng.permutation(len(scan.mask))
        polar = np.concatenate([scan.polar[order], np.full((2, 3), np.nan)])
        mixed = scan._replace(polar=polar, mask=np.arange(len(polar)) < len(order))
        tracks, _ = TRACKER.step(tracks, scan, world.dt if k else 0.0)
        others, _ = TRACKER.step(others, mixed, world.dt if k else 0.0)
        world.advance()
    for a, b in zip(arrays(tracks), arrays(others), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_no_other_sizes_are_known():
    with pytest.raises(ValueError, match="size must be one of off, ends"):
        composed(INNER, size="end")

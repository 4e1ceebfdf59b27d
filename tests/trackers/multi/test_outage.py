"""Radars that deliver nothing: said by the scan, or inferred from silence."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import nbinom

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from trackers import MultiObjectTracker, SensorModel, prior
from trackers.multi.outage import SensorOutage

DT = 1 / 15
NOISE = (0.2, 0.01, 0.1)
LEFT = SensorModel(mount=(0.0, 0.0, np.pi / 4), fov=np.pi / 2, clutter=3.0)
RIGHT = replace(LEFT, mount=(0.0, 0.0, -np.pi / 4))
PLACES = [(20.0, 12.0, 0.0), (30.0, 15.0, 0.0), (25.0, -12.0, 0.0), (35.0, -20.0, 0.0), (40.0, 25.0, 0.0)]
TRACKER = MultiObjectTracker(KnownObjects(), (LEFT, RIGHT))
NOTHING = scan_of(np.zeros((0, 2)), NOISE)


def after(scans, **changes):
    """Existence of the five tracks, 0 for those that are gone, after empty scans."""
    tracks = tracks_of(prior(PLACES, velocity=(10.0, 0.0)), existence=0.99)
    for _ in range(scans):
        tracks, _ = TRACKER.step(tracks, NOTHING._replace(**changes), DT)
    existence = np.zeros(5)
    existence[tracks.id] = tracks.existence
    return existence


def test_two_seconds_without_any_detection_keep_all_tracks():
    assert (after(30) > 0.5).all()


def test_an_empty_scan_of_working_radars_is_evidence_of_absence():
    assert (after(15, delivered=np.array([True, True])) == 0).all()


def test_of_one_silent_radar_its_tracks_are_kept():
    left = np.array(PLACES)[:, 1] > 0
    for silent, kept in ((0, left), (1, ~left)):
        delivered = np.arange(2) != silent
        np.testing.assert_array_equal(after(15, delivered=delivered) > 0.5, kept)


def test_a_radar_that_detects_anything_is_not_out():
    """Its tracks die; those of the other one, silent for a second, are kept."""
    tracks = tracks_of(prior(PLACES, velocity=(10.0, 0.0)), existence=0.99)
    alarm = scan_of([(60.0, 50.0)], NOISE, 40.0)  # of sensor 0, the left one
    for _ in range(15):
        tracks, _ = TRACKER.step(tracks, alarm, DT)
    assert set(tracks.id.tolist()) <= {2, 3}
    assert len(tracks.id) == 2


def test_probability_of_silence_by_hand():
    """Two tracks with counts of a negative binomial, three false alarms of which 80 % are sure."""
    expected, existence = np.array([[2.0, 0.5]]), np.array([0.9, 0.6])
    none = nbinom.pmf(0, 2.0, 2.0 / (2.0 + expected[0]))
    silent = np.prod(1 - existence + existence * none) * np.exp(-0.8 * 3.0)
    got = SensorOutage().probability(np.zeros(1), np.zeros(1, bool), expected, existence, np.array([3.0]))
    np.testing.assert_allclose(got, 1e-4 / (1e-4 + (1 - 1e-4) * silent))
    again = SensorOutage().probability(got, np.zeros(1, bool), expected, existence, np.array([3.0]))
    prior = 1e-4 + (0.9 - 1e-4) * got
    np.testing.assert_allclose(again, prior / (prior + (1 - prior) * silent))
    assert SensorOutage().probability(got, np.ones(1, bool), expected, existence, np.array([3.0])) == 0


def test_sensors_with_nothing_in_view_are_out_with_the_others_but_not_alone():
    expected, sure = np.array([[8.0] * 6, [0.0] * 6]), np.ones(6)
    none = np.zeros(2)
    one = SensorOutage().probability(none, np.array([True, False]), expected, sure, np.full(2, 1.0))
    both = SensorOutage().probability(none, np.zeros(2, bool), expected, sure, np.full(2, 1.0))
    assert one[1] < 0.01
    assert (both > 0.99).all()


@pytest.mark.parametrize("delivered", [np.array([True]), np.array([1, 0]), np.ones((2, 2), bool)])
def test_a_mask_that_does_not_fit_the_sensors_is_refused(delivered):
    with pytest.raises(ValueError, match=r"scan\.delivered must be "):
        TRACKER.step(TRACKER.start(), NOTHING._replace(delivered=delivered), 0.0)

"""Range rates that fold: tracks, what stands still and new vehicles get the lap that they are on."""

from dataclasses import replace

import numpy as np
import pytest

from tests.trackers.multi.known_objects import scan_of, tracks_of
from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import build, prior
from trackers.multi.association import Association
from trackers.multi.folding import unfolded
from trackers.multi.visibility import SensorArray

FOLD = 5.2  # [m/s] as of the Astyx radar
SHEET = replace(RADAR, fold_rate=FOLD)
NOISE = (0.1, 0.01, 0.1)


def folded(rate, fold=FOLD):
    return (np.asarray(rate, float) + fold) % (2 * fold) - fold


def taken(xy, rate, tracks, ego=0.0):
    """The range rates that a step works with, of those that a radar reports."""
    scan = scan_of(xy, NOISE, rate)._replace(velocity=np.array([[ego, 0.0]]))
    return unfolded(scan, tracks, Association(), SensorArray.of((SHEET,)), np.array([FOLD])).polar[:, 2]


def test_detections_of_a_track_are_taken_on_its_lap_and_others_on_that_of_what_stands_or_drives_as_the_traffic_does():
    two = tracks_of(prior([[30.0, 0.0, 0.0], [30.0, 8.0, 0.0]], velocity=[[21.0, 0.0], [-14.0, 0.0]], size=(4.6, 1.8)))
    places = [(28.0, 0.3), (28.0, 7.8), (60.0, -1.0), (20.0, -12.0)]
    x, y = np.array(places).T
    true = np.array([21.3, -14.0, 24.0, 0.1]) * x / np.hypot(x, y)  # each track, a newcomer, a rail
    np.testing.assert_allclose(taken(places, folded(true), two), true, atol=1e-9)


def test_of_two_tracks_whose_rates_fold_alike_the_one_whose_place_explains_a_detection_counts():
    pose, velocity = [[40.0, 0.0, 0.0], [42.0, 2.0, 0.0]], [[21.0, 0.0], [21.0 - 2 * FOLD, 0.0]]
    side = taken([(42.0, 0.8)], folded(21.0), tracks_of(prior(pose, velocity=velocity, size=(4.6, 1.8))))
    np.testing.assert_allclose(side, 21.0)  # inside the first, nearer to the middle of the second


def test_without_tracks_vehicles_are_taken_to_drive_as_the_ego_does():
    none = tracks_of(prior(np.zeros((0, 3))))
    np.testing.assert_allclose(taken([(50.0, 0.0), (20.0, 0.0)], [-3.0, folded(-25.0)], none, ego=25.0), [-3.0, -25.0])


def test_what_a_radar_did_not_measure_stays_so():
    none = tracks_of(prior(np.zeros((0, 3))))
    assert np.isnan(taken([(50.0, 0.0)], [np.nan], none)).all()


@pytest.mark.parametrize("name", ["rm-koch", "imm-spline"])
def test_tracks_of_a_radar_that_folds_are_those_of_one_that_does_not(name):
    cars = [(30, 0, 0, 25.0), (50, 4, 0, 28.0), (60, -4, 0, 22.0)]

    def speeds(sheet, fold):
        road = Road(cars, clutter=0)
        scan = road.scan
        road.scan = lambda *a: (s := scan(*a))._replace(polar=np.c_[s.polar[:, :2], folded(s.polar[:, 2], fold)])
        tracks, _ = drive(build(name, (sheet,)), road, 2.0)
        return np.sort(tracks.reported.estimate.velocity[:, 0])

    np.testing.assert_allclose(speeds(SHEET, FOLD), speeds(RADAR, 1e6), atol=0.01)

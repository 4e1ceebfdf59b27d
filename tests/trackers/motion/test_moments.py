"""Moments that averages hide: the motion across of one vehicle, with what failed them before as the negative twin."""

import numpy as np
import pytest

from tests.trackers.motion import moments
from tests.trackers.motion.moments import inward, recorded, watch

NOW, BEFORE = moments.tracker(), moments.tracker(blind=True, sure=True, lazy=True)


def seeds(*quick, slow=(), failing=()):
    """Seeds as parameters, those of `slow` marked so; those of `failing` are known not to keep the bounds."""
    marks = [(slow, ()), (failing, (pytest.mark.xfail(strict=True, reason="not yet as good as it is to be"),))]
    rare = (pytest.param(s, marks=(pytest.mark.slow, *more)) for some, more in marks for s in some)
    return pytest.mark.parametrize("seed", [*quick, *rare])


def beside(tracker, seed):
    """Mean velocity across [m/s], drift and greatest offset [m] of a vehicle that keeps its lane while it is passed."""
    moment = watch(tracker, recorded("passed", seed, 8.0))
    w = (moment.time > 1.5) & (moment.ahead < 14.0) & (moment.ahead > 3.0)
    return np.mean(moment.across[w, 1]), np.ptp(moment.offset[w]), np.abs(moment.offset[w]).max()


@seeds(2, slow=(4, 6), failing=(1, 3, 5))
def test_a_vehicle_that_is_passed_stays_in_its_lane(seed):
    across, drift, offset = beside(NOW, seed)
    assert abs(across) < 0.12
    assert drift < 0.4
    assert offset < 0.3


def test_what_lies_out_of_view_was_taken_for_a_drift():
    assert beside(BEFORE, 1)[1] > 1.4 * beside(NOW, 1)[1]


def turning(tracker, seed):
    """Greatest error [deg] and mean NEES of the heading of a car that begins to turn ahead, and its track ids."""
    moment = watch(tracker, recorded("onset", seed, 5.5))
    w = moment.time > 3.0
    turn, std = moment.turn[w].T
    return np.degrees(np.abs(turn).max()), np.mean((turn / std) ** 2), set(moment.track[w])


@seeds(1, slow=(3, 4), failing=(2,))
def test_the_heading_follows_a_turn_from_its_onset(seed):
    error, nees, ids = turning(NOW, seed)
    assert error < 4.0
    assert nees < 3.0
    assert len(ids) == 1


def test_without_views_doubt_and_onsets_the_heading_errs_more_confidently():
    before = turning(BEFORE, 1)
    assert before[1] > 1.5 * turning(NOW, 1)[1]


def cutting_in(tracker, seeds):
    """Mean velocity inwards [m/s] 0.4, 0.6 and 0.8 s after the onset, and mean NEES of it, over cars that cut in."""
    found = []
    for seed in seeds:
        moment = watch(tracker, recorded("probe-cutin", seed, 5.6))
        v, start = inward(moment)
        w = (moment.time > start) & (moment.time < start + 1.4)
        nees = np.mean(((v[w, 1] - v[w, 0]) / moment.across_std[w]) ** 2)
        found.append([*np.interp(start + np.array([0.4, 0.6, 0.8]), moment.time, v[:, 1]), nees])
    return np.mean(found, 0)


def test_a_car_that_cuts_in_is_seen_to_come():
    soon, then, late, nees = cutting_in(NOW, (2, 3))
    assert soon > 0.4
    assert then > 1.0
    assert late > 1.4
    assert nees < 2.0
    assert cutting_in(BEFORE, (2, 3))[3] > 2 * nees


@pytest.mark.slow
def test_cars_that_cut_in_are_seen_to_come_with_an_honest_doubt():
    soon, then, late, nees = cutting_in(NOW, range(960, 968))
    assert soon > 0.35
    assert then > 0.85
    assert late > 1.3
    assert nees < 3.0

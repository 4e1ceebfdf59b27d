"""Detections of a vehicle of which others hide a part; against integrals by many draws, and a car behind a car."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from tests.trackers.multi.known_objects import scan_of
from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import SensorModel, build, find, prior
from trackers.composed import Composed
from trackers.multi.association import Association
from trackers.multi.partial import as_if_whole, shade_of
from trackers.multi.road import RoadMap
from trackers.multi.visibility import SensorArray

AHEAD = SensorModel(mount=(0.0, 0.0, 0.0), max_range=150.0, fov=np.radians(40.0))
NOISE = (0.15, 0.01, 0.1)
FACE = 100.0 - 2.3  # [m] from the radar to the rear side of the vehicle in question


def turn(places, std=1e-5, hides=True, share=0.5, noise=NOISE):
    """Angle [rad] by which a detection straight ahead, of the first track, is turned; places (T, 2) of all tracks."""
    places = np.reshape(places, (-1, 2))
    estimate = prior(np.c_[places, np.zeros(len(places))], size=[(4.6, 1.8)] * len(places), position_std=std)
    array = SensorArray.of((AHEAD,))
    z, _ = Association().prepare(scan_of([(FACE, 0.0)], noise), array)
    occluder = np.full(len(places), hides)
    shade = shade_of(estimate, occluder, array, z.scan.platform)
    new = as_if_whole(z, np.zeros(1, int), estimate, shade, np.full((1, len(places)), share), array)
    np.testing.assert_allclose(new.xy, new.scan.points(new.sight))
    np.testing.assert_allclose(new.rate, new.scan.rates(new.sight))
    np.testing.assert_array_equal(new.scan.polar[:, [0, 2]], z.scan.polar[:, [0, 2]])
    return new.scan.polar[0, 1] - z.scan.polar[0, 1]


def blurred(noise):
    """(MOT.62) of the vehicle in question."""
    half = np.arctan2(0.9, FACE)
    return noise**2 / (half**2 / 3 + noise**2)


def beside(edge):
    """Place of a vehicle 50 m ahead whose left edge is seen `edge` [rad] left of the middle of the one in question."""
    corner = 50.0 + (-2.3 if edge >= 0 else 2.3)  # the one that is seen furthest to the left
    return 50.0, corner * np.tan(edge) - 0.9


def test_of_a_vehicle_whose_right_half_is_hidden_detections_lie_a_quarter_of_its_width_to_the_left():
    """(MOT.60) to (MOT.62) with edges that are sure."""
    half = np.arctan2(0.9, FACE)
    assert turn([(100.0, 0.0), beside(0.0)]) == pytest.approx(-half / 2 * blurred(NOISE[1]), rel=0.01)
    assert turn([(100.0, 0.0), beside(-half / 2)]) == pytest.approx(-half / 4 * blurred(NOISE[1]), rel=0.01)


def test_the_finer_the_radar_the_less_is_turned():
    """One that tells left from right shows where the edge is; its detections stay where they are."""
    half, places = np.arctan2(0.9, FACE), [(100.0, 0.0), beside(0.0)]
    fine, coarse = (turn(places, noise=(0.15, noise, 0.1)) for noise in (1e-4, 1.0))
    assert abs(fine) < 1e-3 * half
    assert coarse == pytest.approx(-half / 2, rel=0.01)


@pytest.mark.parametrize(
    ("places", "more"),
    [
        ([(100.0, 0.0)], {}),
        ([(100.0, 0.0), (140.0, -1.0)], {}),  # behind
        ([(100.0, 0.0), (100.5, -1.5)], {}),  # beside
        ([(100.0, 0.0), (50.0, -20.0)], {}),  # elsewhere
        ([(100.0, 0.0), beside(0.0)], {"hides": False}),
        ([(100.0, 0.0), beside(0.0)], {"share": 1.0}),
    ],
)
def test_what_nothing_hides_stays(places, more):
    assert turn(places, **more) == pytest.approx(0.0, abs=1e-12)


def test_what_is_hidden_as_much_on_both_sides_stays():
    assert turn([(100.0, 0.0), (50.0, 0.0)], std=0.3) == pytest.approx(0.0, abs=1e-12)
    left, right = (beside(k * np.arctan2(0.9, FACE) / 2) for k in (1, -1))
    one = turn([(100.0, 0.0), left])
    assert one < -1e-4
    assert turn([(100.0, 0.0), (left[0], -left[1])]) == pytest.approx(-one, rel=1e-9)
    assert turn([(100.0, 0.0), right, (right[0], -right[1])]) == pytest.approx(0.0, abs=1e-12)


@given(y=st.floats(-3.0, 3.0), std=st.floats(0.05, 1.0))
def test_unsure_edges_are_those_of_many_draws(y, std):
    """The middle of what is seen, weighed by how much is seen, over places of both vehicles."""
    steps = (np.arange(4001) + 0.5) / 4001
    u = np.arctan2(0.9, FACE) * (2 * steps - 1)
    own, other = std / 100.0, std / 50.0  # [rad] at the centres
    corners = np.arctan2(y + np.array([[0.9], [-0.9]]), 50.0 + np.array([2.3, -2.3]))
    left, right = corners[0].max(), corners[1].min()
    draws = norm.ppf((np.arange(400) + 0.5) / 400) * np.hypot(own, other)
    seen = np.mean([(u > left + d) | (u < right + d) for d in draws], 0)
    expected = -(u * seen).mean() / max(seen.mean(), 0.02) * blurred(NOISE[1])
    assert turn([(100.0, 0.0), (50.0, y)], std=std) == pytest.approx(expected, abs=0.03 * np.arctan2(0.9, FACE))


class HalfHidden(Road):
    """The first car hides the right half of the second one: of that only the left half has detections."""

    def scan(self):
        scan = super().scan()
        polar, n = scan.polar.copy(), len(scan.polar) - self.clutter
        far = np.flatnonzero(polar[:n, 0] > 90)
        polar[far, 1] = self.rng.uniform(0.0, 0.9, len(far)) / polar[far, 0] + self.rng.normal(0, 0.01, len(far))
        return scan._replace(polar=polar)


def beside_itself(whole, road, seed):
    """How far aside [m] of a half hidden car its track is, in the mean from 2 s on, with this map."""
    tracker, aside = replace(build("imm-spline", (RADAR,)), as_whole=whole, road=road), []

    def note(road, scan, tracks, info):
        e = tracks.reported.estimate
        far = np.flatnonzero(np.hypot(*(e.pose[:, :2] - road.cars[1, :2]).T) < 4)
        if road.time > 2 and len(far):
            aside.append(e.pose[far[0], 1])

    drive(tracker, HalfHidden([(55, -0.9, 0, 25.0), (115, 0, 0, 25.0)], seed=seed), 8.0, note)
    assert len(aside) > 80
    return np.mean(aside)


@pytest.mark.parametrize(("road", "most"), [(RoadMap.of([]), 0.55), (None, 0.65)], ids=["off-lanes", "no-map"])
def test_a_car_half_hidden_far_ahead_is_where_it_is(road, most):
    """Without it stands beside itself by a quarter of its width; born along the road it keeps a little more of that."""
    off = {whole: np.mean([beside_itself(whole, road, seed) for seed in range(5)]) for whole in (False, True)}
    assert off[False] > 0.3
    assert abs(off[True]) < most * off[False]


@pytest.mark.parametrize("whole", [True, False])
def test_the_filter_hears_what_hides_others(whole):
    """And only then: a filter whose `update_among` takes four arguments serves trackers without `as_whole`."""
    known, heard = find("imm-spline", compiled=False).on((RADAR,)), []

    class Listening(Composed):
        def update_among(self, state, scan, every, owner, *shade):
            heard.append((len(scan.mask), *shade))
            return super().update_among(state, scan, every, owner, *shade)

    filter = Listening(known.place, known.motion, known.size, compiled=False)
    tracker = replace(build("imm-spline", (RADAR,)), filter=filter, as_whole=whole)
    drive(tracker, Road([(55, -0.9, 0, 25.0), (115, 0, 0, 25.0)], seed=1), 3.0, lambda *_: None)
    assert {len(one) for one in heard} == {2 if whole else 1}
    if whole:
        among_two = [shade for tracks, shade in heard if tracks == 2 and len(shade.row) == 2]
        near, far = np.sort(among_two[-1].nearest[0])
        assert near == pytest.approx(55 - 2.3 - RADAR.mount[0], abs=1.5)
        assert far == pytest.approx(115 - 2.3 - RADAR.mount[0], abs=2.5)

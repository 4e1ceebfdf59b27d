"""The variants of the virtual measurement model that the report has or proposes, and what they fail at."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from studies.papers.hoher2022.direct_fit import DirectFit
from studies.papers.hoher2022.rules import Lms
from studies.papers.hoher2022.variants import ReportVariant, ShapeLms, grid_fan
from tests.trackers.random_matrix.contour_cases import CAR, ORIGIN, adapted, follow, static_case
from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import MultiObjectTracker, Scan, prior
from trackers.random_matrix.rays import near_hits, root_of, tangent_sector
from trackers.random_matrix.virtual_measurements import VirtualMeasurements


def test_eigenvalues_do_not():
    """The larger eigenvalue belongs to the width but drives the length: every step is rejected."""
    f = ReportVariant(rule=Lms(gain=0.5), moments="eigenvalues", rays=65, sigma=0.0)
    state = adapted(f, *static_case(0.0, f, (4.7, 1.0)), 150)
    assert abs(state.size - CAR).max() > 0.3


def test_sensor_noise_must_be_in_the_virtual_spread():
    """Without it the ellipse grows by metres to explain a noise of 0.5 m."""
    rng = np.random.default_rng(0)
    width = {}
    for blur in (True, False):
        f = ReportVariant(sigma=0.5, blur=blur, rule=Lms(), moments="eigenvalues")
        state, clean = static_case(np.radians(60), f, (4.7, 1.8))
        widths = []
        for _ in range(300):
            noisy = Scan.from_xy(clean.xy + 0.5 * rng.standard_normal(clean.xy.shape))
            state = f.adapt(state, noisy)
            widths.append(state.size[1])
        width[blur] = np.mean(widths[200:])
    assert abs(width[True] - 1.8) < 1.0
    assert width[False] > 1.8 + 3.0


def drifting(f, steps=60):
    """Tilt [deg] learned of an ellipse that moves along x and points 20 deg to the side, seen from 45 deg."""
    tilt = np.radians(20)
    state = f.init(prior((10.0, 10.0, 0.0), velocity=(5.0, 0.0)))
    points, _ = f.virtual(ORIGIN, np.array([10.0, 10.0]), root_of(CAR, np.array(tilt)))
    return np.degrees(adapted(f, state, Scan.from_xy(points), steps).tilt)


def test_a_drifting_target_shows_its_tilt_to_the_variant_that_learns_it():
    learned = drifting(ReportVariant(rule=Lms(gain=0.5, iterations=10), tilt="square-root", sigma=0.0))
    assert_allclose(learned, 20.0, atol=2.0)
    assert_allclose(drifting(VirtualMeasurements(sigma=0.0)), 0.0, atol=1e-9)


def test_the_matrix_of_the_ellipse_itself_needs_more_gain_than_its_root():
    slow, fast = (drifting(ReportVariant(rule=ShapeLms(shape_gain=g), tilt="abc", sigma=0.0), 10) for g in (1.0, 10.0))
    assert abs(fast - 20) < abs(slow - 20)


def test_the_direct_form_finds_a_static_ellipse():
    f = ReportVariant(direct=DirectFit(pitch=0.0), rays=200, sigma=0.0)
    state, scan = static_case(np.radians(40), f, (4.0, 1.4))
    state = adapted(f, state, scan, 300)
    assert_allclose([*state.centre, *state.size], [15.0, 0.0, 4.7, 1.8], atol=0.1)


def test_feedback_of_the_offset_centres_the_filter_too():
    error, position = follow(ReportVariant(sigma=0.1, feedback_from=10))
    assert abs(error[0]) < 0.4
    assert abs(position[0]) < 0.4


@pytest.mark.parametrize(
    ("filter", "within"),
    [
        (ReportVariant(feedback_from=0), 2.0),  # the rear is flat, the ellipse is not: it becomes too short
        (ReportVariant(feedback_from=0, direct=DirectFit(pitch=0.0)), 1.0),
        (ReportVariant(feedback_from=0, body="box"), 1.0),
    ],
    ids=["ellipse", "direct", "box"],
)
def test_it_follows_a_car_in_the_multi_object_tracker(filter, within):
    road = Road([(40.0, 0.0, 0.0, 25.0)])
    tracks, _ = drive(MultiObjectTracker(filter, (RADAR,)), road, 4.0)
    reported = tracks.reported
    assert len(reported.id) == 1
    assert np.hypot(*(reported.estimate.pose[0, :2] - road.cars[0, :2])) < within
    assert np.hypot(*(reported.estimate.velocity[0] - [25.0, 0.0])) < 1.0


@pytest.mark.parametrize("n", [0, 1, 2])
def test_fewer_than_three_detections_leave_the_size_of_a_direct_fit(n):
    f = ReportVariant(direct=DirectFit())
    state = f.predict(f.init(prior((15.0, 2.0, 0.3), velocity=(10.0, 3.0))), 0.1)
    got, info = f.update(state, Scan.from_xy(np.array([[13.0, 2.0], [13.5, 1.2]])[:n].reshape(n, 2)))
    np.testing.assert_array_equal(got.size, state.size)
    assert info.n == n


def test_the_grid_has_the_rays_that_hit():
    """Against all rays of the circle, for an ellipse across +-pi."""
    centre, L = np.array([-10.0, 0.4]), root_of(CAR, np.array(0.3))
    pitch = 2 * np.pi / 3600
    every = np.isfinite(near_hits(ORIGIN, np.arange(3600) * pitch, centre, L))
    bearing, mask = grid_fan(*tangent_sector(ORIGIN, centre, L), pitch)
    assert mask.sum() == every.sum()
    assert np.isfinite(near_hits(ORIGIN, bearing[mask], centre, L)).all()


def test_bad_variants_are_named():
    with pytest.raises(ValueError, match="moments must be one of body, eigenvalues, got 'eigen'"):
        ReportVariant(moments="eigen")
    with pytest.raises(ValueError, match="tilt must be one of"):
        ReportVariant(tilt="angle")
    with pytest.raises(ValueError, match="direct fit"):
        ReportVariant(direct=DirectFit(), tilt="abc")
    with pytest.raises(ValueError, match="body 'box'"):
        ReportVariant(direct=DirectFit(), body="box")

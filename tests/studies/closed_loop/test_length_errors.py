"""Length errors against the visible share: bins by hand, and what the observer takes from a frame."""

import numpy as np
import pytest

from sensors.origin import Origin
from sensors.scene import boxes_scene
from studies.closed_loop.figure import draw
from studies.closed_loop.length_errors import FEWEST, LengthErrors, LengthSamples, profile
from testbed.experiments.series import LABELS
from testbed.frame import Frame
from trackers.estimate import prior
from trackers.multi.tracks import Tracks
from trackers.scan import Scan


def samples(visible, error, length=4.5):
    visible, error = np.broadcast_arrays(np.asarray(visible, float), np.asarray(error, float))
    return LengthSamples(visible, np.full(len(visible), length), error)


def many(pattern):
    """The pattern often enough for an average."""
    return np.tile(pattern, FEWEST)


def test_each_bin_holds_its_upper_edge():
    visible = many([0.0, 0.1, 0.25, 0.26, 0.75, 0.76, 0.99, 1.0])
    assert profile(samples(visible, 0.0)).frames.tolist() == [FEWEST * n for n in (1, 2, 1, 1, 2, 1)]


def test_averages_by_hand():
    error = np.concatenate([many([1.0, -3.0]), many([2.0, np.nan, np.nan, np.nan])])
    found = profile(samples(np.repeat([0.4, 1.0], [2 * FEWEST, 4 * FEWEST]), error))
    assert found.mean[[2, 5]] == pytest.approx([-1.0, 2.0])
    assert found.rms[[2, 5]] == pytest.approx([np.sqrt(5.0), 2.0])
    assert found.held[[2, 5]] == pytest.approx([1.0, 0.25])
    assert np.isnan([found.mean[0], found.rms[1], found.held[3]]).all()


def test_too_few_frames_with_a_track_give_no_error_but_a_share():
    error = np.full(2 * FEWEST, np.nan)
    error[: FEWEST - 1] = 1.0
    found = profile(samples(np.ones(2 * FEWEST), error))
    assert np.isnan([found.mean[-1], found.rms[-1]]).all()
    assert found.held[-1] == (FEWEST - 1) / (2 * FEWEST)


def test_the_observer_takes_counted_vehicles_and_their_tracks():
    """A truck half hidden with a track 2 m too short, a car without a track, a car that the radar cannot see."""
    pose = np.array([[20.0, 0, 0], [50.0, 0, 0], [80.0, 0, 0]])
    scene = boxes_scene(pose, np.array([[10.0, 2.5], [4.5, 1.8], [4.5, 1.8]]))
    origin = Origin.empty(3)._replace(expected=np.array([5.0, 5.0, 0.0]), visible=np.array([0.5, 1.0, 0.0]))
    one = np.ones(1)
    tracks = Tracks(np.array([7]), one, one, one, one > 0, None, prior(pose[:1], size=np.array([[8.0, 2.5]])), 8)
    probe = LengthErrors(["a"])
    scan = Scan.from_xy(np.zeros((0, 2)))
    probe(Frame(0, scene, scan, origin, {"a": (tracks, None)}, "IDLE", np.zeros((0, 2))))
    found = probe.samples["a"]
    assert found.visible.tolist() == [0.5, 1.0]
    assert found.length.tolist() == [10.0, 4.5]
    assert found.error == pytest.approx([-2.0, np.nan], nan_ok=True)


def test_the_figure_has_a_line_for_each_tracker_also_where_nothing_was_seen(tmp_path):
    path = draw({"a": samples(many([0.3, 1.0]), 0.5), "b": samples([], [])}, tmp_path / "figure.png")
    assert path.read_bytes()[:4] == b"\x89PNG"
    assert len(LABELS) == len(profile(samples([], [])).mean)

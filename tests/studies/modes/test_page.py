"""Motion models against the truth: true modes and phases of courses made by hand, delays counted by hand."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors.origin import Origin
from sensors.scene import boxes_scene
from studies.modes.figure import TRUE, draw
from studies.modes.page import (
    MODES,
    SHORTEST,
    ModeHistory,
    ModeProbe,
    confusion,
    delay_row,
    delay_table,
    delays,
    history,
    most_likely,
    panels,
    phases,
    render,
    true_modes,
)
from testbed.frame import Frame
from trackers.estimate import prior
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

DT = 0.1
TIME = DT * np.arange(60)


def made(true, likely, time=TIME):
    """A vehicle whose true and most likely modes are these of MODES; -1 for no track."""
    true, likely = np.asarray(true), np.asarray(likely)
    acceleration = np.stack([np.where(true == 1, -3.0, 0.2), np.zeros(len(true))], -1)
    probability = np.where(likely[:, None] < 0, np.nan, 0.1 + 0.7 * np.eye(3)[np.maximum(likely, 0)])
    return ModeHistory(time, acceleration, np.where(true == 2, -0.1, 0.01), probability)


def steps(*parts):
    """0 for so many frames, 1 for so many: steps((0, 20), (1, 40))."""
    return np.repeat([mode for mode, _ in parts], [count for _, count in parts])


def test_the_figure_and_the_page_mean_the_same_modes():
    assert TRUE == MODES


@pytest.mark.parametrize("heading", [0.0, 2.1, -1.4])
def test_accelerations_are_along_the_heading_and_across_it(heading):
    """Braking with 3 m/s^2, and a turn of 0.2 rad/s at 10 m/s, which is 2 m/s^2 towards the side it turns to."""
    speed = 20.0 - 3.0 * TIME
    straight = np.stack([TIME, np.full(60, heading), speed * np.cos(heading), speed * np.sin(heading), 0 * TIME], -1)
    found = history(np.concatenate([straight, np.full((60, 3), 1 / 3)], -1))
    np.testing.assert_allclose(found.acceleration, np.tile([-3.0, 0.0], (60, 1)), atol=1e-9)
    phi = heading + 0.2 * TIME
    bend = np.stack([TIME, phi, 10 * np.cos(phi), 10 * np.sin(phi), np.full(60, 0.2)], -1)
    found = history(np.concatenate([bend, np.full((60, 3), 1 / 3)], -1))
    np.testing.assert_allclose(found.acceleration[1:-1], np.tile([0.0, 2.0], (58, 1)), atol=1e-3)
    assert set(true_modes(found)) == {2}


def test_a_vehicle_that_turns_and_brakes_counts_as_turning():
    both = ModeHistory(TIME[:3], np.array([[-3.0, 0.0]] * 3), np.array([0.1, -0.1, 0.0]), np.zeros((3, 3)))
    assert true_modes(both).tolist() == [2, 2, 1]


@given(st.lists(st.integers(0, 2), min_size=1, max_size=60))
def test_phases_cover_all_frames_in_order_and_none_but_first_and_last_is_short(mode):
    time = DT * np.arange(len(mode))
    found = phases(np.array(mode), time)
    assert [found[0].start, *(p.end for p in found)] == [*(p.start for p in found), len(mode)]
    assert all(a.mode != b.mode for a, b in pairwise(found))
    assert all(time[p.end] - time[p.start] >= SHORTEST - 1e-9 for p in found[1:-1])


def test_the_middle_of_a_swerve_is_part_of_it():
    mode = steps((0, 20), (2, 10), (0, 3), (2, 10), (0, 17))
    assert [(p.mode, p.start, p.end) for p in phases(mode, TIME)] == [(0, 0, 20), (2, 20, 43), (0, 43, 60)]


def test_delays_by_hand():
    """Braking from 2 s is called a turn after 0.2 s and braking after 0.4 s; its end is never noticed."""
    true = steps((0, 20), (1, 20), (0, 20))
    likely = steps((0, 22), (2, 2), (1, 36))
    braking, steady = delays(made(true, likely), MODES)
    assert (braking.mode, steady.mode) == (1, 0)
    assert (braking.right, braking.moved) == pytest.approx((0.4, 0.2))
    assert (steady.right, steady.moved) == (np.inf, np.inf)


def test_a_model_that_leads_already_has_no_delay_and_a_phase_without_a_track_no_entry():
    true = steps((0, 20), (1, 20), (2, 20))
    likely = steps((0, 15), (1, 15), (-1, 15), (2, 15))
    (braking,) = delays(made(true, likely), MODES)
    assert (braking.right, braking.moved) == (0.0, 0.0)


def test_models_in_another_order_are_told_apart_by_their_names():
    likely = steps((0, 20), (1, 20), (2, 20))
    one = made(likely, likely)
    other = one._replace(probability=one.probability[:, [2, 0, 1]])
    assert most_likely(other, ("ct", "cv", "ca")).tolist() == likely.tolist()


def test_every_frame_with_a_track_is_counted_once():
    true, likely = steps((0, 30), (2, 30)), steps((0, 20), (-1, 20), (1, 20))
    table = confusion([made(true, likely)] * 2, MODES)
    assert table.tolist() == [[40, 0, 0], [0, 0, 0], [0, 40, 0]]


def test_a_row_of_the_table_says_never_and_counts_what_came_in_time():
    true = steps((0, 20), (1, 40))
    found = [d for n in (21, 25, 40) for d in delays(made(true, steps((0, n), (1, 60 - n))), MODES)]
    assert delay_row("a", found) == ("a", "3", "0.50", "2.00", "2", "0.50", "2.00", "2")
    lost = delays(made(true, steps((0, 60))), MODES)
    assert delay_row("b", lost)[2:5] == ("never", "never", "0")


def test_the_probe_takes_the_probabilities_of_the_track_of_each_vehicle():
    pose = np.array([[20.0, 0, 0], [50.0, 0, 0]])
    origin = Origin.empty(2)._replace(expected=np.array([5.0, 5.0]), visible=np.ones(2))
    one = np.ones(1)
    tracks = Tracks(np.array([7]), one, one, one, one > 0, None, prior(pose[1:], size=np.array([[4.5, 1.8]])), 8)
    mode = np.array([[0.2, 0.3, 0.5], [1.0, 0.0, 0.0]])
    info = StepInfo(np.zeros(0, int), np.array([7, 3]), one, one > 0, one, one, one, (), mode)
    probe, scan = ModeProbe("edra-imm"), Scan.from_xy(np.zeros((0, 2)))
    for step in range(3):
        scene = boxes_scene(pose, np.array([[4.5, 1.8]] * 2), np.array([[10.0, 0.0]] * 2), time=DT * step)
        probe(Frame(step, scene, scan, origin, {"edra-imm": (tracks, info)}, "IDLE", np.zeros((0, 2))))
    histories = {number: history(rows) for number, rows in probe.rows.items()}
    assert np.isnan(histories[0].probability).all()
    assert histories[1].probability.tolist() == [[0.2, 0.3, 0.5]] * 3


def test_a_tracker_with_one_motion_model_is_refused():
    with pytest.raises(ValueError, match="htg-map has no motion models to choose from; take one such as edra-imm"):
        ModeProbe("htg-map")


def test_page_and_figure_take_runs_of_any_length(tmp_path: Path):
    long, short = made(steps((0, 20), (1, 40)), steps((0, 25), (1, 35))), made([2] * 9, [2] * 9, TIME[:9])
    runs = {"a": [long, long], "b": [short]}
    text = render("edra-imm", runs)
    assert delay_table(runs, MODES) in text
    assert "| a, to ca | 2 | 0.50 | 0.50 | 2 |" in text
    assert "| b, ct | 9 | 0 | 0 | 100 |" in text
    assert draw(panels(runs), MODES, tmp_path / "modes.png").read_bytes()[:4] == b"\x89PNG"

"""Smoothed tracks of a run: from the history of a recorder to the log, and back out of the log."""

import gymnasium as gym
import numpy as np
import pytest

import testbed  # noqa: F401  (registers the ids)
from testbed.environment import smoothing
from testbed.environment.smoothing import StateHistory
from testbed.log import paths, reader
from tests.testbed.log import log_content
from trackers import MultiObjectTracker, RandomMatrix, Scan, SensorModel, build, prior
from trackers.batch import stack, take
from trackers.geometry import wrap_angle
from trackers.multi.smoothing import smooth_track
from trackers.multi.tracks import Tracks

DT = 0.1
TRACKER = MultiObjectTracker(RandomMatrix(), (SensorModel(),))


def track_states(frames=20, seed=0):
    """States (frames, 2) of two vehicles that drive ahead, at whose places noise is measured."""
    rng, f = np.random.default_rng(seed), TRACKER.filter
    start = prior(np.array([[0.0, 0, 0], [30.0, 4, 0]]), velocity=(15.0, 0.0))
    states = [f.init(start)]
    for _ in range(frames - 1):
        state = f.predict(states[-1], DT)
        states.append(
            state._replace(m=state.m + 0.05 * rng.standard_normal((2, 5)) * [1, 1, 0.1, 1, 0.1], P=state.P / 2)
        )
    return states


def tracks_of(state, reported=(True, True), filter=TRACKER.filter):
    existence = np.where(reported, 0.9, 0.2)
    one = np.ones(len(reported))
    id = np.array([3, 7])[: len(one)]
    return Tracks(id, existence, one.astype(int), one, one > 0, state, filter.estimate(state), 8)


def test_tracks_come_back_smoothed_at_the_frames_at_which_they_were_reported():
    states, history = track_states(), StateHistory(TRACKER)
    for k, state in enumerate(states):
        history.keep(2 * k, k * DT, tracks_of(state, (True, 5 <= k < 9 or k >= 12)))
    got = history.smoothed()
    np.testing.assert_array_equal(got.step, 2 * np.arange(20))
    assert [track.id for track in got.tracks] == [3, 7]
    np.testing.assert_array_equal(got.tracks[0].frame, np.arange(20))
    np.testing.assert_array_equal(got.tracks[1].frame, [*range(5, 9), *range(12, 20)])
    chain = take(stack(states), got.tracks[1].frame)
    other = smooth_track(TRACKER, type(chain)(*(leaf[:, 1] for leaf in chain)), [DT] * 3 + [4 * DT] + [DT] * 7)
    np.testing.assert_allclose(got.tracks[1].pose, TRACKER.filter.estimate(other).pose, atol=1e-9)
    assert len(history.smoothed().step) == 0  # a second call has nothing left


def test_tracks_with_a_size_posterior_are_smoothed_without_it():
    """A car from behind for three seconds, its speed wrong by 1 m/s at birth: smoothed places are the better ones."""
    tracker = build("imm-htg", (SensorModel(max_range=np.inf, fov=2 * np.pi),))
    rng, f, history = np.random.default_rng(2), tracker.filter, StateHistory(tracker)
    state = f.init(prior(np.array([[20.0, 0, 0]]), velocity=(14.0, 0.0)))
    places, truth = [], 20.0 + 1.5 * np.arange(30)
    for k in range(30):
        rear = np.stack([truth[k] - 2.2 + rng.normal(0, 0.3, 4), np.linspace(-0.8, 0.8, 4) + rng.normal(0, 0.2, 4)], -1)
        state, _ = f.update(f.predict(state, DT if k else 0.0), Scan.from_xy(rear[None], noise=(0.3, 0.01, np.nan)))
        places.append(f.estimate(state).pose[0, :2])
        history.keep(k, k * DT, tracks_of(state, (True,), f))
    (got,) = history.smoothed().tracks
    actual = np.stack([truth, np.zeros(30)], -1)
    before, after = (np.std((x - actual)[3:20], axis=0) for x in (np.array(places), got.pose[:, :2]))
    assert (after < 0.9 * before).all()


def test_a_history_is_full_before_a_long_run_ends():
    history, (state,) = StateHistory(TRACKER), track_states(1)
    for k in range(smoothing.FRAMES):
        assert not history.full
        history.keep(k, k * DT, tracks_of(state))
    assert history.full


def test_a_track_without_a_covariance_is_named_and_the_others_are_smoothed():
    history = StateHistory(TRACKER)
    for k, state in enumerate(track_states()):
        P = state.P.copy()
        P[0] = np.nan
        history.keep(k, k * DT, tracks_of(state._replace(P=P)))
    got = history.smoothed()
    assert got.failed == (3,)
    assert [track.id for track in got.tracks] == [7]


def run_log(tmp_path, interrupted=False, **settings):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), config={"duration": 2.0}, radar="surround", **settings)
    seen = {}

    def watch(frame):
        reported = {name: tracks.reported for name, (tracks, _) in frame.outputs.items()}
        seen[frame.step] = {name: (tracks.id, tracks.estimate) for name, tracks in reported.items()}

    env.attach(watch)
    env.reset(seed=1)
    for _ in range(1 if interrupted else 2):
        env.step(1)
    log = env.recorder.log.path
    env.recorder.close(interrupted=interrupted)
    env.close()
    return log, seen


def boxes(log, name):
    """Step -> ids, centres (n, 2) and headings of the smoothed tracks."""
    rows = [row for row in log_content.rows(log, paths.smoothed(name, "extent")) if row.get(paths.STEP) is not None]
    return {
        row[paths.STEP]: (
            np.array(row["track:id"] or [], int),
            np.array([np.mean(strip[:4], 0) for strip in row["LineStrips2D:strips"] or []]).reshape(-1, 2),
            np.array(row["track:heading"] or []),
        )
        for row in rows
    }


@pytest.mark.parametrize("interrupted", [False, True])
def test_the_log_of_a_run_has_a_smoothed_box_for_every_reported_track_at_every_frame(tmp_path, interrupted):
    log, seen = run_log(tmp_path, interrupted, tracker="rm-feldmann", also=["htg-map"])
    assert reader.complete(log)
    for name in ("rm-feldmann", "htg-map"):
        found = boxes(log, name)
        assert set(found) == set(seen)
        moved = []
        for step, (ids, centre, heading) in found.items():
            there, estimate = seen[step][name]
            assert sorted(ids) == sorted(there)
            own = estimate.pose[[np.flatnonzero(there == i)[0] for i in ids]]
            moved.append(np.column_stack([np.hypot(*(centre - own[:, :2]).T), np.abs(wrap_angle(heading - own[:, 2]))]))
        assert (np.median(np.concatenate(moved), 0) < [0.5, 0.05]).all()
        last = found[max(found)]
        there, estimate = seen[max(found)][name]
        own = estimate.pose[[np.flatnonzero(there == i)[0] for i in last[0]], :2]
        np.testing.assert_allclose(last[1], own, atol=1e-3)  # single precision; at the last frame nothing is smoothed
        (way,) = [row for row in log_content.rows(log, paths.smoothed(name, "path")) if row.get(paths.STEP) is not None]
        assert sorted(way["track:id"]) == sorted({i for ids, _, _ in found.values() for i in ids})


def test_smoothing_moves_the_boxes_of_the_past(tmp_path):
    log, seen = run_log(tmp_path, tracker="rm-feldmann")
    moved = []
    for step, (ids, centre, _) in boxes(log, "rm-feldmann").items():
        there, estimate = seen[step]["rm-feldmann"]
        rows = [np.flatnonzero(there == i)[0] for i in ids]
        moved += np.hypot(*(centre - estimate.pose[rows, :2]).T).tolist()
    assert np.median(moved) > 0.01


@pytest.mark.parametrize("kept", ["metrics", "off"])
def test_less_than_a_full_log_is_not_smoothed(tmp_path, kept):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), log=kept, radar="front", config={"duration": 1.0})
    env.reset(seed=0)
    env.step(1)
    env.close()
    for log in tmp_path.glob("*.rrd"):
        assert not any(entity.startswith("world/") for entity in reader.entity_paths(log))

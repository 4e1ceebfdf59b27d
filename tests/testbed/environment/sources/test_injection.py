"""Injected errors: each does what its name says, and none changes a bit."""

import numpy as np
import pytest

from sensors.origin import Origin
from sensors.scene import boxes_scene
from testbed.environment.sources.in_view import InView
from testbed.environment.sources.injection import LOST_FOR, Errors, Injected, parse_errors, resize_keep_edge
from trackers.multi.road import RoadMap
from trackers.scan import Scan

NO_SCAN = Scan.from_xy(np.zeros((0, 2)))
DT = 0.1


def reported(errors, speeds, heading=0.0, seed=0, objects=1):
    """Estimates and ids, scan by scan, of cars 30 m ahead (and 10 m more each) that have these speeds [m/s]."""
    source = Injected(InView(), errors, seed)
    state = source.start_on(RoadMap.of([]))
    x, found = 30.0, []
    for k, speed in enumerate(speeds):
        pose = [[x + 10 * i, 0, heading] for i in range(objects)]
        velocity = [[speed * np.cos(heading), speed * np.sin(heading)]] * objects
        scene = boxes_scene(pose, [[4.0, 2.0]] * objects, velocity, time=k * DT, dt=DT if k else 0.0)
        origin = Origin.empty(objects)._replace(visible=np.ones(objects))
        state, tracks, _ = source.step_on_truth(state, NO_SCAN, scene, origin)
        found.append(tracks)
        x += speed * DT
    return found


def test_no_error_changes_no_bit():
    plain, zero = reported(Errors(), [10.0] * 5), reported(Errors(velocity_lag=0.0, loss_rate=0.0), [10.0] * 5)
    for a, b in zip(plain, zero, strict=True):
        np.testing.assert_array_equal(a.estimate.pose, b.estimate.pose)
        np.testing.assert_array_equal(a.estimate.velocity, [[10.0, 0.0]])


def test_a_velocity_behind_a_lag_has_followed_63_percent_of_a_step_after_the_time_constant():
    speeds = [20.0, *[12.0] * 10]
    found = [t.estimate.velocity[0, 0] for t in reported(Errors(velocity_lag=0.5), speeds)]
    assert found[0] == 20.0
    assert found[5] == pytest.approx(20.0 - 8.0 * (1 - np.exp(-1)))


@pytest.mark.parametrize(("name", "theta"), [("velocity_noise", 0.5), ("lateral_velocity", 1.0)])
def test_noise_has_its_standard_deviation_and_correlation_time(name, theta):
    found = reported(Errors(**{name: 2.0}), [10.0] * 400, objects=40)
    noise = np.stack([t.estimate.velocity for t in found])[:, :, 1]  # across the heading
    assert noise.std() == pytest.approx(2.0, rel=0.1)
    lag = round(theta / DT)
    assert np.mean(noise[lag:] * noise[:-lag]) / noise.var() == pytest.approx(np.exp(-1), abs=0.1)
    along = np.stack([t.estimate.velocity for t in found])[:, :, 0]
    assert (along.std() > 1.0) == (name == "velocity_noise")


def test_noise_is_that_of_the_seed_and_the_object():
    def draw(seed, objects=2):
        return reported(Errors(velocity_noise=1.0), [10.0] * 3, seed=seed, objects=objects)[-1].estimate.velocity

    np.testing.assert_array_equal(draw(1), draw(1))
    np.testing.assert_array_equal(draw(1)[:1], draw(1, objects=1))
    assert (draw(1) != draw(2)).all()


def test_a_near_edge_that_is_too_far_moves_the_box_away_from_the_ego():
    (found,) = reported(Errors(near_edge=1.0), [10.0])
    np.testing.assert_allclose(found.estimate.pose, [[31.0, 0, 0]])
    (found,) = reported(Errors(near_edge=-1.0), [10.0], heading=np.pi)
    np.testing.assert_allclose(found.estimate.pose[:, :2], [[29.0, 0]], atol=1e-9)


def test_a_longer_box_keeps_its_near_edge():
    pose, size = resize_keep_edge(np.array([[20.0, 0, 0]]), np.array([[4.0, 2.0]]), np.array([[6.0, 2.0]]), np.zeros(3))
    np.testing.assert_allclose(pose, [[21.0, 0, 0]])  # the near edge stays at 18 m
    np.testing.assert_allclose(size, [[6.0, 2.0]])
    (found,) = reported(Errors(length=2.0), [10.0])
    np.testing.assert_allclose(found.estimate.pose[0, 0] - found.estimate.size[0, 0] / 2, 28.0)


def test_a_late_birth_leaves_the_object_out_for_so_long():
    there = [len(t.id) for t in reported(Errors(birth_delay=0.3), [10.0] * 6)]
    assert there == [0, 0, 0, 1, 1, 1]


def test_lost_tracks_are_missing_for_a_second_and_as_often_as_the_rate_says():
    found = reported(Errors(loss_rate=0.5), [10.0] * 300, objects=20)
    there = np.array([[i in t.id for i in range(20)] for t in found])
    starts = np.diff(there.astype(int), axis=0) == -1
    share = 0.5 * LOST_FOR / (1 + 0.5 * LOST_FOR)  # of the time, between losses of 1 s at 1 / rate
    assert 1 - there.mean() == pytest.approx(share, abs=0.05)
    column = int(np.flatnonzero(starts.any(0))[0])
    first = int(np.flatnonzero(starts[:, column])[0]) + 1
    assert not there[first : first + 10, column].any()


def test_old_tracks_are_predicted_with_the_velocity_of_then():
    speeds = [20.0] * 5 + [10.0] * 5
    found = reported(Errors(latency=0.2), speeds)
    x = 30.0 + DT * np.concatenate([[0.0], np.cumsum(speeds)])
    np.testing.assert_allclose(found[6].estimate.pose[0, 0], x[4] + 0.2 * 20.0)
    np.testing.assert_allclose(found[6].estimate.velocity[0, 0], 20.0)
    np.testing.assert_allclose(found[9].estimate.pose[0, 0], x[9])


def test_variances_are_scaled_and_estimates_kept():
    plain, scaled = reported(Errors(), [10.0])[0].estimate, reported(Errors(covariance=4.0), [10.0])[0].estimate
    np.testing.assert_allclose(scaled.cov, 4 * plain.cov)
    np.testing.assert_allclose(scaled.size_std, 2 * plain.size_std)
    np.testing.assert_array_equal(scaled.pose, plain.pose)


def test_texts_of_errors():
    assert parse_errors("velocity_lag=0.5+heading=.1") == Errors(velocity_lag=0.5, heading=0.1)
    assert str(Errors(velocity_lag=0.5, heading=0.1)) == "velocity_lag=0.5+heading=0.1"
    for text, sentence in {
        "lag=0.5": "got 'lag=0.5'; names are velocity_lag, ",
        "heading": "reads NAME=VALUE, got 'heading'",
        "heading=a": "must be a number, got 'a'",
        "heading=1+heading=2": "given twice",
        "heading=nan": "heading must be finite",
        "latency=-1": "latency must not be negative",
        "covariance=0": "covariance must be positive",
    }.items():
        with pytest.raises(ValueError, match=sentence.replace("+", r"\+").replace("(", r"\(")):
            parse_errors(text)

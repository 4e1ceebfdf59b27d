"""Motion modes over contour filters: the method's cases, the laws of a filter, and statistics with a negative twin."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.check import draws, laws
from testbed.check.draws import arrays, check_equal, random_prior
from tests.trackers.motion.bodies import CAR, seen_body
from trackers import Scan, find, prior
from trackers.batch import take
from trackers.composed import Composed
from trackers.filter import Abilities
from trackers.geometry import unit, wrap_angle
from trackers.motion.mixture import MotionModes, without_rates
from trackers.motion.modes import FIVE, Modes
from trackers.motion.rates import Body, ScanRates
from trackers.range_rate import RangeRates

BASES = ("htg-map", "pmht-spline", "pmht-spline-adaptive")
EITHER = pytest.mark.parametrize("base", BASES)


def moving(place, **parameters):
    """A filter of the place with motion modes."""
    return Composed(place, MotionModes(**parameters))


MAP, SPLINE, _ = (moving(find(base)) for base in BASES)


random_scan = partial(draws.random_scan, missing=True)


def circling(filter, axle, scans=45, seed=0):
    """State after scans of a car on a circle at 6 m/s and 0.5 rad/s, and its true heading and velocity."""
    rng, dt, speed, omega = np.random.default_rng(seed), 0.1, 6.0, 0.5
    lever = axle * CAR[0]
    where = np.array([30.0, 0.0])
    heading = 0.0
    state = filter.init(prior((*where, 0.0), velocity=(speed, 0.0), size=CAR, size_std=(0.1, 0.05)))
    for k in range(scans):
        if k:
            state = filter.predict(state, dt)
        heading = omega * dt * k
        around = speed / omega * np.array([np.sin(heading), 1 - np.cos(heading)])
        centre = where + around + lever * (unit(heading) - unit(0.0))
        velocity = speed * unit(heading) + omega * lever * unit(heading + np.pi / 2)
        state, _ = filter.update(state, seen_body(rng, centre, np.array(heading), velocity, np.array(omega), 12))
    return state, heading, velocity


# -- cases --------------------------------------------------------------------------------------------------------


@EITHER
def test_one_mode_without_range_rates_is_the_inner_filter(base):
    rng = np.random.default_rng(0)
    one = moving(find(base), modes=Modes(FIVE[:1]))
    start = random_prior(rng, (20,))
    state = one.predict(one.init(start), 0.1)
    scan = without_rates(random_scan(rng, start.pose, lead=(20,)))
    plain, _ = one.place.update(one.place.with_gaussian(state.place, one.gaussian(state)), scan)
    shared, _ = one.update(state, scan)
    forward = (plain.m[:, 3] > -2.0) | (plain.m[:, 3] ** 2 < 9 * plain.P[:, 3, 3])
    kept = forward | (state.motion.ahead > -0.5)  # the others are turned round
    assert kept.sum() > 5
    for got in (shared.motion.m[:, 0], one.gaussian(shared).m):
        np.testing.assert_allclose(got[kept], plain.m[kept], rtol=1e-9, atol=1e-9)
    for got in (shared.motion.P[:, 0], one.gaussian(shared).P):
        np.testing.assert_allclose(got[kept], plain.P[kept], rtol=1e-7, atol=1e-10)


def test_a_mode_far_from_the_detections_becomes_unlikely():
    state = MAP.predict(MAP.init(prior((30.0, 0.0, 0.0), velocity=(10.0, 0.0))), 0.1)
    m = state.motion.m.copy()
    m[1:, 1] += 4.0
    state = state._replace(motion=state.motion._replace(mu=np.full(5, 0.2), m=m))
    scan = without_rates(
        seen_body(np.random.default_rng(0), np.array([31.0, 0.0]), np.array(0.0), np.zeros(2), np.array(0.0), 8)
    )
    new, info = MAP.update(state, scan)
    assert new.motion.mu[0] > 0.9
    np.testing.assert_array_equal(info.mode, new.motion.mu)


@pytest.mark.parametrize("seed", range(3))
def test_a_car_that_circles_without_slip_is_in_the_mode_that_turns_about_its_centre(seed):
    state, heading, velocity = circling(SPLINE, 0.0, seed=seed)
    e = SPLINE.estimate(state)
    assert state.motion.mu[SPLINE.modes.index("turn-centre")] > 0.99
    assert abs(wrap_angle(e.pose[2] - heading)) < np.radians(0.5)
    assert np.hypot(*(e.velocity - velocity)) < 0.15


@EITHER
@pytest.mark.parametrize("seed", range(3))
def test_a_car_that_circles_about_its_rear_axle_keeps_its_velocity_and_heading(base, seed):
    f = moving(find(base))
    state, heading, velocity = circling(f, 0.5, seed=seed)
    e = f.estimate(state)
    assert np.hypot(*(e.velocity - velocity)) < 0.35
    assert abs(wrap_angle(e.pose[2] - heading)) < np.radians(5)


@pytest.mark.parametrize("seed", range(3))
def test_with_one_axle_for_all_bodies_the_heading_of_a_circling_car_is_off(seed):
    """The cases above tell right from wrong."""
    centre = moving(SPLINE.place, modes=Modes(tuple(replace(mode, axle=0.0) for mode in FIVE)))
    state, heading, _ = circling(centre, 0.5, seed=seed)
    assert abs(wrap_angle(centre.estimate(state).pose[2] - heading)) > np.radians(7)


@EITHER
def test_the_heading_of_a_standing_car_stays_as_well_known_while_nothing_is_seen(base):
    f, rng = moving(find(base)), np.random.default_rng(1)
    state = f.init(prior((30.0, 5.0, 0.5), velocity=(0.0, 0.0), size=CAR))
    for _ in range(60):
        scan = seen_body(rng, np.array([30.0, 5.0]), np.array(0.5), np.zeros(2), np.array(0.0), 8)
        state, _ = f.update(f.predict(state, 0.1), scan)
    before = f.estimate(state)
    assert abs(before.pose[2] - 0.5) < np.radians(3)
    assert f.estimate(f.predict(state, 0.1)).heading_std < 1.03 * before.heading_std
    for _ in range(5):
        state = f.predict(state, 0.1)
    assert f.estimate(state).heading_std < before.heading_std + np.radians(0.15)


@EITHER
@pytest.mark.parametrize("seed", range(3))
def test_a_car_that_starts_with_front_and_rear_exchanged_is_turned_round(base, seed):
    f, rng = moving(find(base)), np.random.default_rng(seed)
    where, velocity = np.array([30.0, 5.0]), np.array([8.0, 0.0])
    state = f.init(prior((*where, np.pi), velocity=velocity, velocity_std=5.0, size=CAR, heading_std=0.2))
    for k in range(15):
        centre = where + 0.1 * k * velocity
        scan = seen_body(rng, centre, np.array(0.0), velocity, np.array(0.0), 8, rate_noise=0.1)
        state, _ = f.update(f.predict(state, 0.1) if k else state, scan)
    e = f.estimate(state)
    assert abs(wrap_angle(e.pose[2])) < np.pi / 2
    assert e.speed > 6.0
    np.testing.assert_allclose(wrap_angle(state.motion.m[:, 2] - f.gaussian(state).m[2]), 0.0, atol=1.0)


def heading_after_a_false_alarm(driven=None):
    """Heading [rad] of a car that has driven on at 8 m/s, was hidden for 6 s, and gets a false alarm of -4 m/s.

    driven [m] replaces what is known of how far it has driven.
    """
    f, rng = moving(SPLINE.place), np.random.default_rng(4)
    where, velocity = np.array([30.0, 0.0]), np.array([8.0, 0.0])
    state = f.init(prior((*where, 0.0), velocity=velocity, size=CAR))
    for k in range(15):
        scan = seen_body(rng, where + 0.1 * k * velocity, np.array(0.0), velocity, np.array(0.0), 8, rate_noise=0.1)
        state, _ = f.update(f.predict(state, 0.1) if k else state, scan)
    for _ in range(60):
        state = f.predict(state, 0.1)
    if driven is not None:
        state = state._replace(motion=state.motion._replace(ahead=np.array(driven)))
    e = f.estimate(state)
    alarm = Scan.from_xy(e.pose[None, :2] - [2.3, 0.0], noise=(0.2, 0.01, 0.1))
    polar = alarm.polar.copy()
    polar[..., 2] = -4.0
    state, _ = f.update(state, alarm._replace(polar=polar))
    return f.estimate(state).pose[2]


def test_a_heading_that_was_driven_along_is_not_turned_round_by_the_sign_of_a_speed():
    assert abs(wrap_angle(heading_after_a_false_alarm())) < np.radians(20)
    assert abs(wrap_angle(heading_after_a_false_alarm(driven=-0.6))) > np.radians(160)


def test_what_stands_is_not_turned_round_by_speeds_of_a_moment():
    """2.5 m/s backwards for 0.1 s, as where the place of a body that stands is corrected, and for 0.3 s."""
    x = SPLINE.motion.born(SPLINE.place.gaussian(SPLINE.place.init(prior((30.0, 0.0, 0.0), velocity_std=0.1))))
    m, P = x.m.copy(), x.P.copy()
    m[:, 3], P[:, 3], P[:, :, 3] = -2.5, 0.0, 0.0
    P[:, 3, 3] = 0.1**2
    x = x._replace(m=m, P=P)
    for scans, turned in ((1, False), (3, True)):
        moved = x
        for _ in range(scans):
            moved = SPLINE.motion.predicted(moved._replace(m=x.m, P=x.P), SPLINE.place, 0.1)
        assert moved.ahead == pytest.approx(-0.1 * scans * (2.5 - 2 * 0.1), rel=1e-6)  # (MODE.30)
        new, _, found = SPLINE.motion.forward(moved._replace(m=x.m, P=x.P))
        assert bool(found) is turned
        assert (np.abs(np.cos(new.m[:, 2]) - (-1.0 if turned else 1.0)) < 1e-9).all()


def test_turns_begin_at_their_rate_whatever_the_time_step():
    modes, tenth = Modes(), np.array(9 * Modes().told_std ** 2)
    quarter, whole = (modes.begun(np.array(8.0), tenth, dt) for dt in (0.05, 0.2))
    assert whole.sum() == pytest.approx(1 - (1 - quarter.sum()) ** 4)
    assert whole.sum() == pytest.approx(1 - np.exp(-0.02 * sum(mode.onset for mode in FIVE)))
    assert (whole[[mode.onset == 0 for mode in FIVE]] == 0).all()
    g = SPLINE.place.gaussian(SPLINE.place.init(prior((30.0, 0.0, 0.0), velocity=(8.0, 0.0))))
    x = SPLINE.motion.born(g)
    x = x._replace(mu=np.eye(5)[0])
    livelier = Modes(tuple(replace(mode, onset=4 * mode.onset) for mode in FIVE))
    mu = [MotionModes(modes=m).predicted(x, SPLINE.place, 0.1).mu for m in (modes, livelier)]
    assert all(one.sum() == pytest.approx(1.0) for one in mu)
    across = x.P[0, 1, 1]
    fast, slow, standing = (
        livelier.begun(np.array(v), across, 0.1) - modes.begun(np.array(v), across, 0.1) for v in (8.0, 0.3, 0.0)
    )
    assert (mu[1] - mu[0])[3:] == pytest.approx(fast[3:])
    assert (slow[3:] < 0.2 * fast[3:]).all()
    assert (standing == 0).all()


def test_turns_begin_where_they_could_be_told():
    modes = Modes()
    seen, half, hidden = (
        modes.begun(np.array(8.0), np.array(std**2), 0.01).sum() for std in (0.0, modes.told_std, 1.0)
    )
    assert half == pytest.approx(seen / 2, rel=0.02)
    assert hidden < 0.01 * seen
    g = SPLINE.place.gaussian(SPLINE.place.init(prior((30.0, 0.0, 0.5), velocity=(8.0, 0.0))))
    x = SPLINE.motion.born(g)
    along, aside = (np.array([f(0.5) for f in one]) for one in ((np.cos, np.sin), (lambda a: -np.sin(a), np.cos)))
    turning = []
    for axis in (along, aside):
        P = x.P.copy()
        P[..., :2, :2] = 1e-4 * np.eye(2) + np.outer(axis, axis)
        turning.append(SPLINE.motion.predicted(x._replace(P=P, mu=np.eye(5)[0]), SPLINE.place, 0.05).mu[3:].sum())
    assert turning[0] > 5 * turning[1]  # what is not known along the body does not matter


@pytest.mark.parametrize("dt", [0.01, 0.5, 1.0, 2.0, 3.0, 10.0])
def test_no_gap_between_scans_makes_a_probability_or_a_variance_negative(dt):
    place = SPLINE.place
    x = SPLINE.motion.born(
        place.gaussian(place.init(prior(np.zeros((40, 3)), np.c_[np.linspace(-5, 40, 40), [0] * 40])))
    )
    for mu in (x.mu, np.eye(5)[0] + np.zeros((40, 5)), np.eye(5)[3] + np.zeros((40, 5))):
        new = SPLINE.motion.predicted(x._replace(mu=mu), place, dt)
        assert new.mu.sum(-1) == pytest.approx(1.0)
        assert new.mu.min() >= 0
        assert np.linalg.eigvalsh(new.P).min() > 0
        assert np.isfinite(new.m).all()


def test_reversing_slowly_is_not_turned_round():
    f, rng = MAP, np.random.default_rng(0)
    state = f.init(prior((30.0, 5.0, 0.0), velocity=(-1.5, 0.0), size=CAR))
    for k in range(20):
        centre = np.array([30.0 - 0.15 * k, 5.0])
        scan = seen_body(rng, centre, np.array(0.0), np.array([-1.5, 0.0]), np.array(0.0), 8)
        state, _ = f.update(f.predict(state, 0.1) if k else state, scan)
    e = f.estimate(state)
    assert abs(wrap_angle(e.pose[2])) < np.pi / 4
    assert e.speed < -1.0


def test_range_rates_that_err_together_say_less_than_those_that_do_not():
    mu, m, P, *_ = MAP.motion.born(MAP.place.gaussian(MAP.place.init(prior((30.0, 0.0, 0.0), velocity=(8.0, 0.0)))))
    where, velocity = np.array([30.0, 0.0]), np.array([8.0, 0.0])
    scan = seen_body(np.random.default_rng(0), where, np.array(0.0), velocity, np.array(0.0), 40)
    body = Body(MAP.motion.modes.axle * CAR[0], CAR[None])
    std = [np.sqrt(ScanRates(common_std=c).correct(mu, m, P, body, scan)[1][..., 3, 3]) for c in (0.01, 0.1, 0.3)]
    assert (std[0] < 0.05).all()
    assert (np.diff(std, axis=0) > 0).all()
    assert (std[2] > 0.25).all()


def yaw_rate_nees(azimuth_std, runs=300, yaw_rate=0.4, seed=5):
    """Squared errors of the yaw rate over its variance after one scan of a far body, of which all else is known.

    azimuth_std [rad] is what the scan says; it is 0.015.
    """
    rng, lead = np.random.default_rng(seed), (runs,)
    lever = rng.uniform(-0.5, 0.5, (runs, 20, 1)) * CAR[1] * np.array([0.0, 1.0]) - [CAR[0] / 2, 0.0]
    z = np.array([60.0, 0.0]) + lever
    velocity = np.array([8.0, 0.0]) + yaw_rate * np.stack([-lever[..., 1], lever[..., 0]], -1)
    polar = np.stack([np.hypot(z[..., 0], z[..., 1]), np.arctan2(z[..., 1], z[..., 0]), np.zeros((runs, 20))], -1)
    rates = (z / polar[..., :1] * velocity).sum(-1) + rng.normal(0, 0.1, (runs, 1)) + rng.normal(0, 0.14, (runs, 20))
    polar[..., 1] += rng.normal(0, 0.015, (runs, 20))
    scan = Scan(np.concatenate([polar[..., :2], rates[..., None]], -1), np.ones((runs, 20), bool), np.zeros((1, 3)),
                np.zeros((1, 2)), np.array([[0.1, azimuth_std, 0.1]]))  # fmt: skip
    m = np.broadcast_to([60.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0], (*lead, 1, 7))
    P = np.broadcast_to(np.diag([1e-6, 1e-6, 1e-6, 1e-6, 0.4**2, 1e-6, 1e-6]), (*lead, 1, 7, 7))
    m, P, _ = ScanRates().correct(np.ones((*lead, 1)), m, P, Body(np.zeros((*lead, 1)), CAR[None]), scan)
    return (m[:, 0, 4] - yaw_rate) ** 2 / P[:, 0, 4, 4]


def test_the_noise_of_a_far_place_is_not_evidence_that_a_body_does_not_turn():
    assert 0.5 < yaw_rate_nees(0.015).mean() < 1.6
    assert yaw_rate_nees(1e-6).mean() > 5.0


@pytest.mark.parametrize("filter", [SPLINE, find("pmht-spline", rates=RangeRates(weight=1.0))], ids=["modes", "alone"])
def test_range_rates_make_no_size_negative(filter):
    state = filter.init(prior((30.0, 0.0, 0.0), velocity=(8.0, 0.0), size=(1.4, CAR[1]), size_std=(3.0, 0.1)))
    can = Abilities.of(filter)
    g = can.gaussian(state)
    P = g.P.copy()
    P[3, 3], P[3, 5] = 1.0, 0.98 * 3.0  # a short body that was seen to pass: its speed is known like its length
    state = can.with_gaussian(state, g._replace(P=P + np.triu(P, 1).T))
    scan = seen_body(np.random.default_rng(0), np.array([30.0, 0.0]), np.array(0.0), np.array([5.0, 0.0]), 0.0, 30)
    state, _ = filter.update(state, scan)
    assert (filter.estimate(state).size > 0).all()


def test_a_range_rate_of_a_wheel_is_an_outlier_for_all_modes_alike():
    state = MAP.init(prior((30.0, 0.0, 0.0), velocity=(8.0, 0.0)))
    scan = seen_body(
        np.random.default_rng(0), np.array([30.0, 0.0]), np.array(0.0), np.array([8.0, 0.0]), np.array(0.0), 8
    )
    polar = scan.polar.copy()
    polar[0, 2] += 8.0
    clean, wheel = (MAP.estimate(MAP.update(state, scan._replace(polar=p))[0]) for p in (scan.polar, polar))
    assert np.hypot(*(clean.velocity - wheel.velocity)) < 0.4


# -- verbs ------------------------------------------------------------------------------------------------------------


def updated(f, rng, lead=(4,)):
    start = random_prior(rng, lead)
    return f.update(f.predict(f.init(start), 0.1), random_scan(rng, start.pose, lead=lead))[0]


@EITHER
def test_the_verbs_are_those_of_the_protocols(base):
    f = moving(find(base))
    assert Abilities.of(f).has("resize", "shift", "restart", "log_spatial", "learn_where", "gaussian", "angles")
    assert not Abilities.of(f).has("reach")
    state = updated(f, np.random.default_rng(0))
    told = f.learn_where(state, np.zeros(4, bool))
    if Abilities.of(f.place).has("learn_where"):
        assert not told.place.complete.any()
    else:
        check_equal(told, state, 0, 0)


@EITHER
@pytest.mark.parametrize("course", [0.0, 0.3])
def test_a_shift_moves_the_estimate_and_along_the_body_nothing_else(base, course):
    f, rng = moving(find(base), course=course), np.random.default_rng(2)
    state = updated(f, rng)
    straight = np.arange(len(f.modes)) == 0  # with several modes there is no one direction along the body
    mu, m = state.motion[:2]
    state = state._replace(motion=state.motion._replace(mu=np.zeros(mu.shape) + straight, m=m[:, :1] + 0 * m))
    d = rng.normal(0, 2, (4, 1)) * (unit(m[:, 0, 2]) if course else 1.0) + np.zeros((4, 2))
    state = f.shift(state, np.zeros((4, 2)))
    before, after = f.estimate(state), f.estimate(f.shift(state, d))
    pose = before.pose.copy()
    pose[:, :2] += d
    contour = None if before.contour is None else before.contour + d[:, None]
    check_equal(after, before._replace(pose=pose, contour=contour))


def heading_after_shifts(f, off=0.1, scans=30, dt=0.1):
    """Heading [rad] of a car that drives along x, started off it, which is put back on its course after every scan."""
    rng, ahead = np.random.default_rng(6), np.array([1.0, 0.0])
    start = prior((20.0, 3.0, off), velocity=12.0 * unit(off), size=CAR, size_std=(0.1, 0.05), heading_std=0.1)
    state = f.init(start)
    for k in range(scans):
        centre = np.array([20.0, 3.0]) + 12.0 * dt * k * ahead
        scan = seen_body(rng, centre[None], np.zeros(1), 12.0 * ahead[None], np.zeros(1), 2, noise=0.4)
        scan = Scan.from_xy(scan.xy[0] + np.array([0.0, 0.3]), noise=(1.0, 0.05, 0.1))
        state, _ = f.update(f.predict(state, dt) if k else state, scan)
        state = f.shift(state, centre - f.estimate(state).pose[:2])
    return f.estimate(state).pose[2]


@EITHER
def test_shifts_across_the_body_put_its_heading_right(base):
    """A filter around this one that knows the place, and puts the box there, also says where the body goes."""
    f = moving(find(base))
    assert abs(heading_after_shifts(f)) < 0.5 * abs(heading_after_shifts(moving(f.place, course=0.0)))


@EITHER
@pytest.mark.parametrize("share", [0.02, 0.3])
def test_the_mixture_keeps_the_moments_of_the_inner_filter_when_its_size_is_replaced(base, share):
    f, rng = moving(find(base)), np.random.default_rng(2)
    state = updated(f, rng)
    size = rng.uniform([3, 1.5], [12, 2.6], (4, 2))
    new = f.resize(state, size, share * size)
    e = f.estimate(new)
    np.testing.assert_allclose(e.size, size, rtol=1e-9)
    np.testing.assert_allclose(e.size_std, share * size, rtol=1e-6)
    alone = f.place.gaussian(f.place.resize(f.place.with_gaussian(state.place, f.gaussian(state)), size, share * size))
    check_equal(f.gaussian(new).m, alone.m, 1e-9)
    check_equal(f.gaussian(new).P, alone.P, 1e-6, 1e-9)


@EITHER
def test_a_restart_takes_the_estimate_and_the_modes_of_birth(base):
    f, rng = moving(find(base)), np.random.default_rng(3)
    state, other = updated(f, rng), random_prior(rng, (4,))
    new = f.restart(state, other)
    np.testing.assert_allclose(f.estimate(new).pose[:, :2], other.pose[:, :2], atol=1e-9)
    np.testing.assert_allclose(new.motion.mu, f.init(other).motion.mu)


# -- laws -------------------------------------------------------------------------------------------------------------


@EITHER
@pytest.mark.parametrize("lead", [(), (1,), (3, 2)])
def test_a_batch_equals_the_loop(base, lead):
    laws.a_batch_equals_the_loop(moving(find(base)), lead=lead, missing=True)


def test_an_object_in_a_batch_of_240_is_the_object_alone():
    rng = np.random.default_rng(6)
    start = random_prior(rng, (240,))
    state, alone = MAP.init(start), MAP.init(take(start, 7))
    for _ in range(10):
        scan = random_scan(rng, start.pose, lead=(240,))
        state = MAP.update(MAP.predict(state, 0.1), scan)[0]
        one = scan._replace(polar=scan.polar[7], mask=scan.mask[7])
        alone = MAP.update(MAP.predict(alone, 0.1), one)[0]
    check_equal(take(state, 7), alone, 1e-7, 1e-9)


@EITHER
@given(seed=st.integers(0, 2**32 - 1))
def test_order_and_padding_do_not_matter(base, seed):
    laws.order_and_padding_do_not_matter(moving(find(base)), seed, missing=True, rtol=1e-6, atol=1e-7)


@EITHER
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-3, 3))
def test_turning_the_world_turns_the_answer(base, seed, turn):
    laws.turning_the_world_turns_the_answer(moving(find(base)), seed, turn, missing=True, atol=1e-6)


@EITHER
def test_without_a_detection_the_prediction_stands(base):
    laws.without_a_detection_the_prediction_stands(moving(find(base)), missing=True)


@EITHER
def test_covariances_stay_positive_and_everything_finite(base):
    f = moving(find(base))
    state = laws.covariances_stay_symmetric_and_positive(f, 11, 1e-4, (5,), steps=8, missing=True)
    assert all(np.isfinite(a).all() for a in arrays(state))
    assert np.linalg.eigvalsh(state.motion.P).min() > 0
    np.testing.assert_allclose(state.motion.mu.sum(-1), 1.0)


@EITHER
def test_no_time_changes_nothing_and_time_does_not_run_backwards(base):
    f = moving(find(base))
    laws.a_zero_time_step_changes_nothing(f, rtol=0, atol=0)
    with pytest.raises(ValueError, match="dt must be finite, >= 0"):
        f.predict(f.init(random_prior(np.random.default_rng(0), (3,))), -0.1)


@EITHER
@pytest.mark.parametrize(
    "law",
    [
        laws.states_have_leading_axes,
        laws.there_may_be_no_object,
        laws.a_prediction_moves_by_the_velocity,
        laws.all_detections_at_one_point_leave_a_finite_state,
        laws.missing_range_rates_do_no_harm,
        laws.arguments_are_left_as_they_were,
        laws.a_filter_remembers_nothing,
        laws.detections_draw_the_estimate,
        laws.states_can_be_chosen_and_stacked,
    ],
)
def test_the_other_laws_of_a_filter_hold(base, law):
    law(moving(find(base)))


# -- consistency ------------------------------------------------------------------------------------------------------


def velocity_nees(filter, runs=60, scans=30, seed=4):
    """Squared velocity errors over their covariances, of cars that hold their course, all in one batch."""
    rng, dt = np.random.default_rng(seed), 0.1
    heading = rng.uniform(-np.pi, np.pi, runs)
    speed = rng.uniform(5, 15, runs)
    velocity = speed[:, None] * unit(heading)
    where = np.array([40.0, 0.0]) + rng.normal(0, 8, (runs, 2))
    state = filter.init(
        prior(
            np.concatenate([where, heading[:, None]], 1),
            velocity=velocity + rng.normal(0, 1, (runs, 2)),
            size=CAR,
            size_std=(0.1, 0.05),
        )
    )
    for k in range(scans):
        centre = where + dt * k * velocity
        scan = seen_body(rng, centre, heading, velocity, np.zeros(runs), 8, rate_noise=0.1)
        scan.polar[..., 2] += rng.normal(0, 0.1, (runs, 1))
        state, _ = filter.update(filter.predict(state, dt) if k else state, scan)
    e = filter.estimate(state)
    error = e.velocity - velocity
    return (error * np.linalg.solve(e.cov[:, 2:, 2:], error[..., None])[..., 0]).sum(-1)


def test_velocity_errors_are_as_large_as_they_are_said_to_be():
    assert 0.5 < velocity_nees(MAP).mean() < 3.0


def test_a_filter_that_trusts_its_range_rates_too_much_is_caught():
    sure = moving(MAP.place, rates=ScanRates(std=0.01, common_std=0.01))
    assert velocity_nees(sure).mean() > 3.0

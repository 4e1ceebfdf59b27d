"""The experiments of xia2020 on a small scale; the tables and answers are in tests/reproduction."""

import numpy as np
import pytest

import sensors
from sensors.scene import Ego, boxes_scene
from studies.papers.answer import CONFIRMED, REFUTED
from studies.papers.report import Stopped
from studies.papers.xia2020 import claims, figures
from studies.papers.xia2020.experiment import RATES, PlannedTrial, experiment, full_cases, partial_cases
from studies.papers.xia2020.generators import (
    COURSES,
    FOLLOWING,
    GENERATORS,
    MIXTURE,
    NORMALS,
    RIGHT_TURN,
    Turn,
    draw_partial,
    draw_sides,
    draw_training,
    drive,
    seen_from,
)
from studies.papers.xia2020.methods import LEARNED, MAP, ONLINE, RM, RM_MATCHED
from studies.papers.xia2020.radar import own_scans, pad
from studies.papers.xia2020.results import REFERENCE, TrialRuns
from studies.papers.xia2020.trials import (
    SIZE,
    EllipseErrors,
    NamedFilter,
    TrialEstimates,
    errors,
    extent_of,
    full_view,
    partial_view,
    track,
    unit_coordinates,
    wasserstein,
)
from testbed.experiments.engine import Engine
from trackers.batch import take
from trackers.estimate import prior
from trackers.geometry import box_corners, extent_matrix
from trackers.random_matrix.feldmann import RandomMatrix


def rng(seed=0):
    return np.random.default_rng(seed)


# -- courses and generators -------------------------------------------------------------------------------------------


def test_a_course_does_not_depend_on_the_steps():
    t = np.arange(1, 21) / 1.0
    coarse = drive(RIGHT_TURN.start, RIGHT_TURN.turns, t)
    fine = drive(RIGHT_TURN.start, RIGHT_TURN.turns, np.arange(1, 261) / 13)[12::13]
    np.testing.assert_allclose(coarse, fine, atol=1e-9)


def test_a_course_is_the_integral_of_its_speed_and_turn():
    t = np.arange(1, 20001) / 1000
    x = drive((0, 0, 0.3, 8), (Turn(5, 0.2), Turn(5, -0.2), Turn(10, 0.1)), t)
    step = np.diff(x[:, :2], axis=0) * 1000
    np.testing.assert_allclose(np.hypot(*step.T), 8.0, atol=1e-6)
    assert x[-1, 2] == pytest.approx(0.3 + 1 - 1 + 1)
    middle = (x[1:, 2] + x[:-1, 2]) / 2
    np.testing.assert_allclose(np.arctan2(step[:, 1], step[:, 0]), middle, atol=1e-4)


@pytest.mark.parametrize("course", COURSES, ids=lambda c: c.name)
def test_the_object_is_never_closer_to_the_ego_than_a_car_length(course):
    t = np.arange(0, 20, 0.1)
    ego = drive((0, 0, 0, course.start[3]), course.ego, t)
    assert np.hypot(*(drive(course.start, course.turns, t) - ego)[:, :2].T).min() > 8.0


def test_the_band_has_no_source_in_its_hole():
    wide = np.array([1e6, 1e6])  # [m] noise vanishes in unit coordinates
    u = GENERATORS["band"](rng(), (20000,), wide)
    assert (np.abs(u).max(-1) > 0.8 - 1e-5).all()
    assert np.abs(u).max() < 1 + 1e-5
    second = (4 / 3 - 0.8**2 * 4 * 0.8**2 / 3) / (4 - 4 * 0.8**2)  # by hand: the square less its core
    assert (u**2).mean() == pytest.approx(second, abs=0.005)


def test_the_published_density_has_its_moments():
    u = GENERATORS["htg"](rng(), (60000,), SIZE)
    np.testing.assert_allclose(u.mean(0), [0.0223, 0.0419], atol=0.011)  # 4 standard errors
    np.testing.assert_allclose(np.cov(u.T), [[0.4711, 0.0054], [0.0054, 0.4689]], atol=0.011)


def test_the_mixture_is_one_and_symmetric():
    mean, _, weight = zip(*MIXTURE, strict=True)
    assert sum(weight) == pytest.approx(1.0)
    np.testing.assert_allclose(np.average(mean, axis=0, weights=weight), 0.0, atol=1e-12)


def test_detections_lie_on_sides_that_face_the_sensor():
    half = np.tile([2.3, 0.9], (500, 1))
    where = np.tile([-20.0, 8.0], (500, 1))  # behind, to the left
    side = draw_sides(rng(), where, half, 20)
    assert set(np.unique(side)) == {1, 2}  # rear and left
    cosine = [17.7 / np.hypot(17.7, 8), 7.1 / np.hypot(20, 7.1)]
    share = 0.9 * cosine[0] / (0.9 * cosine[0] + 2.3 * cosine[1])
    assert (side == 1).mean() == pytest.approx(share, abs=0.02)
    np.testing.assert_array_equal(NORMALS[1], [-1, 0])


def test_a_sensor_inside_the_body_is_refused():
    with pytest.raises(ValueError, match="inside the body"):
        draw_sides(rng(), np.zeros((1, 2)), np.array([[2.3, 0.9]]), 3)


def test_a_body_seen_from_behind_shows_its_rear():
    e = draw_partial(rng(), np.tile([-30.0, 0.0], (200, 1)), np.tile([4.6, 1.8], (200, 1)), 30)
    assert (np.abs(e) <= np.array([2.3, 0.9]) + 1e-12).all()
    assert (e[..., 0] < -1.5).mean() > 0.85  # nine in ten come from the rear, 0.25 m deep
    assert abs(e[..., 1].mean()) < 0.05


def test_training_data_have_the_aspect_of_their_line_of_sight():
    data = draw_training(rng(), 4000)
    # the sensor at the body's frame: aspect 0 sees the rear
    aspect = -np.arctan2(-data.to_sensor[:, 1], -data.to_sensor[:, 0])
    np.testing.assert_allclose(np.cos(aspect - data.aspect), 1.0, atol=1e-9)
    rear = np.abs(data.aspect) < 0.05
    assert data.u[rear, 0].mean() < -0.65  # 9 in 10 lie 0.25 m behind the rear; some on the sides


# -- trials -----------------------------------------------------------------------------------------------------------


def test_a_trial_repeats_under_its_seed_and_has_its_shapes():
    a, b = (partial_view(FOLLOWING, 2.0, 3, rng(4)) for _ in range(2))
    np.testing.assert_array_equal(a.scan.xy[a.scan.mask], b.scan.xy[b.scan.mask])
    assert a.pose.shape == (40, 3, 3)
    assert a.settled == 4
    assert a.scan.mask.any(-1).all()
    assert take(a.scan, np.array(7)).mask.shape == a.scan.mask.shape[1:]


def test_detections_of_a_trial_lie_on_the_vehicle():
    u, aspect = unit_coordinates(partial_view(FOLLOWING, 2.0, 20, rng()))
    assert np.abs(aspect).min() > np.pi - 0.25  # the ego ahead sees the front
    assert 0.6 < u[:, 0].mean() < 0.85  # 9 in 10 lie 0.25 m behind the front; some on the sides
    u, _ = unit_coordinates(full_view("band", 10, rng()))
    np.testing.assert_allclose(u.mean(0), 0.0, atol=0.05)


def test_an_unknown_generator_is_refused():
    with pytest.raises(ValueError, match="band, htg, vrm"):
        full_view("bond", 1, rng())


def perfect(trial, shift=0.0):
    """Estimates that are the truth, moved along x."""
    T, R = trial.pose.shape[:2]
    size = np.broadcast_to(trial.size, (T, R, 2))
    estimate = prior(trial.pose + np.array([shift, 0, 0]), velocity=trial.velocity, size=size, position_std=0.5)
    return TrialEstimates(estimate, extent_matrix(trial.pose[..., 2], size))


def test_the_truth_has_no_error_and_a_shift_has_its_own():
    trial = partial_view(FOLLOWING, 2.0, 2, rng())
    none = errors(perfect(trial), trial)
    for name in ("position", "speed", "heading", "length", "width", "gwd2", "nees"):
        np.testing.assert_allclose(getattr(none, name), 0.0, atol=1e-9, err_msg=name)
    moved = errors(perfect(trial, 0.5), trial).summary()
    assert moved["pos"] == pytest.approx(0.5)
    assert moved["gwd2"] == pytest.approx(0.25)
    assert moved["gwd"] == pytest.approx(0.5)
    assert moved["nees"] == pytest.approx(1.0)
    assert wasserstein(perfect(trial, 0.5), trial).shape == (40, 2)


def test_a_random_matrix_is_judged_by_its_own_ellipse():
    f = RandomMatrix()
    state = f.init(prior((0, 0, 0.0), size=(4.6, 1.8)))
    X = extent_matrix(np.array(0.3), np.array([4.6, 1.8]))  # turned away from the heading
    state = state._replace(V=(state.nu - 6) * X)
    np.testing.assert_allclose(extent_of(state, f.estimate(state)), X)
    assert not np.allclose(extent_matrix(np.array(0.0), f.estimate(state).size), X, atol=0.1)


@pytest.mark.parametrize(
    ("generator", "rho", "gwd2", "tolerance"),
    [("band", 0.25, 1.70, 0.05), ("vrm", 0.25, 3.22, 0.05), ("band", 0.547, 0.274, 0.06)],
)
def test_the_random_matrix_has_the_reference_figure_in_full_view(generator, rho, gwd2, tolerance):
    trial = full_view(generator, 100, rng())
    got = errors(track(NamedFilter("RM", lambda: RandomMatrix(rho=rho)), trial), trial).gwd2.mean()
    assert got == pytest.approx(gwd2, rel=tolerance)


def test_the_random_matrix_has_the_reference_figure_in_partial_view():
    trial = partial_view(FOLLOWING, 2.0, 100, rng(2))
    got = errors(track(NamedFilter("RM", lambda: RandomMatrix(tau=10.0)), trial), trial).gwd2.mean()
    assert got == pytest.approx(3.08, rel=0.05)


# -- our radar --------------------------------------------------------------------------------------------------------


def test_only_the_car_reaches_the_filter_and_padding_keeps_runs_apart():
    car = np.array([4.7, 1.9])
    ego = Ego(np.zeros(3), np.array([8.0, 0.0]), 0.0, car, box_corners(np.zeros(3), car))
    far = [boxes_scene([[-x, 0.0, 0.0]], [[4.5, 1.8]], [[8.0, 0.0]], ego=ego) for x in (12.0, 200.0)]
    radar = sensors.find("surround")
    runs = [own_scans(far, radar, rng(k)) for k in range(3)]
    scan = pad(runs)
    assert scan.mask.shape[:2] == (2, 3)
    assert not scan.mask[1].any()  # out of range: clutter is not taken
    for k, (near, _) in enumerate(runs):
        n = len(near.mask)
        assert scan.mask[0, k].sum() == n
        np.testing.assert_allclose(scan.xy[0, k, :n], near.xy)
    assert np.hypot(*(scan.xy[0][scan.mask[0]] - [-12, 0]).T).max() < 6.0


# -- experiments ------------------------------------------------------------------------------------------------------


def small_cases():
    """Two trials of three runs, two random matrices each."""
    methods = tuple(NamedFilter(m, lambda: RandomMatrix(tau=10.0)) for m in (RM, RM_MATCHED))
    for k, course in enumerate(COURSES[:2]):
        yield PlannedTrial(lambda c=course, k=k: partial_view(c, 2.0, 3, rng(k)), methods)


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_an_experiment_counts_its_methods_and_keeps_the_reference_figures(jobs):
    calls, results = [], TrialRuns()
    experiment(tuple(small_cases()), results, lambda *call: calls.append(call), Engine(jobs))
    assert [call[:2] for call in calls] == [(0, 2), (1, 2), (0, 4), (1, 4), (2, 4), (3, 4)]
    assert [(r.case, r.method) for r in results.rows] == [
        (f"{c.name}, 2 Hz", m) for c in COURSES[:2] for m in (RM, RM_MATCHED)
    ]
    assert results.rows[0].reference == {"gwd2": 3.08, "gwd": 1.69}
    here = TrialRuns()
    experiment(tuple(small_cases()), here)
    assert here.rows == results.rows


def test_a_stopped_experiment_keeps_its_finished_rows():
    def stop(done, total, what):
        if (done, total) == (2, 4):
            raise Stopped

    results = TrialRuns()
    with pytest.raises(Stopped):
        experiment(tuple(small_cases()), results, stop)
    assert len(results.rows) == 2


def test_a_case_repeats_whatever_other_cases_are_run():
    slow, all_of_them = (list(partial_cases(2, 7, rates)) for rates in (RATES[:1], RATES))
    assert len(slow) == len(all_of_them) - 3
    for a, b in ((slow[1], all_of_them[1]), (slow[-2], all_of_them[-2])):
        np.testing.assert_array_equal(a.draw().scan.mask, b.draw().scan.mask)


def test_a_rough_start_meets_the_detections_of_the_true_one():
    true, *_, rough = (case.draw() for case in partial_cases(2, 7, RATES[:1]))
    np.testing.assert_array_equal(true.scan.polar, rough.scan.polar)
    assert np.abs(true.start.pose - rough.start.pose).max() > 0.05


def test_every_case_has_methods_of_different_names():
    for case in (*full_cases(1, 0), *partial_cases(1, 0)):
        names = [m.name for m in case.methods]
        assert len(set(names)) == len(names)


def test_figures_are_drawn_from_what_was_run(tmp_path):
    results = TrialRuns()
    experiment(tuple(small_cases())[:1], results)
    group = figures.CaseGroup("small", tuple(results.trials), (RM, RM_MATCHED), (RM,))
    for path in (
        figures.over_time(results, group, tmp_path / "a.png"),
        figures.snapshots(results, group, tmp_path / "b.png"),
    ):
        assert path.stat().st_size > 10_000


# -- answers ---------------------------------------------------------------------------------------------------------


def made_up(figures):
    """Results of which only GWD^2 and the length error are known: (case, method) -> GWD^2."""
    results = TrialRuns()
    for key, value in figures.items():
        zero = np.zeros((2, 2))
        results.errors[key] = EllipseErrors(zero, zero, zero, zero + value, zero, zero + value, zero, zero)
    return results


@pytest.mark.parametrize(
    ("online", "outcome"), [(0.2, CONFIRMED), (0.5, f"confirmed under the baseline {RM}"), (2.0, REFUTED)]
)
def test_a_verdict_says_against_which_baseline_a_claim_holds(online, outcome):
    case = "full view, band"
    results = made_up({(case, ONLINE): online, (case, RM): 1.7, (case, RM_MATCHED): 0.3, (case, MAP): 0.05})
    answer = claims.against_rm(results, "band", "ideally")
    assert answer.outcome == outcome
    assert f"{online:.2f}" in answer.numbers


@pytest.mark.parametrize(
    ("gwd2", "outcome"), [((0.9, 0.9, 0.9), "confirmed under literal"), ((0.9, 1.1, 0.9), REFUTED)]
)
def test_a_large_margin_must_be_there_on_every_course(gwd2, outcome):
    figures = {(c, m): 2.0 for c in claims.COURSES for m in (RM, RM_MATCHED)}
    figures |= {(c, LEARNED): g for c, g in zip(claims.COURSES, gwd2, strict=True)}
    figures |= {(c, MAP): 1.5 for c in claims.COURSES}
    forms = {"literal": LEARNED, "HTG-MAP": MAP}
    assert claims.large_margin(made_up(figures), claims.Claim("x", "y"), forms, 0.5).outcome == outcome


def test_the_centre_of_a_random_matrix_is_shifted_to_the_sensor():
    trial = partial_view(FOLLOWING, 2.0, 20, rng())
    results = TrialRuns()
    method = NamedFilter(RM, lambda: RandomMatrix(tau=10.0))
    results.add(trial, method, track(method, trial))
    assert results.shift_to_sensor(trial.name, RM) > 1.0
    assert results.rows[0].measured["gwd2"] == pytest.approx(results.gwd2(trial.name, RM))


def test_the_cost_of_an_update_is_that_of_one_object():
    trial = partial_view(FOLLOWING, 2.0, 2, rng())
    assert 0.01 < claims.cost(NamedFilter(RM, RandomMatrix), trial, steps=10) < 50.0  # [ms] generous: shared machines


# -- reference figures ------------------------------------------------------------------------------------------------


def test_every_reference_figure_is_found_under_its_case():
    assert REFERENCE["full view, band", RM]["gwd2"] == 1.703
    assert REFERENCE["S curve, 13 Hz", MAP] == {"gwd2": 0.22, "gwd": 0.44}
    cases = {f"full view, {g}" for g in GENERATORS} | {f"{c.name}, {hz:g} Hz" for c in COURSES for hz in RATES}
    assert {case for case, _ in REFERENCE} == cases


def test_the_sensor_is_seen_in_the_frame_of_the_body():
    d, aspect = seen_from(np.array([10.0, 5.0, 0.3]), np.array([1.0, -2.0]))
    assert aspect == pytest.approx(-0.3610431689)  # by hand
    assert np.hypot(*d) == pytest.approx(np.hypot(9, 7))

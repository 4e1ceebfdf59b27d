"""Learning of the hierarchical truncated Gaussian: gradients, optimisers, recovery, symmetry, aspect bins."""

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

from studies.papers.xia2020.generators import sample
from trackers.htg.density import HTG, log_density
from trackers.htg.learning import (
    FLAT,
    FitOptions,
    bin_index,
    canonical,
    doubts,
    fit,
    fit_table,
    limits,
    mirror,
    objective,
    pack,
    starts,
    unpack,
)
from trackers.htg.likelihood import descend, log_mass_gradient, mean_log_density

PUBLISHED = HTG(np.array(0.183), np.array([0.675, 0.670, 0.611, 0.648]), np.array(0.763), np.array([0.037, 0.035]))
NONE = np.zeros((2, 2))
# Spread of the estimates of an independent implementation from 20743 detections, in the order of `vector`.
SPREAD = np.array([0.0039, 0.0046, 0.0034, 0.0044, 0.0049, 0.0095, 0.0013, 0.0011])


def vector(p):
    """Parameters (8,) rho, a1, a2, b1, b2, theta, r1, r2."""
    return np.array([p.rho, *p.bounds, p.theta, *p.r])


def noises(n, rng):
    A = 0.2 * rng.standard_normal((n, 2, 2))
    return A @ A.mT


def differences(f, x, step=1e-6):
    return np.array([(f(x + d) - f(x - d)) / (2 * step) for d in step * np.eye(len(x))])


# -- likelihood -------------------------------------------------------------------------------------------------------


def test_the_likelihood_is_that_of_the_density_the_filters_use():
    u = np.random.default_rng(0).uniform(-2, 2, (50, 2))
    for p in (PUBLISHED, PUBLISHED._replace(bounds=np.array([0.8, np.inf, np.inf, 0.7]))):
        mean, _, log_c, _ = mean_log_density(pack(p), u, NONE)
        assert mean == pytest.approx(log_density(u, p).mean(), rel=1e-9)
        assert np.exp(log_c) == pytest.approx({True: 0.2409183502}.get(p is PUBLISHED, np.exp(log_c)), abs=1e-9)


def test_known_noise_enters_along_the_turned_axes():
    u, noise = np.random.default_rng(1).uniform(-2, 2, (30, 2)), noises(30, np.random.default_rng(2))
    c, s = np.cos(PUBLISHED.theta), np.sin(PUBLISHED.theta)
    M = np.array([[c, -s], [s, c]])
    along = np.diagonal(M.T @ noise @ M, axis1=-2, axis2=-1)
    got = mean_log_density(pack(PUBLISHED), u, noise)[0]
    assert got == pytest.approx(log_density(u, PUBLISHED, along).mean(), rel=1e-9)


@pytest.mark.parametrize("bounds", [[0.675, 0.67, 0.611, 0.648], [0.0, 2.5, 0.9, 0.1], [1.2, 1.1, 1.3, 1.2]])
def test_gradients_are_those_of_finite_differences(bounds):
    rng = np.random.default_rng(3)
    u, noise = rng.normal(size=(40, 2)), noises(40, rng)
    p = PUBLISHED._replace(bounds=np.array(bounds), rho=np.array(0.05))
    x = pack(p)
    _, gradient, _, slope = mean_log_density(x, u, noise)
    np.testing.assert_allclose(gradient, differences(lambda x: mean_log_density(x, u, noise)[0], x), atol=1e-5)
    np.testing.assert_allclose(slope, differences(lambda x: mean_log_density(x, u, noise)[2], x), atol=1e-6)
    penal = FitOptions(mass_min=0.5)
    got = objective(x, u, noise, penal)[1]
    np.testing.assert_allclose(got, differences(lambda x: objective(x, u, noise, penal)[0], x), atol=1e-3)


def test_the_density_stays_finite_deep_inside_a_large_box():
    x = np.array([np.log(0.01), 3.0, 3.0, 3.0, 3.0, 0.2, np.log(1e-4), np.log(1e-4)])
    mean, gradient, log_c, slope = mean_log_density(x, np.zeros((1, 2)), NONE)
    assert mean < -1e3
    assert log_c < -400
    assert np.isfinite([*gradient, *slope]).all()


def test_the_mass_outside_a_box_open_to_one_side_loses_only_that_side():
    closed, _ = log_mass_gradient(0.25, np.array([0.8, 40.0]), np.array([40.0, 0.7]))
    opened, slope = log_mass_gradient(0.25, np.array([0.8, np.inf]), np.array([np.inf, 0.7]))
    assert np.exp(opened) == pytest.approx(0.1311305432, abs=1e-9)
    assert opened == pytest.approx(closed, rel=1e-12)
    assert np.isfinite(slope).all()


# -- symmetry ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("quarters", [-3, -1, 1, 2])
def test_all_four_descriptions_of_a_density_have_one_canonical_form(quarters):
    p = PUBLISHED._replace(r=np.array([0.06, 0.02]))
    same = HTG(p.rho, np.roll(p.bounds, -quarters), p.theta + quarters * np.pi / 2, np.roll(p.r, quarters))
    u = np.random.default_rng(4).uniform(-1.5, 1.5, (20, 2))
    np.testing.assert_allclose(log_density(u, same), log_density(u, p), rtol=1e-9)
    np.testing.assert_allclose(vector(canonical(same)), vector(p), atol=1e-12)


def test_the_canonical_form_lies_about_a_reference_and_takes_leading_axes():
    thetas = np.array([[0.763, 0.9, -0.9], [2.5, -3.0, 0.0]])
    p = HTG(*(np.broadcast_to(leaf, (2, 3, *leaf.shape)) for leaf in PUBLISHED))._replace(theta=thetas)
    u = np.array([0.4, -1.1])
    for reference in (0.0, 1.2):
        got = canonical(p, reference)
        assert (np.abs(got.theta - reference) <= np.pi / 4 + 1e-12).all()
        np.testing.assert_allclose(log_density(u, got), log_density(u, p), rtol=1e-9)


def test_the_mirrored_density_is_the_density_of_mirrored_detections():
    u = np.random.default_rng(5).uniform(-1.5, 1.5, (20, 2))
    np.testing.assert_allclose(log_density(u * [1, -1], mirror(PUBLISHED)), log_density(u, PUBLISHED), rtol=1e-12)


# -- fit --------------------------------------------------------------------------------------------------------------


def check_recovery(seed, count):
    u = sample(PUBLISHED, count, np.random.default_rng(seed))
    found = fit(u)
    p = canonical(found.p, PUBLISHED.theta)
    off = (vector(p) - vector(PUBLISHED)) / (SPREAD * np.sqrt(20743 / count))
    gain = found.log_likelihood - log_density(u, PUBLISHED).sum()
    return off, gain


def test_the_parameters_of_a_sample_are_recovered():
    off, gain = check_recovery(seed=6, count=4000)
    assert (np.abs(off) < 4).all()
    assert 0 < gain < 15  # half the parameters on average, 10.5 at most in 20 samples of an independent implementation


def test_a_sample_of_other_parameters_is_told_apart():
    other = PUBLISHED._replace(bounds=PUBLISHED.bounds + 0.15)
    found = canonical(fit(sample(other, 4000, np.random.default_rng(6))).p, PUBLISHED.theta)
    assert (np.abs(vector(found)[1:5] - PUBLISHED.bounds) > 0.05).all()


@pytest.mark.slow
def test_twenty_samples_are_recovered_within_their_spread():
    off, gain = zip(*(check_recovery(seed, 20743) for seed in range(20)), strict=True)
    assert (np.abs(off) < 4).all()
    assert (np.abs(np.mean(off, 0)) < 4 / np.sqrt(20) + 0.5).all()  # the reference means are rounded
    assert min(gain) > 0
    assert 2 < np.mean(gain) < 7


def descend_by_coordinate(f, x, box):
    """The paper's optimiser: one bounded scalar search a coordinate, in turn, until a sweep gains nothing."""
    x, value, before = x.copy(), f(x)[0], np.inf
    while before - value > FLAT:
        before = value
        for i, bounds in enumerate(box):

            def along(t, i=i):
                return f(np.where(np.arange(len(x)) == i, t, x))[0]

            found = minimize_scalar(along, bounds=bounds, method="bounded", options={"xatol": 1e-5})
            if found.fun < value:
                x[i], value = found.x, float(found.fun)
    return x, value


def test_the_paper_s_optimiser_descends_to_the_same_place():
    u, box = sample(PUBLISHED, 250, np.random.default_rng(7)), limits(FitOptions())

    def f(x):
        return objective(x, u, NONE, FitOptions())

    start = starts(FitOptions())[0]
    assert descend(f, start, box, FLAT)[1] == pytest.approx(descend_by_coordinate(f, start, box)[1], abs=1e-7)


@pytest.mark.slow
def test_the_paper_s_optimiser_ends_in_the_same_optimum():
    u, options = sample(PUBLISHED, 250, np.random.default_rng(7)), FitOptions()

    def f(x):
        return objective(x, u, NONE, options)

    ends = (descend_by_coordinate(f, x, limits(options)) for x in starts(options)[::3])
    x, value = min(ends, key=lambda end: end[1])
    joint = fit(u)
    assert -value * len(u) == pytest.approx(joint.log_likelihood, abs=5e-3)
    u = np.array([[0.9, 0.0], [0.0, 0.0], [-1.0, 0.7]])
    np.testing.assert_allclose(log_density(u, unpack(x)), log_density(u, joint.p), atol=0.02)


def test_a_descent_ends_where_another_one_gains_nothing():
    u, options = sample(PUBLISHED, 60, np.random.default_rng(2)), FitOptions(mass_min=0.25)

    def f(x):
        return objective(x, u, NONE, options)

    for start in starts(options):  # from one of them a single run of L-BFGS-B ends 0.09 nats short
        x, value = descend(f, start, limits(options), FLAT)
        again = minimize(f, x, jac=True, method="L-BFGS-B", bounds=limits(options))
        assert value - again.fun < 1e-6


def test_the_scatter_is_found_beneath_known_noise():
    rng = np.random.default_rng(8)
    noise = np.einsum("n,ij->nij", rng.uniform(0.0, 0.1, 3000), np.eye(2))
    u = sample(PUBLISHED, 3000, rng) + np.sqrt(noise[:, :1, 0]) * rng.standard_normal((3000, 2))
    informed, ignorant = fit(u, noise).p, fit(u).p
    np.testing.assert_allclose(np.sort(informed.r), np.sort(PUBLISHED.r), atol=0.012)
    assert (ignorant.r > 0.06).all()


def test_the_penalty_keeps_mass_outside_the_box():
    rng = np.random.default_rng(9)
    rear = np.column_stack([-1 + rng.exponential(0.06, 800), rng.uniform(-0.8, 0.8, 800)])
    free, kept = (fit(rear, options=FitOptions(mass_min=least)) for least in (0.0, 0.25))
    mass = [np.exp(log_mass_gradient(float(f.p.rho), f.p.bounds[:2], f.p.bounds[2:])[0]) for f in (free, kept)]
    assert mass[0] < 0.1
    assert mass[1] > 0.2
    assert kept.log_likelihood < free.log_likelihood


def test_a_fixed_turn_is_kept():
    u = sample(PUBLISHED, 500, np.random.default_rng(10))
    assert fit(u, options=FitOptions(theta=0.1)).p.theta == 0.1


def test_a_thin_bin_and_runaway_parameters_are_warned_of():
    rear = np.column_stack([np.full(60, -0.9), np.linspace(-0.7, 0.7, 60)])
    found = fit(rear, options=FitOptions(screen=60))
    assert "only 60 detections" in found.warnings
    assert any("ran to its limit" in text for text in found.warnings)
    assert fit(sample(PUBLISHED, 1000, np.random.default_rng(11))).warnings == ()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((5, 2)),), "at least 20 detections"),
        ((np.zeros((30, 3)),), r"u must be \(N, 2\)"),
        ((np.full((30, 2), np.nan),), "60 values|30 values"),
        ((np.zeros((30, 2)), np.zeros((3, 2, 2))), "noise must be"),
    ],
)
def test_what_cannot_be_learned_from_is_refused_in_one_sentence(arguments, message):
    with pytest.raises(ValueError, match=message):
        fit(*arguments)


@pytest.mark.parametrize("wrong", [{"rho": (0.5, 0.1)}, {"r": (0.0, 0.1)}, {"mass_min": 1.5}])
def test_impossible_limits_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        FitOptions(**wrong)


# -- table ------------------------------------------------------------------------------------------------------------

QUICK = FitOptions(screen=400)


def seen(count, rng):
    """Detections at the side that faces the sensor, with the aspect; symmetric about the long axis."""
    aspect = rng.uniform(-np.pi, np.pi, count)
    toward = np.column_stack([-np.cos(aspect), np.sin(aspect)])
    return 0.9 * toward / np.abs(toward).max(1)[:, None] + 0.1 * rng.standard_normal((count, 2)), aspect


@pytest.mark.parametrize("centred", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_opposite_bins_are_mirror_images(centred):
    u, aspect = seen(1200, np.random.default_rng(12))
    got = fit_table(u, aspect, bins=4, centred=centred, options=QUICK)
    middle = -np.pi + (np.arange(4) + 0.5 * (not centred)) * np.pi / 2
    twin = bin_index(-middle, 4, centred)
    for k in range(4):
        np.testing.assert_allclose(got.table.mean[k], got.table.mean[twin[k]] * [1, -1], atol=1e-12)
        if k != twin[k]:
            mirrored = mirror(unpack(pack(HTG(*(leaf[twin[k]] for leaf in got.table.p)))))
            np.testing.assert_allclose(vector(HTG(*(leaf[k] for leaf in got.table.p))), vector(mirrored))


def test_every_bin_has_its_detections_where_the_sensor_looks():
    u, aspect = seen(1200, np.random.default_rng(13))
    got = fit_table(u, aspect, bins=4, options=QUICK)
    rear, front = got.table.bin_of(np.array([0.0, np.pi]))
    left, right = got.table.bin_of(np.array([np.pi / 2, -np.pi / 2]))
    assert got.table.mean[rear, 0] < -0.6
    assert got.table.mean[front, 0] > 0.6
    assert got.table.mean[left, 1] > 0.6
    assert got.table.mean[right, 1] < -0.6
    assert got.counts.sum() == 1200
    density = [log_density(got.table.mean[k], HTG(*(leaf[k] for leaf in got.table.p))) for k in range(4)]
    astray = [log_density(-got.table.mean[k], HTG(*(leaf[k] for leaf in got.table.p))) for k in range(4)]
    assert (np.array(density) > np.array(astray) + 3).all()


def test_a_table_without_mirroring_learns_each_bin_from_its_own_detections():
    u, aspect = seen(800, np.random.default_rng(14))
    got = fit_table(u, aspect, bins=2, mirrored=False, options=QUICK)
    own = u[bin_index(aspect, 2, True) == 1]
    np.testing.assert_allclose(got.table.mean[1], own.mean(0))
    assert got.log_likelihood[1] == pytest.approx(log_density(own, HTG(*(x[1] for x in got.table.p))).mean(), rel=1e-9)


def test_an_empty_bin_is_refused_with_its_number():
    u, aspect = seen(200, np.random.default_rng(15))
    with pytest.raises(ValueError, match=r"bin 0 of 8, at an aspect of -180 deg, has 0 detections, needs 20"):
        fit_table(u, np.clip(aspect, -0.1, 0.1), options=QUICK)


@pytest.mark.parametrize("wrong", [np.zeros(3), np.full(200, np.nan)])
def test_aspects_that_are_none_are_refused(wrong):
    with pytest.raises(ValueError, match=r"aspect must be \(200,\) finite angles"):
        fit_table(np.zeros((200, 2)), wrong, options=QUICK)


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_warnings_name_the_sides_of_the_parameters_as_they_are_reported(turn):
    """The optimum may be found in another of the four descriptions, and a twin bin has its sides mirrored."""
    p = HTG(np.array(0.5), np.array([0.5, 3.0, 0.6, 0.4]), np.array(turn), np.array([0.01, 0.02]))
    same = canonical(p)
    names = np.array(["a1", "a2", "b1", "b2"])[same.bounds == 3.0]
    assert doubts(same, 1000, FitOptions()) == tuple(f"{name} ran to its limit 3" for name in names)


def test_the_warnings_of_a_mirrored_bin_name_the_mirrored_sides():
    rng = np.random.default_rng(17)
    right = np.column_stack([rng.uniform(-1, 1, 300), rng.normal(-0.9, 0.05, 300)])
    options = FitOptions(bound_max=1.0, screen=400)
    got = fit_table(right, rng.uniform(1.0, 2.0, 300), bins=2, centred=False, options=options)
    for side, warnings in zip(("a2", "b2"), got.warnings, strict=True):
        assert f"{side} ran to its limit 1" in warnings
    for k, warnings in enumerate(got.warnings):
        assert warnings == doubts(HTG(*(leaf[k] for leaf in got.table.p)), 300, options)


def test_progress_counts_the_fits():
    u, aspect = seen(300, np.random.default_rng(16))
    calls = []
    fit_table(u, aspect, bins=2, options=QUICK, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(0, 2), (1, 2), (2, 2)]

"""The density against reference vectors, quadrature, samples and its own limits; tables there and back."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_ndtr

from studies.papers.xia2020.calibration import score, single
from studies.papers.xia2020.generators import sample
from trackers.geometry import rotation
from trackers.htg.bins import (
    HTGTable,
    UnitFrame,
    as_json,
    aspect_angle,
    by_length,
    load,
    metric_ends,
    resolve,
    warp,
)
from trackers.htg.density import HTG, complement, log_density, log_mass, moments
from trackers.htg.objective import information, score_moments

PUBLISHED = HTG(np.array(0.183), np.array([0.675, 0.670, 0.611, 0.648]), np.array(0.763), np.array([0.037, 0.035]))
OPEN = HTG(np.array(0.25), np.array([0.8, np.inf, np.inf, 0.7]), np.array(0.0), np.array([0.02, 0.03]))
POINTS = np.array([(0, 0), (0.5, 0.2), (0.9, 0), (1, 1), (-1.2, 0.4)])


def random_density(seed):
    rng = np.random.default_rng(seed)
    bounds = rng.uniform(0, 1.5, 4)
    bounds[rng.permutation(4)[: rng.integers(0, 4)]] = np.inf
    return HTG(rng.uniform(0.05, 0.6, ()), bounds, rng.uniform(-0.8, 0.8, ()), rng.uniform(0.005, 0.2, 2))


def test_mass_and_density_give_the_reference_vector():
    np.testing.assert_allclose(np.exp(log_mass(PUBLISHED)), 0.2409183502, atol=1e-10)
    expected = [-6.6421109484, -1.5646072436, -1.4950632763, -3.4420001874, -2.5973121652]
    np.testing.assert_allclose(log_density(POINTS, PUBLISHED), expected, atol=1e-9)


def test_density_with_open_sides_gives_the_reference_vector():
    np.testing.assert_allclose(np.exp(log_mass(OPEN)), 0.1311305432, atol=1e-10)
    expected = [-10.0824942238, -2.2797963997, -1.4785270147]
    np.testing.assert_allclose(log_density(POINTS[[0, 3, 4]], OPEN), expected, atol=1e-9)


def test_score_gives_the_reference_vector():
    expected = [(4.4575540125, 6.1806515083), (5.1663141711, -1.5906223020)]
    np.testing.assert_allclose(score(POINTS[[0, 4]], PUBLISHED), expected, atol=1e-9)


def test_complement_and_moments_give_the_reference_vector():
    zc, Cc = complement(PUBLISHED)
    np.testing.assert_allclose(zc, (-0.0070877254, -0.0132923338), atol=1e-9)
    np.testing.assert_allclose(Cc[[0, 0, 1], [0, 1, 1]], (0.1388286031, -0.0007839756, 0.1388988886), atol=1e-9)
    mean, cov = moments(PUBLISHED)
    np.testing.assert_allclose(mean, (0.0223318906, 0.0418812708), atol=1e-9)
    np.testing.assert_allclose(cov[[0, 0, 1], [0, 1, 1]], (0.4711316254, 0.0053846267, 0.4688846707), atol=1e-9)
    zc, Cc = complement(OPEN)
    np.testing.assert_allclose(zc, (0.0586758102, -0.0814406039), atol=1e-9)
    np.testing.assert_allclose(np.diag(Cc), (0.2196165012, 0.2163590053), atol=1e-9)


def plain_log_density(u, p):
    """(HTG.5) in its plain form: log-cdfs and logaddexp, one point after the other."""
    c, s = np.cos(p.theta), np.sin(p.theta)
    a, b = p.bounds[:2], p.bounds[2:]
    root = np.sqrt(p.rho)

    def either(low, high):
        return np.logaddexp(log_ndtr(low), log_ndtr(high))

    def union(log_x, log_y):
        return np.logaddexp(log_x, np.log1p(-np.exp(log_x)) + log_y) if log_x < -1e-300 else log_x

    out = []
    for x, y in u:
        z = np.array([c * x + s * y, c * y - s * x])
        v = p.rho + p.r
        mu, sg = p.rho * z / v, np.sqrt(p.rho * p.r / v)
        log_q = either((-a - mu) / sg, (mu - b) / sg)
        gauss = -0.5 * (z**2 / v + np.log(2 * np.pi * v)).sum()
        log_c = union(*either(-a / root, -b / root))
        out.append(gauss + union(*log_q) - log_c)
    return np.array(out)


@given(seed=st.integers(0, 2**32 - 1))
def test_density_equals_the_plain_form(seed):
    p = random_density(seed)
    u = np.random.default_rng(seed + 1).normal(0, 1, (20, 2))
    np.testing.assert_allclose(log_density(u, p), plain_log_density(u, p), rtol=1e-9, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
def test_score_is_the_slope_of_the_log_density(seed):
    p, h = random_density(seed), 1e-6
    u = np.random.default_rng(seed + 1).normal(0, 1, (10, 2))
    slope = [(log_density(u + h * e, p) - log_density(u - h * e, p)) / (2 * h) for e in np.eye(2)]
    np.testing.assert_allclose(score(u, p), np.stack(slope, -1), rtol=1e-5, atol=1e-5)


def test_density_integrates_to_its_source_convolved_with_noise():
    """Against the source inside the hole, blurred by quadrature; finite and open sides, also turned."""
    nodes, weights = np.polynomial.legendre.leggauss(300)
    g = np.linspace(-6, 6, 601)
    for p in (PUBLISHED, OPEN):
        M = rotation(p.theta)
        x, y = np.meshgrid(g, g, indexing="ij")
        cell = (g[1] - g[0]) ** 2
        dense = np.exp(log_density(np.stack([x, y], -1), p)).sum() * cell
        np.testing.assert_allclose(dense, 1, atol=1e-8)
        # One axis at a time: the blurred indicator of the inside of the box is a product of one-dimensional integrals.
        for u in POINTS:
            z = M.T @ u
            inside = np.ones(2)
            for i in range(2):
                a, b = p.bounds[i], p.bounds[i + 2]
                lo, hi = max(-a, -8 * np.sqrt(p.rho)), min(b, 8 * np.sqrt(p.rho))
                t, w = (hi - lo) / 2 * nodes + (hi + lo) / 2, weights * (hi - lo) / 2
                f = np.exp(-(t**2) / (2 * p.rho) - (z[i] - t) ** 2 / (2 * p.r[i]))
                inside[i] = (f * w).sum() / (2 * np.pi * np.sqrt(p.rho * p.r[i]))
            whole = np.exp(-0.5 * (z**2 / (p.rho + p.r)).sum()) / (2 * np.pi * np.sqrt(np.prod(p.rho + p.r)))
            expected = (whole - np.prod(inside)) / np.exp(log_mass(p))
            np.testing.assert_allclose(np.exp(log_density(u, p)), expected, atol=1e-8)


def test_the_deepest_hole_keeps_its_digits():
    """Where 1 - (1 - qx)(1 - qy) is 0 in double precision, the log is still right: the tail of the nearest side."""
    p = HTG(np.array(0.2), np.array([3.0, 3, 3, 3]), np.array(0.0), np.array([1e-4, 1e-4]))
    u = np.array([[0.0, 0.0], [0.5, -0.2]])
    value, slope = log_density(u, p), score(u, p)
    np.testing.assert_allclose(value, plain_log_density(u, p), rtol=1e-12)
    assert (value < -3e4).all()
    assert np.isfinite(slope).all()
    assert slope[1, 0] > 1e3  # pulls to the nearest side, the front


def test_without_a_hole_the_density_is_gaussian():
    p = HTG(np.array(0.3), np.zeros(4), np.array(0.4), np.array([0.02, 0.05]))
    M = rotation(p.theta)
    C = M @ np.diag(p.rho + p.r) @ M.T
    expected = -0.5 * (POINTS * np.linalg.solve(C, POINTS.T).T).sum(-1) - 0.5 * np.log(np.linalg.det(2 * np.pi * C))
    np.testing.assert_allclose(log_density(POINTS, p), expected, rtol=1e-12)


def test_more_noise_of_a_point_is_more_r():
    noise = np.random.default_rng(0).uniform(0, 0.3, (5, 2))
    each = [log_density(u, PUBLISHED._replace(r=PUBLISHED.r + n)) for u, n in zip(POINTS, noise, strict=True)]
    np.testing.assert_allclose(log_density(POINTS, PUBLISHED, noise), each, rtol=1e-12)


def test_a_batch_of_densities_equals_the_loop():
    many = [random_density(k) for k in range(6)]
    p = HTG(*(np.stack(leaves).reshape(3, 2, 1, *leaves[0].shape) for leaves in zip(*many, strict=True)))
    got, slope = log_density(np.broadcast_to(POINTS, (3, 2, 5, 2)), p), score(np.broadcast_to(POINTS, (3, 2, 5, 2)), p)
    for k, one in enumerate(many):
        np.testing.assert_allclose(got[k // 2, k % 2], log_density(POINTS, one), rtol=1e-12)
        np.testing.assert_allclose(slope[k // 2, k % 2], score(POINTS, one), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("p", [PUBLISHED, OPEN], ids=["closed", "open"])
def test_samples_have_the_moments_of_the_density(p):
    n = 400_000
    u = sample(p, n, np.random.default_rng(3))
    mean, cov = moments(p)
    error = (u.mean(0) - mean) / np.sqrt(np.diag(cov) / n)
    assert (np.abs(error) < 5).all()
    d = u - mean
    for i, j in ((0, 0), (0, 1), (1, 1)):
        product = d[:, i] * d[:, j]
        assert abs(product.mean() - cov[i, j]) < 5 * product.std() / np.sqrt(n)


def test_complement_is_what_the_hole_cuts_out():
    rng, n = np.random.default_rng(5), 500_000
    for p in (PUBLISHED, OPEN):
        z = rng.standard_normal((n, 2)) * np.sqrt(p.rho)
        z = z[((z > -p.bounds[:2]) & (z < p.bounds[2:])).all(-1)]
        z = (z + rng.standard_normal(z.shape) * np.sqrt(p.r)) @ rotation(p.theta).T
        mean, cov = complement(p)
        d = z - mean
        assert (np.abs(d.mean(0)) < 5 * np.sqrt(np.diag(cov) / len(z))).all()
        square = d[:, :, None] * d[:, None]
        assert (np.abs(square.mean(0) - cov) < 5 * square.std(0) / np.sqrt(len(z))).all()


def test_sampling_ends_when_nearly_all_the_mass_is_cut_out():
    p = HTG(np.array(0.02), np.array([1.5, 1.5, 1.5, 1.5]), np.array(0.0), np.array([1e-4, 1e-4]))
    u = sample(p, 1000, np.random.default_rng(0))
    assert np.exp(log_mass(p)) < 1e-24
    assert (np.abs(u).max(-1) > 1.4).all()


def test_expected_information_has_the_reference_values():
    F = score_moments(PUBLISHED)
    np.testing.assert_allclose(np.diag(F), [7.81, 7.82, 2.58, 2.59, 5.32, 5.36], rtol=0.01)
    np.testing.assert_allclose([F[2, 3], F[4, 5]], [2.31, 1.31], rtol=0.01)
    u = sample(PUBLISHED, 200_000, np.random.default_rng(1))
    s = score(u, PUBLISHED)
    f = np.stack([s[:, 0], s[:, 1], s[:, 0] * u[:, 1], s[:, 1] * u[:, 0], s[:, 0] * u[:, 0] + 1, s[:, 1] * u[:, 1] + 1])
    product = f[:, None] * f[None]
    assert (np.abs(product.mean(-1) - F) < 5 * product.std(-1) / np.sqrt(len(u)) + 1e-9).all()


def test_more_noise_means_less_information():
    table = single(PUBLISHED, *moments(PUBLISHED))
    F = information(table, np.zeros(3, int), np.array([[0.0, 0.0], [0.02, 0.02], [0.5, 0.5]]))
    assert (np.diff(F[:, 0, 0]) < 0).all()


def test_aspect_angle_has_the_reference_value():
    aspect = aspect_angle(np.array([10.0, 5.0]), np.array(0.3), np.array([1.0, -2.0]))
    np.testing.assert_allclose(aspect, -0.3610431689, atol=1e-9)


def some_table(B=8, **more):
    rng = np.random.default_rng(B)
    many = [random_density(k) for k in range(B)]
    p = HTG(*(np.stack(leaves) for leaves in zip(*many, strict=True)))
    cov = np.eye(2) + 0.1 * rng.random((B, 1, 1))
    return HTGTable(p, rng.normal(0, 0.3, (B, 2)), cov, **more)


def test_bins_have_the_rear_in_the_middle_of_one_or_at_an_edge():
    centred, edges = some_table(centred=True), some_table(centred=False)
    small = np.array([-0.01, 0.01])
    assert centred.bin_of(small).tolist() == [4, 4]
    assert edges.bin_of(small).tolist() == [3, 4]
    assert centred.bin_of(np.pi + small).tolist() == [0, 0]
    assert edges.bin_of(np.pi + small - 2 * np.pi).tolist() == [7, 0]
    assert centred.bin_of(np.array([-np.pi / 8 - 0.01, -np.pi / 8 + 0.01])).tolist() == [3, 4]


def test_metric_ends_face_the_sensor():
    """Seen from behind (aspect 0) the rear is metric and the width scales; seen from the left, the left side."""
    table = metric_ends(some_table())
    at = lambda aspect: table.anchor[table.bin_of(aspect)].tolist()  # noqa: E731
    assert at(0.0) == [-1, 0]
    assert at(np.pi) == [1, 0]
    assert at(np.pi / 2) == [0, 1]
    assert at(-np.pi / 2) == [0, -1]
    assert at(np.pi / 4) == [0, 0]


def test_two_classes_are_parted_by_length():
    rng = np.random.default_rng(1)
    short, long = some_table(), some_table(size=(12.0, 2.5))
    both = metric_ends(by_length(short, long, 6.5))
    assert (both.aspects, len(both)) == (8, 16)
    aspect, length = rng.uniform(-np.pi, np.pi, 50), rng.uniform(3.0, 16.0, 50)
    index = both.bin_of(aspect, length)
    for table, mine in ((short, length <= 6.5), (long, length > 6.5)):
        old = table.bin_of(aspect[mine])
        for a, b in zip(both.of(index[mine]), table.of(old), strict=True):
            np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(both.frame(index[mine]).size, np.tile(table.size, (mine.sum(), 1)))
    np.testing.assert_array_equal(both.anchor[:8], metric_ends(short).anchor)
    assert not both.anchor[8:].any()  # a truck is seen from end to end


def test_names_joined_by_plus_are_two_classes():
    both = resolve("surround-car+surround-truck")
    assert both is resolve("surround-car+surround-truck")
    np.testing.assert_array_equal(
        both.p.rho, np.concatenate([load("surround-car").p.rho, load("surround-truck").p.rho])
    )
    with pytest.raises(LookupError, match="no table 'surround-lorry'"):
        resolve("surround-car+surround-lorry")


def test_classes_with_other_bins_are_refused_and_two_are_not_one_file(tmp_path):
    both = by_length(some_table(), some_table())
    for other in (some_table(B=4), some_table(centred=False), both):
        with pytest.raises(ValueError, match="must have the same bins"):
            by_length(some_table(), other)
    with pytest.raises(ValueError, match="is of two classes"):
        as_json(both)


def test_anchors_hold_their_end_and_change_nothing_at_the_typical_size():
    size = (4.6, 1.86)
    anchor = np.array([[-1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [0.5, -0.3]])
    h, shift = warp(np.array([2.3, 0.93]), UnitFrame(anchor, np.ones(2), np.zeros(2), size))
    np.testing.assert_allclose(h, np.tile([2.3, 0.93], (4, 1)))
    np.testing.assert_allclose(shift, 0)
    h, shift = warp(np.array([6.0, 1.25]), UnitFrame(anchor, np.ones(2), np.zeros(2), size))
    ends = (np.array([-6.0, -1.25]) - shift) / h, (np.array([6.0, 1.25]) - shift) / h
    assert ends[0][0].tolist() == [-1, -1]  # rear of the truck
    np.testing.assert_allclose(ends[1][1], [1, 1])
    np.testing.assert_allclose(((-6.0 + 0.5 - shift[0, 0]) / h[0, 0]), -1 + 0.5 / 2.3)  # 0.5 m deep, as in a car


def test_a_table_survives_its_file(tmp_path):
    table = metric_ends(some_table(centred=False, size=(12.0, 2.5)))
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(as_json(table, {"from": "a test"})))
    got = load(str(path))
    for a, b in zip(
        (*table.p, table.mean, table.cov, table.anchor), (*got.p, got.mean, got.cov, got.anchor), strict=True
    ):
        np.testing.assert_array_equal(a, b)
    assert (got.centred, got.size, got.name) == (False, (12.0, 2.5), "mine")


def test_bad_tables_are_named(tmp_path):
    content = as_json(some_table())

    def loading(name, **change):
        file = tmp_path / name
        file.write_text(json.dumps({k: v for k, v in (content | change).items() if v is not None}))
        return lambda: load(str(file))

    for name, change, message in (
        ("a.json", {"format": "other"}, "is not a table of format"),
        ("b.json", {"theta": None}, "lacks theta"),
        ("c.json", {"rho": [-1.0] * 8}, "needs rho > 0"),
        ("d.json", {"mean": [[0, 0]]}, "has 8 bins"),
        ("e.json", {"anchor": [[2, 0]]}, "needs anchors"),
        ("g.json", {"shift": [2, 0]}, "needs shift"),
        ("f.json", {"size": [1.0, -1.0]}, "needs size"),
    ):
        with pytest.raises(ValueError, match=message):
            loading(name, **change)()
    with pytest.raises(LookupError, match="no table 'nowhere'"):
        load("nowhere")

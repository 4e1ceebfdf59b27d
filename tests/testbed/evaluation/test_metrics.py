"""Metrics against hand-computed cases, slow references and their invariances."""

from itertools import permutations

import numpy as np
import pytest
import scipy.linalg
import shapely
from hypothesis import given
from hypothesis import strategies as st

from testbed.evaluation.metrics import (
    areas,
    box_iou,
    contour_iou,
    gaussian_wasserstein,
    gospa,
    gwd,
    gwd2,
    mean,
    nees,
    nees_bounds,
    ragged_areas,
    rmse,
)
from trackers.geometry import box_corners, extent_matrix, rotation

HERE, CAR = np.zeros(3), np.array([4.7, 1.8])

seeds = st.integers(0, 2**32 - 1)


def random_boxes(seed, *shape):
    rng = np.random.default_rng(seed)
    pose = rng.uniform([-6, -6, -np.pi], [6, 6, np.pi], (*shape, 3))
    return pose, rng.uniform([3, 1.5], [16, 2.6], (*shape, 2))


# Gaussian Wasserstein distance


def test_the_squared_distance_of_two_turned_boxes_is_the_known_number():
    X, Y = extent_matrix(0.0, CAR), extent_matrix(0.2, np.array([4.2, 2.0]))
    assert gaussian_wasserstein(np.zeros(2), X, np.array([0.3, 0.4]), Y) == pytest.approx(0.4317102540, abs=1e-9)


def test_aligned_boxes_differ_by_their_half_sizes():
    # centres 3 and 4 m apart, half length 2 -> 3 m, half width 1 -> 1.5 m: 25 + 1 + 0.25
    a, b = np.array([4.0, 2.0]), np.array([6.0, 3.0])
    assert gwd2(HERE, a, np.array([3.0, 4.0, 0.0]), b) == pytest.approx(26.25)
    assert gwd(HERE, a, np.array([3.0, 4.0, 0.0]), b) == pytest.approx(np.sqrt(26.25))


@given(seeds)
def test_the_distance_agrees_with_general_matrix_square_roots(seed):
    pose, size = random_boxes(seed, 2)
    X, Y = extent_matrix(pose[:, 2], size)
    root = scipy.linalg.sqrtm(X)
    slow = ((pose[0, :2] - pose[1, :2]) ** 2).sum() + np.trace(X + Y - 2 * scipy.linalg.sqrtm(root @ Y @ root).real)
    assert gwd2(pose[0], size[0], pose[1], size[1]) == pytest.approx(slow, rel=1e-7, abs=1e-9)


@given(seeds)
def test_the_distance_is_symmetric_and_blind_to_frames_and_to_turned_boxes(seed):
    pose, size = random_boxes(seed, 2)
    d = gwd2(pose[0], size[0], pose[1], size[1])
    assert gwd2(pose[1], size[1], pose[0], size[0]) == pytest.approx(d, rel=1e-9, abs=1e-9)
    turned = np.concatenate([pose[:, :2] @ rotation(0.7).T + 5.0, pose[:, 2:] + 0.7], -1)
    assert gwd2(turned[0], size[0], turned[1], size[1]) == pytest.approx(d, rel=1e-9, abs=1e-9)
    around = pose[1] + [0, 0, np.pi]
    assert gwd2(pose[0], size[0], around, size[1]) == pytest.approx(d, rel=1e-9, abs=1e-9)


@given(seeds)
def test_the_distance_of_a_box_to_itself_is_zero_and_never_negative(seed):
    pose, size = random_boxes(seed, 8)
    d = gwd2(pose, size, pose, size)
    assert (d >= 0).all()
    assert (d < 1e-12 * 16**2).all()  # rounding of extents of up to (16 m / 2)^2


@given(seeds)
def test_the_distance_is_at_least_that_of_the_centres(seed):
    pose, size = random_boxes(seed, 2, 9)
    centres = np.linalg.norm(pose[0, :, :2] - pose[1, :, :2], axis=-1)
    assert (gwd(pose[0], size[0], pose[1], size[1]) >= centres - 1e-12).all()


def test_batches_equal_loops_over_single_boxes():
    pose, size = random_boxes(1, 3, 2)
    other, other_size = random_boxes(2, 2)
    for metric in (gwd2, gwd, box_iou):
        batch = metric(pose, size, other, other_size)
        loop = [[metric(pose[i, j], size[i, j], other[j], other_size[j]) for j in range(2)] for i in range(3)]
        assert batch.shape == (3, 2)
        np.testing.assert_allclose(batch, np.array(loop, float), rtol=1e-12)


# Intersection over union


@pytest.mark.parametrize(
    ("pose", "size", "expected"),
    [
        ((0.0, 0.0, 0.0), (4.0, 2.0), 1.0),
        ((0.0, 0.0, np.pi), (4.0, 2.0), 1.0),
        ((2.0, 0.0, 0.0), (4.0, 2.0), 1 / 3),  # half of each in common: 4 / (8 + 8 - 4)
        ((0.0, 0.0, np.pi / 2), (4.0, 2.0), 1 / 3),  # the cross of two boxes has a 2 x 2 middle
        ((0.0, 0.0, 0.0), (2.0, 1.0), 0.25),
        ((9.0, 0.0, 0.0), (4.0, 2.0), 0.0),
        ((4.0, 0.0, 0.0), (4.0, 2.0), 0.0),  # touching bumpers
    ],
)
def test_boxes_share_the_area_computed_by_hand(pose, size, expected):
    assert box_iou(HERE, np.array([4.0, 2.0]), np.array(pose), np.array(size)) == pytest.approx(expected, abs=1e-12)


def test_a_square_and_its_copy_turned_by_45_degrees_share_an_octagon():
    # octagon 2 (sqrt 2 - 1), union 2 - octagon: the ratio is 1 / sqrt 2
    square = np.ones(2)
    assert box_iou(HERE, square, np.array([0, 0, np.pi / 4]), square) == pytest.approx(np.sqrt(0.5), rel=1e-12)


def test_a_contour_is_more_than_its_box():
    corner = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)  # three quarters of a 2 x 2 box
    box = box_corners(np.array([1.0, 1.0, 0.0]), np.array([2.0, 2.0]))
    assert contour_iou(corner, box) == pytest.approx(0.75)
    assert contour_iou(corner, corner[::-1]) == pytest.approx(1.0)
    assert contour_iou(corner, np.roll(corner, 2, 0)) == pytest.approx(1.0)


def test_an_outline_that_crosses_itself_counts_its_even_odd_inside():
    bow_tie = np.array([[0, 0], [2, 2], [2, 0], [0, 2]], float)  # two triangles of area 1
    assert contour_iou(bow_tie, box_corners(np.array([1.0, 1.0, 0.0]), np.array([2.0, 2.0]))) == pytest.approx(0.5)


def test_outlines_of_different_length_have_the_same_areas_as_alone():
    outlines = [box_corners(HERE, CAR), np.array([[0, 0], [1, 0], [0, 1]], float), box_corners(HERE, CAR * 2)]
    np.testing.assert_allclose(shapely.area(ragged_areas(outlines)), [4.7 * 1.8, 0.5, 4 * 4.7 * 1.8])
    assert all(a.equals(areas(outline)[()]) for a, outline in zip(ragged_areas(outlines), outlines, strict=True))


def test_an_outline_with_nan_has_no_area():
    with pytest.raises(ValueError, match="outline must be finite"):
        contour_iou(np.full((4, 2), np.nan), box_corners(HERE, CAR))


# GOSPA


def slow_gospa(d, c=5.0):
    """Every assignment in turn, Rahmathullah et al. (2017), proposition 1."""
    N, T = d.shape
    slots = [*range(T), *[-1] * N]
    best = np.inf
    for owner in set(permutations(slots, N)):
        pairs = [d[i, j] ** 2 for i, j in enumerate(owner) if j >= 0 and d[i, j] < c]
        best = min(best, sum(pairs) + c**2 / 2 * (N + T - 2 * len(pairs)))
    return np.sqrt(best)


def test_one_pair_at_3_m_and_one_missed_give_4_637():
    score = gospa(np.array([[3.0], [7.0]]))
    assert score.total == pytest.approx(4.637, abs=5e-4)
    assert score[1:4] == (9.0, 12.5, 0.0)
    assert score.pairs.tolist() == [[0, 0]]


@pytest.mark.parametrize(
    ("shape", "total"),
    [((0, 0), 0.0), ((4, 0), np.sqrt(50.0)), ((0, 4), np.sqrt(50.0)), ((1, 0), 5 / np.sqrt(2))],
)
def test_truths_without_tracks_and_tracks_without_truths_cost_12_5_each(shape, total):
    assert gospa(np.zeros(shape)).total == pytest.approx(total, abs=1e-12)


def test_a_perfect_set_costs_nothing():
    distance = np.full((5, 5), 40.0)
    np.fill_diagonal(distance, 0.0)
    assert gospa(distance).total == 0.0


def test_the_rooted_distance_is_compared_with_the_cut_off():
    # 4.9^2 = 24 is far above 5, and yet a pair; at 5 m it is a missed and a false one
    assert gospa(np.array([[4.9]])).total == pytest.approx(4.9)
    at_cutoff = gospa(np.array([[5.0]]))
    assert at_cutoff[1:4] == (0.0, 12.5, 12.5)
    assert len(at_cutoff.pairs) == 0


def test_the_best_set_of_pairs_is_found_not_the_nearest_first():
    # nearest first: 1.0 and then 4.5, 21.25; crossed: 2 and 2, 8
    assert gospa(np.array([[1.0, 2.0], [2.0, 4.5]])).localisation == pytest.approx(8.0)


@given(seeds, st.integers(0, 3), st.integers(0, 3))
def test_gospa_is_the_minimum_over_all_assignments(seed, N, T):
    distance = np.random.default_rng(seed).uniform(0, 8, (N, T))
    assert gospa(distance).total == pytest.approx(slow_gospa(distance), abs=1e-9)


@given(seeds)
def test_order_of_truths_and_tracks_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    distance, counted = rng.uniform(0, 8, (6, 5)), rng.random(6) < 0.6
    rows, columns = rng.permutation(6), rng.permutation(5)
    score, other = gospa(distance, counted), gospa(distance[rows][:, columns], counted[rows])
    np.testing.assert_allclose(other[:4], score[:4], atol=1e-9)
    assert {(rows[i], columns[j]) for i, j in other.pairs} == {tuple(pair) for pair in score.pairs}


@given(seeds)
def test_the_parts_add_up_to_the_square(seed):
    score = gospa(np.random.default_rng(seed).uniform(0, 8, (4, 6)))
    assert score.localisation + score.missed + score.false == pytest.approx(score.total**2)


def test_a_track_on_an_uncounted_truth_is_neither_good_nor_false():
    distance = np.array([[1.0, 9.0], [9.0, 2.0], [9.0, 9.0]])
    score = gospa(distance, counted=np.array([True, False, False]))
    assert score[:4] == (1.0, 1.0, 0.0, 0.0)
    assert score.pairs.tolist() == [[0, 0], [1, 1]]


@pytest.mark.parametrize("distance", [np.zeros(3), np.array([[np.nan]]), np.array([[-1.0]]), np.array([[np.inf]])])
def test_impossible_distances_are_refused(distance):
    with pytest.raises(ValueError, match="distance must be"):
        gospa(distance)


def test_a_mask_of_the_wrong_length_is_refused():
    with pytest.raises(ValueError, match="counted must be"):
        gospa(np.zeros((2, 2)), counted=np.ones(3, bool))


# NEES and averages


def test_nees_is_the_squared_error_in_standard_deviations():
    cov = np.array([[4.0, 0.0], [0.0, 9.0]])
    assert nees(np.array([2.0, 3.0]), cov) == pytest.approx(2.0)
    np.testing.assert_allclose(nees(np.array([[4.0, 0.0], [0.0, 0.0]]), cov), [4.0, 0.0])


def test_the_bounds_are_the_printed_quantiles_of_chi_square():
    # chi-square, 2 degrees of freedom, 0.025 and 0.975: 0.0506 and 7.378; 20: 9.591 and 34.170
    assert nees_bounds(2, 1) == pytest.approx((0.0506, 7.378), abs=5e-4)
    assert nees_bounds(2, 10) == pytest.approx((0.9591, 3.4170), abs=1e-4)
    assert np.isnan(nees_bounds(2, 0)).all()


def test_honest_errors_stay_inside_the_bounds_and_boasted_ones_do_not():
    cov = np.array([[0.5, 0.2], [0.2, 0.3]])
    error = np.random.default_rng(4).multivariate_normal(np.zeros(2), cov, 2000)
    low, high = nees_bounds(2, 2000, level=0.999)
    assert low < nees(error, cov).mean() < high
    assert nees(error, 0.8 * cov).mean() > high
    assert nees(error, 1.25 * cov).mean() < low


def test_a_covariance_that_is_not_positive_definite_is_refused():
    with pytest.raises(ValueError, match="cov must be positive definite"):
        nees(np.ones(2), np.diag([1.0, 0.0]))


def test_averages_of_nothing_are_nan_and_of_something_by_hand():
    assert np.isnan(rmse([]))
    assert np.isnan(mean([]))
    assert rmse([3.0, -4.0]) == pytest.approx(np.sqrt(12.5))
    assert mean([3.0, -4.0]) == pytest.approx(-0.5)

"""Sizes of vehicles: within their ranges, distributed as stated, the same under the same seed."""

from math import inf

import numpy as np
import pytest
from scipy.stats import truncnorm

from scenarios.contours import CONTOURS, Sizes, Spread

DRAWN = {name: contour.sizes for name, contour in CONTOURS.items() if contour.sizes is not None}
every_class = pytest.mark.parametrize("sizes", DRAWN.values(), ids=DRAWN.keys())
N = 4000


def draws(sizes, seed=0):
    """Lengths and widths (N, 2) [m]."""
    rng = np.random.default_rng(seed)
    return np.array([sizes.draw(rng) for _ in range(N)])


def moments(spread):
    """Mean and standard deviation [m] of a spread, from scipy."""
    if spread.std == inf:
        return spread.mean, (spread.high - spread.low) / np.sqrt(12)
    if spread.std == 0:
        return spread.mean, 0.0
    cut = (np.array([spread.low, spread.high]) - spread.mean) / spread.std
    law = truncnorm(*cut, spread.mean, spread.std)
    return float(law.mean()), float(law.std())


def near(x, spread):
    """Whether mean and standard deviation of draws (n,) are those of a spread, within 4 of their standard errors."""
    mean, std = moments(spread)
    error = std / np.sqrt(len(x)) + 1e-12
    return (
        abs(x.mean() - mean) < 4 * error and abs(x.std() - std) < 4 * error
    )  # that of a std is at most that of a mean


def test_only_tractor_units_and_boxes_are_all_alike():
    assert CONTOURS.keys() - DRAWN.keys() == {"tractor-unit", "box"}


@every_class
def test_no_draw_leaves_the_stated_box_and_long_vehicles_fill_it(sizes):
    x = draws(sizes)
    assert (x >= sizes.box[0]).all()
    assert (x <= sizes.box[1]).all()
    assert x[:, 0].min() < sizes.length.low + 0.25  # [m] the range is one that draws come near
    assert x[:, 0].max() > sizes.box[1, 0] - 0.25


@every_class
def test_mean_and_spread_of_many_draws_are_those_stated(sizes):
    x = draws(sizes)
    usual = x[x[:, 0] <= sizes.length.high]
    assert near(usual[:, 0], sizes.length)
    assert near(x[:, 1] - sizes.slope * (x[:, 0] - sizes.length.mean), sizes.width)


def test_draws_with_another_spread_are_caught():
    car = DRAWN["car"]
    other = Sizes(Spread(4.45, 0.3, 3.6, 5.3), car.width, car.slope)
    assert not near(draws(other)[:, 0], car.length)


@pytest.mark.parametrize(("name", "share", "length"), [("bus", 0.1, 18.0), ("trailer", 0.15, 15.85)])
def test_some_buses_and_trailers_have_one_greater_length(name, share, length):
    x = draws(DRAWN[name])[:, 0]
    long = x > DRAWN[name].length.high
    assert (x[long] == length).all()
    assert abs(long.mean() - share) < 4 * np.sqrt(share * (1 - share) / N)


@pytest.mark.parametrize(("name", "together"), [("car", True), ("tractor", True), ("van", False), ("truck", False)])
def test_longer_cars_and_tractors_are_wider(name, together):
    length, width = draws(DRAWN[name]).T
    r = np.corrcoef(length, width)[0, 1]
    assert (0.4 < r < 0.8) if together else abs(r) < 4 / np.sqrt(N)


@every_class
def test_the_same_seed_gives_the_same_vehicles_and_another_seed_others(sizes):
    first, again, other = draws(sizes, 3), draws(sizes, 3), draws(sizes, 4)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("bad", [(3.0, 0.1, 4.0, 5.0), (4.5, -0.1, 4.0, 5.0), (0.0, 0.1, 0.0, 1.0)])
def test_a_spread_without_its_mean_or_below_zero_is_refused(bad):
    with pytest.raises(ValueError, match="a spread needs"):
        Spread(*bad)


@pytest.mark.parametrize("long", [(0.1, 4.9), (1.5, 18.0)])
def test_long_vehicles_that_are_not_longer_or_no_share_are_refused(long):
    with pytest.raises(ValueError, match="long needs a share"):
        Sizes(Spread(4.5, 0.1, 4.0, 5.0), Spread(2.0, 0.1, 1.8, 2.2), long=long)

"""Range rates of the real radar: the grid, folded rates, and the spread of a simulated scan with known noise."""

import numpy as np
import pytest

from studies.rigs.range_rates import Steps, measured, rest_of, steps_of
from studies.standing.statistics import STILL, spread

STEPS = Steps(0.08, 128)


def scan(noise, ego=(17.0, 0.3), seed=0, standing=900, moving=200):
    """Lines of sight and rates on the grid, a share of them of traffic."""
    rng = np.random.default_rng(seed)
    a = rng.uniform(-0.9, 0.9, standing + moving)
    sight = np.stack([np.cos(a), np.sin(a)], -1)
    rate = -sight @ np.array(ego) + noise * rng.standard_normal(len(a))
    rate[standing:] += rng.uniform(2.0, 8.0, moving)
    return sight, STEPS.width * np.rint(STEPS.folded(rate) / STEPS.width)


def test_the_grid_is_found_also_where_some_of_its_values_are_missing():
    rate = 0.0812 * np.array([-63, -62, -61, -10, 0, 1, 2, 3, 64])
    found = steps_of(rate)
    assert found.number == 128
    assert found.width == pytest.approx(0.0812)
    with pytest.raises(ValueError, match="do not lie on a grid"):
        steps_of(np.random.default_rng(0).random(50))


@pytest.mark.parametrize("noise", [0.03, 0.08])
def test_the_spread_is_that_of_the_noise_though_rates_are_folded_and_the_ego_is_fast(noise):
    sight, rate = scan(noise)
    assert np.abs(rate).max() <= STEPS.lap / 2  # the ego is faster than the lap: 17 m/s of 10.2
    rest = rest_of(sight, rate, STEPS)
    still = np.abs(rest) < STILL
    assert still[:900].mean() > 0.99
    expected = np.hypot(noise, STEPS.width / np.sqrt(12))
    assert spread(rest[:900]) == pytest.approx(expected, rel=0.15)  # 3.5 standard errors of a median of 900


def test_folded_rates_by_hand():
    np.testing.assert_allclose(Steps(1.0, 10).folded(np.array([4.0, 6.0, -6.0, 17.0])), [4.0, -4.0, 4.0, -3.0])


def test_a_folder_without_scans_is_answered_in_one_sentence(tmp_path):
    with pytest.raises(ValueError, match="has no scans_"):
        measured(tmp_path)

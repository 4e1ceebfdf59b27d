"""Shapley values: they add up, and give each group what it causes."""

import numpy as np
import pytest

from testbed.environment.sources.substitution import subsets
from testbed.experiments.statistics import shapley


def test_an_additive_game_gives_every_group_its_own_worth():
    worth = {"E": 3.0, "G": -1.0, "V": 0.5}
    values = {s: np.array(10.0 + sum(worth[g] for g in s)) for s in subsets()}
    assert {g: v.item() for g, v in shapley(values).items()} == pytest.approx(worth)


def test_an_interaction_is_shared_and_a_group_without_effect_gets_nothing():
    values = {s: np.array(6.0 if "E" in s and "G" in s else 0.0) for s in subsets()}
    assert {g: v.item() for g, v in shapley(values).items()} == pytest.approx({"E": 3.0, "G": 3.0, "V": 0.0})


def test_the_values_add_up_to_the_difference_of_all_groups_to_none():
    rng = np.random.default_rng(1)
    values = {s: rng.standard_normal(5) for s in subsets()}
    np.testing.assert_allclose(sum(shapley(values).values()), values["EGV"] - values[""], atol=1e-9)

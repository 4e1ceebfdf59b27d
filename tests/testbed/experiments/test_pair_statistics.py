"""Differences, attribution and rankings from tables made by hand."""

import numpy as np
import pandas as pd
import pytest

from studies.regret.caution import differences
from testbed.environment.sources.injection import Errors
from testbed.environment.sources.substitution import subsets
from testbed.experiments.pairs import (
    MEASURES,
    SCORE,
    Cell,
    attributions,
    cells,
    change,
    compared_with,
    correlations,
    error_and_regret,
    worst_pairs,
)
from testbed.experiments.report.figures_regret import DOSE_UNITS, by_scenario, dose_response
from testbed.experiments.report.words import one_sided, unresolved_pairs

SEEDS = range(8)


def drive_rows(worth, scenario="probe-brake", planner="idm", **more):
    """One row a condition and seed; worth: condition -> score at each seed, and more columns."""
    rows = []
    for condition, values in worth.items():
        for seed in SEEDS:
            row = dict.fromkeys((*MEASURES, SCORE), 0.0) | {key: v[seed] for key, v in more.items()}
            rows.append({"scenario": scenario, "planner": planner, "condition": condition, "seed": seed, **row})
            rows[-1]["score"] = float(values[seed])
    return rows


def pair_rows(values, key="score", reference="truth", condition="t", scenario="probe-brake"):
    """One row a seed with one measure, the others zero."""
    same = dict.fromkeys((*MEASURES, SCORE), 0.0) | {"parted": 1.0, "parting": "at 1.0 s"}
    same |= {"reference": reference, "scenario": scenario, "planner": "idm", "condition": condition}
    return [{**same, "seed": k, key: v} for k, v in enumerate(values)]


def test_a_change_that_all_seeds_share_is_resolved_and_its_side_depends_on_the_measure():
    steady = -1.0 + 0.1 * np.arange(8) / 8
    (less_score,) = cells(pd.DataFrame(pair_rows(steady, "score")), ("score",))
    (less_risk,) = cells(pd.DataFrame(pair_rows(steady, "tit")), ("tit",))
    assert less_score.verdict == "worse"
    assert less_risk.verdict == "better"
    assert less_score.change.mean.value == pytest.approx(steady.mean())
    assert less_score.change.mean.low <= steady.mean() <= less_score.change.mean.high < 0


def test_a_change_of_either_sign_is_unresolved_and_says_how_many_seeds_it_needs():
    mixed = np.array([1.0, -0.8, 0.9, -1.0, 1.1, -0.7, 0.8, -0.9])
    found = list(cells(pd.DataFrame(pair_rows(mixed)), ("score",)))
    assert found[0].verdict == "unresolved"
    (sentence,) = unresolved_pairs(found)
    assert "seeds would resolve it" in sentence
    assert found[0].change.needed > 8


def test_all_scenarios_together_weigh_alike():
    rows = pair_rows([1.0] * 8) + pair_rows([4.0] * 4, scenario="probe-jam")
    (cell,) = cells(pd.DataFrame(rows), ("score",), together=True)
    assert cell.change.mean.value == pytest.approx(2.5)


def test_safer_than_the_truth_at_the_price_of_progress_is_said():
    steady = 1.0 + 0.1 * np.arange(8) / 8
    rows = pair_rows(-steady, "tit")
    for row, value in zip(rows, -7 * steady, strict=True):
        row["progress"] = value
    (sentence,) = one_sided(list(cells(pd.DataFrame(rows), ("tit", "progress"))))
    assert "looks safer and pays with progress" in sentence
    assert one_sided(list(cells(pd.DataFrame(pair_rows(steady, "tit")), ("tit", "progress")))) == []


def test_references_are_kept_apart():
    rows = pair_rows([1.0] * 3) + pair_rows([2.0] * 3, reference="in-view") + pair_rows([3.0] * 3, condition="in-view")
    table = pd.DataFrame(rows)
    assert compared_with(table, "truth")["score"].tolist() == [1.0] * 3
    assert compared_with(table, "in-view")["score"].tolist() == [2.0] * 3
    assert compared_with(table, "truth", sensing=True)["score"].tolist() == [3.0] * 3


def test_the_attribution_adds_up_and_finds_the_group_that_costs():
    noise = np.random.default_rng(3).standard_normal(8)
    names = {subset: f"t:{subset}" for subset in subsets()} | {"": "in-view", "EGV": "t"}
    worth = {name: noise + (-2.0 if "E" in subset else 0.0) for subset, name in names.items()}
    (found,) = attributions(pd.DataFrame(drive_rows(worth)), ("score",))
    assert found.seeds == 8
    assert found.share["E"].value == pytest.approx(-2.0)
    assert found.share["G"].value == pytest.approx(0.0, abs=1e-12)
    assert sum(s.value for s in found.share.values()) == pytest.approx(found.total.value)
    assert found.repaired["E"].value == pytest.approx(2.0)


def test_a_seed_that_lacks_a_drive_is_left_out_of_the_attribution():
    names = {subset: f"t:{subset}" for subset in subsets()} | {"": "in-view", "EGV": "t"}
    rows = drive_rows({name: np.arange(8.0) for name in names.values()})
    rows = [row for row in rows if (row["condition"], row["seed"]) != ("t:GV", 5)]
    (found,) = attributions(pd.DataFrame(rows), ("score",))
    assert found.seeds == 7


def test_the_error_that_goes_with_regret_ranks_first():
    drives, pairs = [], []
    for k, name in enumerate("abcde"):
        more = {"gospa": [float(k)] * 8, "rmse_position": [float(k % 2)] * 8}
        drives += drive_rows({name: [0.0] * 8}, **more)
        pairs += pair_rows([-float(k**2)] * 8, condition=name)
    table = error_and_regret(pd.DataFrame(drives), pd.DataFrame(pairs))
    assert table["regret"].tolist() == [0, 1, 4, 9, 16]
    found = correlations(table)
    assert (found[0].error, found[0].rho) == ("gospa", pytest.approx(1.0))
    assert abs(found[-1].rho) < 0.5


def test_a_hard_scenario_makes_no_rank_correlation():
    rows = [
        {"scenario": scenario, "planner": "idm", "condition": name, "regret": hard + sign * k, "gospa": hard + k}
        for scenario, hard, sign in (("a", 0.0, 1.0), ("b", 100.0, -1.0))
        for k, name in enumerate("tuv")
    ]
    (found,) = correlations(pd.DataFrame(rows))
    assert found.rho == pytest.approx(0.0)  # 1 in one scenario, -1 in the other; pooled it would be positive
    assert found.means == 6


def test_the_worst_pair_is_that_with_the_largest_regret():
    (found,) = worst_pairs(pd.DataFrame(pair_rows([0.5, -3.0, 1.0])))
    assert found.drive.seed == 1
    assert found.regret == 3.0
    assert found.parting == "at 1.0 s"


def test_caution_is_compared_on_the_same_seeds_and_tracks():
    rows = drive_rows({"t": np.arange(8.0)}, planner="mpc") + drive_rows(
        {"t": np.arange(8.0) + 0.5}, planner="mpc-cautious"
    )
    found = {c.scenario: c for c in differences(pd.DataFrame(rows)) if c.measure == "score"}
    assert found["probe-brake"].change.mean.value == pytest.approx(0.5)
    assert found["all"].verdict == "better"


def test_a_dose_on_either_side_of_none_is_drawn_in_order():
    doses = {-1.0: 0.3, 1.0: -0.2, 0.5: -0.1}
    found = [
        Cell("probe-brake", "idm", f"in-view+near_edge={dose:g}", "score", change([np.full(8, worth)]))
        for dose, worth in doses.items()
    ]
    (line, _) = dose_response(found).axes[0].lines
    assert line.get_xdata().tolist() == [-1.0, 0.0, 0.5, 1.0]
    assert line.get_ydata() == pytest.approx([-0.3, 0.0, 0.1, 0.2])


def test_a_planner_that_drives_in_one_probe_alone_is_in_the_legend():
    worth = change([np.full(8, 0.1)])
    found = [Cell(f"probe-{where}", planner, "imm-spline", "score", worth)
             for where, planner in (("brake", "idm"), ("merge", "idm"), ("merge", "idm-keen"))]  # fmt: skip
    (legend,) = by_scenario(found).legends
    assert [text.get_text() for text in legend.get_texts()] == ["idm", "idm-keen"]


def test_every_injected_error_has_a_unit_in_the_figure():
    assert DOSE_UNITS.keys() == Errors.__dataclass_fields__.keys()

"""xia2020 at full length: the card's bars, and the verdicts that are not in doubt."""

import json

import numpy as np
import pytest

from testbed.papers import xia2020
from testbed.papers.xia2020_claims import COURSES, ROUGH, SPARSE
from testbed.papers.xia2020_generators import GENERATORS
from testbed.papers.xia2020_methods import LEARNED, LEARNED_N, MAP, MM, ONLINE, ONLINE_N, RM, RM_MATCHED

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def full():
    """Section 8.1, 100 runs."""
    return xia2020.run_full_view()


@pytest.fixture(scope="module")
def partial():
    """Section 8.2 at 2 Hz, 100 runs."""
    return xia2020.run_partial_view(rates=(2.0,))


@pytest.mark.parametrize(
    ("case", "method", "value", "tolerance"),
    [
        ("full view, band", RM, 1.70, 0.05),
        ("full view, vrm", RM, 3.22, 0.05),
        ("full view, band", RM_MATCHED, 0.274, 0.06),
    ],
)
def test_the_baselines_meet_the_card_on_both_sides(full, case, method, value, tolerance):
    assert full.gwd2(case, method) == pytest.approx(value, rel=tolerance)


def test_the_baseline_of_the_following_course_meets_the_card_on_both_sides(partial):
    assert partial.gwd2(COURSES[0], RM) == pytest.approx(3.08, rel=0.05)


@pytest.mark.parametrize(
    ("case", "method", "bar"),
    [
        ("full view, band", ONLINE, 0.22),
        ("full view, band", LEARNED_N, 0.25),
        ("full view, htg", MAP, 0.09),
        ("full view, band", MAP, 0.055),
    ],
)
def test_full_view_is_at_or_below_the_bar(full, case, method, bar):
    assert full.gwd2(case, method) <= bar


def test_the_student_t_mixture_is_tracked_in_the_median(full):
    assert np.median(full.errors["full view, vrm", MAP].gwd2) <= 0.035


@pytest.mark.parametrize("generator", ["htg", "band"])
def test_the_position_of_htg_map_is_nearly_as_good_as_it_says(full, generator):
    assert full.errors[f"full view, {generator}", MAP].nees.mean() <= 2.2


@pytest.mark.parametrize(
    ("method", "bars"), [(MM, (0.80, 0.85, 1.30)), (MAP, (0.28, 0.32, 0.35))], ids=["moments", "map"]
)
def test_partial_view_is_at_or_below_the_bar(partial, method, bars):
    assert [partial.gwd2(case, method) <= bar for case, bar in zip(COURSES, bars, strict=True)] == [True] * 3


def test_the_order_of_the_methods_is_the_cards(full, partial):
    for generator in GENERATORS:
        case = f"full view, {generator}"
        assert full.gwd2(case, MAP) < 0.5 * full.gwd2(case, LEARNED_N) < full.gwd2(case, LEARNED)
    for case in COURSES:
        assert partial.gwd2(case, MAP) < 0.5 * partial.gwd2(case, MM)
        assert partial.gwd2(case, MM) < min(partial.gwd2(case, m) for m in (RM, RM_MATCHED, LEARNED, ONLINE_N))


def test_sparse_detections_and_a_rough_start_leave_the_order_alone(partial):
    for case in (SPARSE, ROUGH):
        assert partial.gwd2(case, MAP) < 0.5 * partial.gwd2(case, RM)


def test_the_whole_report_is_written_and_says_which_claims_hold(tmp_path):
    report = xia2020.run(runs=20, out=tmp_path, learned=True)
    assert {v.claim.source for v in report.verdicts} >= {"paper, V-B", "paper, IV-B", "paper, abstract"}
    assert len(report.tables()) == len(report.cases) + 1
    written = json.loads((tmp_path / "xia2020-learned.json").read_text())
    assert len(written["rows"]) == len(report.rows)
    assert len(report.figures) == 5
    assert all(figure.stat().st_size > 20000 for figure in report.figures)

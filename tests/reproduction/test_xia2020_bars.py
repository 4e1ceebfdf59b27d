"""xia2020 as `testbed reproduce` runs it: the order of the methods, and the answers that are not in doubt.

The bars of the filters by themselves are in test_htg_bars.py.
"""

import json

import pytest

from studies.papers.answer import CONFIRMED, REFUTED
from studies.papers.xia2020 import experiment as xia2020
from studies.papers.xia2020.claims import COURSES, ROUGH, SPARSE
from studies.papers.xia2020.generators import GENERATORS
from studies.papers.xia2020.methods import BEST, LEARNED, LEARNED_N, MAP, MM, ONLINE_N, RM, RM_MATCHED

pytestmark = pytest.mark.slow

RUNS = 20


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("xia2020")


@pytest.fixture(scope="module")
def paper(out):
    return xia2020.run(RUNS, out, learned=True)


@pytest.fixture(scope="module")
def slides(out):
    return xia2020.run(RUNS, out)


def gwd2(report, case, method):
    return report.row(case, method)["gwd2"]


def test_the_methods_come_in_the_order_of_the_reference(paper):
    for generator in GENERATORS:
        case = f"full view, {generator}"
        assert gwd2(paper, case, MAP) < 0.5 * gwd2(paper, case, LEARNED_N) < gwd2(paper, case, LEARNED)
    for case in COURSES:
        assert gwd2(paper, case, MAP) < 0.6 * gwd2(paper, case, MM)
        assert gwd2(paper, case, BEST) < gwd2(paper, case, MAP)
        assert gwd2(paper, case, MM) < min(gwd2(paper, case, m) for m in (RM, RM_MATCHED, LEARNED, ONLINE_N))


def test_sparse_detections_and_a_rough_start_leave_the_order_alone(paper):
    for case in (SPARSE, ROUGH):
        assert gwd2(paper, case, MAP) < 0.5 * gwd2(paper, case, RM)


def outcome(report, beginning):
    (found,) = (v.outcome for v in report.answers if v.claim.text.startswith(beginning))
    return found


def test_the_verdicts_on_the_slides(slides):
    assert outcome(slides, "The method with online bounds is more accurate than the random matrix with") == CONFIRMED
    assert outcome(slides, "Statistics of edge detections are biased").count(RM) == 3
    assert RM_MATCHED not in outcome(slides, "Statistics of edge detections are biased")
    assert outcome(slides, "Bounds at infinity") == "confirmed under n-count"


def test_the_verdicts_on_the_paper(paper):
    large = outcome(paper, "Learned HTG-RM outperforms")
    assert "HTG-MAP" in large
    assert "literal" not in large
    assert outcome(paper, "The update is sensitive") != REFUTED


def test_tables_files_and_figures_are_written(paper, slides, out):
    for report, figures in ((paper, 9), (slides, 6)):
        assert len(report.tables()) == len(report.cases) + 1
        written = json.loads((out / report.file).read_text())
        assert len(written["rows"]) == len(report.rows)
        assert len(report.figures) == figures
        assert all(figure.stat().st_size > 20000 for figure in report.figures)

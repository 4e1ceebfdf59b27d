"""One comparison of made runs for all tests of reports, and intervals from fewer draws: pages are not about them."""

import json
from pathlib import Path

import matplotlib
import pytest

from testbed.evaluation import intervals
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.report.comparison import links_of, page_of
from testbed.experiments.report.page import write_page
from testbed.experiments.store import ABOUT
from testbed.experiments.study import Tally
from testbed.frame import TRUTH
from tests.testbed.experiments.made_results import make

DRAWS = 100
TRACKERS = ("good", "fair", "bad")


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    monkeypatch.setattr(intervals, "RESAMPLES", DRAWS)


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """Two scenarios, three trackers, three seeds."""
    out = tmp_path_factory.mktemp("report")
    comparison = Comparison(("cut-in", "merge"), TRACKERS, (0, 1, 2), Settings(duration=8.0), "fair", out=str(out))
    (Path(comparison.out) / ABOUT).write_text(json.dumps(Comparison((TRUTH,), (TRUTH,), (0,)).identity()))
    return make(comparison)


@pytest.fixture(scope="session")
def report(results):
    """Path of its page, with figures and without logs."""
    before = dict(matplotlib.rcParams)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intervals, "RESAMPLES", DRAWS)
        page, folder = page_of(results, Tally(done=18, wall=12.5)), Path(results.study.out)
        path = write_page(page._replace(links=lambda step: links_of(results, folder)), folder)
    assert dict(matplotlib.rcParams) == before, "the settings of matplotlib are those of the caller"
    return path

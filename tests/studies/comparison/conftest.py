"""A small comparison of real runs, as `testbed compare` leaves it, and where the documentation lies."""

from pathlib import Path

import pytest

from testbed.experiments.command import execute
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.engine import Engine

DOCS = Path(__file__).parents[3] / "docs"
TRACKERS = ("rm-feldmann", "htg-mm")


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "runs"
    execute(Comparison(("xia2020-lane",), TRACKERS, (0, 1, 2), Settings(duration=1.0), out=str(out)), Engine())
    return out

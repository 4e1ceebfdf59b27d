"""A small comparison of real runs, as `testbed compare` leaves it and as it is committed."""

import shutil
from pathlib import Path

import pytest

from studies.comparison.publish import publish
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


@pytest.fixture(scope="session")
def published(folder):
    results = folder.parent / "results"
    publish(folder, results, folder.parent / "pictures", "htg-mm")
    shutil.copy(DOCS / "results" / "calibration.json", results)
    shutil.copytree(DOCS / "results" / "reproduce", results / "reproduce")
    return results

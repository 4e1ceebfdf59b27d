"""The folder with the files that the project makes, once for all fuzz tests."""

import pytest

from tests.fuzz.made import make


@pytest.fixture(scope="session")
def template(tmp_path_factory):
    """A folder that calls are made in, in a copy for each."""
    return make(tmp_path_factory.mktemp("made") / "template")

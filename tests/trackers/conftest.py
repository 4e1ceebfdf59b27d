import pytest

from tests.trackers.rear_sides import RADAR
from trackers import MultiObjectTracker, RandomMatrix


@pytest.fixture
def tracker():
    return MultiObjectTracker(RandomMatrix(), (RADAR,))

"""Motion modes in the multi-object tracker, with a size posterior and alone."""

import numpy as np
import pytest

from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import MultiObjectTracker, find
from trackers.composed import composed
from trackers.motion.modes import FIVE

CARS = [(30, 0, 0, 25.0), (50, 4, 0, 28.0), (60, -4, 0, 22.0)]


@pytest.mark.parametrize("base", ["htg-map", "pmht-spline"])
@pytest.mark.parametrize("size", ["ends", "off"])
def test_the_tracker_reports_the_modes_of_every_track(base, size):
    tracker = MultiObjectTracker(composed(find(base), size, motion=True), (RADAR,))
    tracks, infos = drive(tracker, Road(CARS), 2.0)
    e = tracks.reported.estimate
    assert len(e.velocity) == 3
    np.testing.assert_allclose(np.sort(e.velocity[:, 0]), [22.0, 25.0, 28.0], atol=0.5)
    mode = infos[-1].mode
    assert mode.shape == (len(infos[-1].track), len(FIVE))
    assert (mode.argmax(-1) == 0).all()  # all of them drive straight on


def test_a_filter_whose_motion_cannot_be_taken_over_is_refused():
    with pytest.raises(ValueError, match="motion needs a filter"):
        composed(find("edra-imm"), motion=True)

"""One scan from the environment to the filter: through which functions it goes."""

import traceback
from dataclasses import dataclass, fields

from testbed.environment.registration import make
from trackers import find
from trackers.composed import composed, place_of
from trackers.pmht import SplinePmht

CALLS = (
    "step",
    "step",
    "_simulate",
    "tapped",
    "step",
    "step",
    "_update",
    "guarded",
    "update",
    "update",
)  # from TrackedEnv on


STACKS: list[list[str]] = []


@dataclass(frozen=True)
class Watched(SplinePmht):
    """A filter of the place that remembers through which functions its update was called."""

    def update(self, state, scan):
        STACKS.append([frame.name for frame in traceback.extract_stack()])
        return super().update(state, scan)


def test_from_the_step_of_the_environment_to_the_update_of_the_filter_are_nine_calls():
    place = place_of(find("imm-spline"))
    parameters = {field.name: getattr(place, field.name) for field in fields(place)}
    filter = composed(Watched(**parameters), size="ends", motion=True)
    env = make("cut-in", tracker=filter, warm_up=1.0)
    env.reset(seed=0)
    STACKS.clear()
    env.step(None)
    assert STACKS
    for names in STACKS:
        if "_create_tracks" not in names:
            assert tuple(names[-len(CALLS) :]) == CALLS
    env.close()

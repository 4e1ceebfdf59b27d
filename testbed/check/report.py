"""The laws one after the other, each with its result in words."""

import traceback
from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from testbed.check import entry_laws, laws, tracker_laws
from testbed.check.draws import Broken
from testbed.environment.validation import WrongTracks
from trackers.filter import Abilities
from trackers.multi.tracker import MultiObjectTracker

Law = Callable[..., Any]
Cases = Sequence[Mapping[str, Any]]

ONCE: Cases = ({},)
SEEDS: Cases = tuple({"seed": seed} for seed in range(5))
MISSING: Cases = tuple({**case, "missing": missing} for case in SEEDS for missing in (False, True))
LEADS: Cases = tuple({"lead": lead} for lead in ((), (1,), (3, 2)))
ANGLES: Cases = tuple({"seed": seed, "turn": turn} for seed, turn in enumerate((-2.5, -0.7, 0.3, 1.6, 3.0)))
TINY: Cases = tuple({"seed": seed, "tiny": tiny} for seed in range(3) for tiny in (1e-6, 1e-3, 1.0))

FILTER_LAWS: tuple[tuple[Law, Cases], ...] = (
    (laws.states_have_leading_axes, LEADS),
    (laws.there_may_be_no_object, ONCE),
    (laws.init_then_estimate_returns_the_prior, ONCE),
    (laws.a_zero_time_step_changes_nothing, ONCE),
    (laws.a_prediction_moves_by_the_velocity, ONCE),
    (laws.without_a_detection_the_prediction_stands, SEEDS),
    (laws.detections_draw_the_estimate, ONCE),
    (laws.a_batch_equals_the_loop, LEADS),
    (laws.order_and_padding_do_not_matter, MISSING),
    (laws.turning_the_world_turns_the_answer, ANGLES),
    (laws.covariances_stay_symmetric_and_positive, TINY),
    (laws.all_detections_at_one_point_leave_a_finite_state, ONCE),
    (laws.missing_range_rates_do_no_harm, SEEDS),
    (laws.arguments_are_left_as_they_were, ONCE),
    (laws.a_filter_remembers_nothing, ONCE),
    (laws.states_can_be_chosen_and_stacked, ONCE),
)
OPTIONAL: tuple[tuple[str, Law], ...] = (
    ("shift", laws.a_shift_moves_the_estimate_and_nothing_else),
    ("resize", laws.a_resize_changes_the_size_and_nothing_else),
)
TRACKER_LAWS: tuple[Law, ...] = (
    tracker_laws.every_step_returns_what_can_be_tracks,
    tracker_laws.nothing_seen_is_nothing_tracked,
    tracker_laws.a_car_in_plain_view_becomes_one_track,
    tracker_laws.a_car_that_is_gone_loses_its_track,
    tracker_laws.a_car_keeps_its_id,
    tracker_laws.padding_does_not_matter,
    tracker_laws.a_start_begins_anew,
)


RADAR_LAWS: tuple[tuple[Law, Cases], ...] = (
    (entry_laws.mounts_lie_on_a_vehicle, ONCE),
    (entry_laws.a_scan_fits_the_data_sheets, ONCE),
    (entry_laws.the_same_generator_gives_the_same_scan, ONCE),
    (entry_laws.a_car_in_view_is_detected_and_an_empty_road_has_none, ONCE),
)
PLANNER_LAWS: tuple[tuple[Law, Cases], ...] = (
    (entry_laws.every_action_is_in_the_action_space, ONCE),
    (entry_laws.the_same_drive_has_the_same_actions, ONCE),
)
SCENARIO_LAWS: tuple[tuple[Law, Cases], ...] = (
    (entry_laws.a_world_repeats_under_its_seed, ONCE),
    (entry_laws.it_has_the_vehicles_that_it_promises, ONCE),
    (entry_laws.nobody_starts_in_a_collision, SEEDS),
    (entry_laws.phases_follow_each_other_from_the_start, ONCE),
)


class LawResult(NamedTuple):
    """One law, and how it is broken."""

    law: str  # in words
    fault: str = ""  # one sentence; empty where the law holds

    @property
    def holds(self) -> bool:
        """Whether the law holds."""
        return not self.fault


def examine_filter(filter: Any) -> list[LawResult]:
    """Verdicts on a filter, an object with init, predict, update and estimate: alone, then in the tracker."""
    found = examine(FILTER_LAWS, filter)
    found += [law_result(law, filter) for ability, law in OPTIONAL if Abilities.of(filter).has(ability)]
    return found + examine_tracker(MultiObjectTracker(filter, (tracker_laws.RADAR,)))


def examine_tracker(tracker: Any) -> list[LawResult]:
    """Verdicts on a multi-object tracker for the sensors `(tracker_laws.RADAR,)`, an object with start and step."""
    return [law_result(law, tracker) for law in TRACKER_LAWS]


def examine(laws: Sequence[tuple[Law, Cases]], subject: Any) -> list[LawResult]:
    """Verdicts of some laws on whatever they are about."""
    return [law_result(law, subject, cases) for law, cases in laws]


def law_result(law: Law, subject: Any, cases: Cases = ONCE) -> LawResult:
    """Whether a law holds in all cases; the first fault is reported.

    Code of a user may raise anything: any error is a fault, reported with its place, and the other laws go on.
    """
    name = law.__name__.replace("_", " ")
    for case in cases:
        try:
            with np.errstate(all="ignore"):  # what comes of it is looked at instead
                law(subject, **case)
        except (Broken, WrongTracks) as broken:
            return LawResult(name, f"{broken}{_told(law, case)}")
        except Exception as error:
            return LawResult(name, f"{type(error).__name__}: {error} ({_place(error)}){_told(law, case)}")
    return LawResult(name)


def _told(law: Law, case: Mapping[str, Any]) -> str:
    """How to repeat a case in Python."""
    words = "".join(f", {key}={value!r}" for key, value in case.items())
    return f" [{law.__module__}.{law.__name__}(f{words})]" if signature(law).parameters.keys() & case.keys() else ""


def _place(error: Exception) -> str:
    """Where an error was raised; inside a library, the line that called it."""
    frames = traceback.extract_tb(error.__traceback__)
    frame = next(f for f in reversed(frames) if not {"site-packages", "dist-packages"} & {*Path(f.filename).parts})
    return f"{Path(frame.filename).name}:{frame.lineno}, in {frame.name}"

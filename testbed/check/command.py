"""What `testbed check` does: find the entry as every command does, try it, and say law by law what holds."""

from collections.abc import Callable, Mapping

from rich.console import Console
from rich.markup import escape

from scenarios import find as find_scenario
from sensors import find as find_radar
from testbed.check.report import (
    PLANNER_LAWS,
    RADAR_LAWS,
    SCENARIO_LAWS,
    LawResult,
    examine,
    examine_filter,
    examine_tracker,
)
from testbed.check.tracker_laws import RADAR
from testbed.planners import find as find_planner
from trackers import build
from trackers.composed import place_of
from trackers.lookup import look_up
from trackers.multi.tracker import MultiObjectTracker


def check_tracker(name: str) -> list[LawResult]:
    """Verdicts on a tracker by its name: on its filter, then on the whole.

    Raises:
        LookupError: there is none of that name.
        ValueError: a parameter that it cannot have, or an object that is no tracker.
    """
    tracker = build(name, (RADAR,))
    if not isinstance(tracker, MultiObjectTracker):
        return examine_tracker(tracker)
    place = place_of(tracker.filter)
    alone = examine_filter(place)
    return alone if place is tracker.filter else [*alone, *examine_tracker(tracker)]


KINDS: Mapping[str, Callable[[str], list[LawResult]]] = {
    "tracker": check_tracker,
    "planner": lambda name: examine(PLANNER_LAWS, find_planner(name)),
    "radar": lambda name: examine(RADAR_LAWS, find_radar(name)),
    "scenario": lambda name: examine(SCENARIO_LAWS, find_scenario(name)),
}


def results(what: str, name: str) -> list[LawResult]:
    """Verdicts on an entry; LookupError for an unknown kind of entry, else as in `check_tracker`."""
    return look_up(what, KINDS, "kind of entry")(name)


def show(name: str, found: list[LawResult], console: Console) -> int:
    """Print a line a law; the exit status is 1 where one is broken."""
    for result in found:
        if result.holds:
            console.print(f"[green]holds[/green]   {escape(result.law)}")
        else:
            console.print(f"[red]broken[/red]  {escape(result.law)}\n        {escape(result.fault)}", highlight=False)
    broken = sum(not result.holds for result in found)
    console.print(f"{escape(name)} " + (f"breaks {broken} of {len(found)} laws" if broken else "keeps all laws"))
    return 1 if broken else 0

"""What the planner gets in a drive, as text and as a source of tracks.

    truth                everything
    in-view              the truth of what is, or was within two seconds, visible
    TRACKER              its tracks
    TRACKER:EG           truth in view with existence and geometry of the tracker, see `substitution`
    in-view+near_edge=1  with an injected error, see `injection`; also TRACKER+covariance=4
    TRACKER+drop:0.2     its tracks under a fault of the radar, see `sensors.fault_text`

TRACKER is a name of `trackers.TRACKERS`, or `NAME:key=value,key=value`.
"""

from typing import Any, NamedTuple

import trackers
from sensors import faults_of
from testbed.environment.perception import radar_of
from testbed.environment.sources.in_view import InView
from testbed.environment.sources.injection import NONE, Errors, Injected, parse_errors
from testbed.environment.sources.substitution import GROUPS, Substituted
from testbed.frame import TRUTH

IN_VIEW = "in-view"


class Condition(NamedTuple):
    """A condition, taken apart."""

    base: str  # truth, in-view, or a tracker
    groups: str | None = None  # of errors that are taken from the tracker; None: its tracks as they are
    errors: Errors = NONE
    faults: tuple[str, ...] = ()  # of the radar

    @property
    def tracker(self) -> str | None:
        """The tracker that runs, None in the conditions without one."""
        return None if self.base in (TRUTH, IN_VIEW) else self.base

    def __str__(self) -> str:
        groups = "" if self.groups is None else f":{self.groups}"
        errors = "" if self.errors == NONE else f"+{self.errors}"
        return "+".join([f"{self.base}{groups}{errors}", *self.faults])


def parse(text: str) -> Condition:
    """The condition of a text.

    >>> parse("rm-koch:sigma=0.3:EG").groups, str(parse("in-view+near_edge=1.0"))
    ('EG', 'in-view+near_edge=1')

    Raises ValueError for errors that are put into the truth, or that cannot be, and for faults without a tracker.
    """
    base, plus, rest = text.partition("+")
    base, groups = _groups(base)
    parts = rest.split("+") if plus else []
    faults = tuple(map(str, faults_of([part for part in parts if _is_fault(part)])))
    errors = "+".join(part for part in parts if not _is_fault(part))
    found = Condition(base, groups, parse_errors(errors) if errors or len(parts) > len(faults) else NONE, faults)
    if found.tracker is None and faults:
        raise ValueError(f"faults of the radar change nothing without a tracker, got {text!r}; write TRACKER+{rest}")
    if found.tracker is None and groups is not None:
        raise ValueError(f"the condition {text!r} has no tracker to take {groups} from; write TRACKER:{groups}")
    if base == TRUTH and errors:
        raise ValueError(f"errors are put into what is in view, or into tracks, got {text!r}; write in-view+{errors}")
    return found


def _is_fault(part: str) -> bool:
    return ":" in part and "=" not in part


def _groups(text: str) -> tuple[str, str | None]:
    base, colon, last = text.rpartition(":")
    if colon and last and set(last) <= set(GROUPS):
        return base, "".join(g for g in GROUPS if g in last)
    return text, None


def source(condition: Condition, radar: Any, seed: int) -> Any:
    """What stands for the tracker in a `TrackedEnv`.

    Args:
        condition: names as in the catalogues.
        radar: name of the radar, or the radar itself, for the trackers.
        seed: of the run, for the injected errors.

    Raises:
        LookupError, ValueError: an unknown tracker or parameter.
    """
    if condition.base == TRUTH:
        return TRUTH
    if condition.tracker is None:
        found: Any = InView()
    elif condition.groups is None and condition.errors == NONE:
        return condition.tracker
    else:
        found = trackers.build(condition.tracker, radar_of(radar).models)
        if condition.groups is not None:
            found = Substituted(found, condition.groups)
    return found if condition.errors == NONE else Injected(found, condition.errors, seed)

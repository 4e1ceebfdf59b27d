"""How the making of a run ended."""

import traceback
from collections.abc import Callable
from typing import NamedTuple

DONE, FOUND, FAILED = "done", "found", "failed"


class Outcome(NamedTuple):
    """How one task ended."""

    name: str
    status: str  # done, found (it has a valid file already), failed
    note: str = ""  # sentence or traceback of a failure; which damaged file was replaced and why


def outcome_of(name: str, work: Callable[[], str]) -> Outcome:
    """A run that fails must not stop the others: any error is caught here, and reported with its traceback.

    Of a file that cannot be written or read the sentence is enough.
    """
    try:
        note = work()
    except OSError as error:
        return Outcome(name, FAILED, str(error))
    except Exception:
        return Outcome(name, FAILED, traceback.format_exc())
    return Outcome(name, FOUND) if note == FOUND else Outcome(name, DONE, note)

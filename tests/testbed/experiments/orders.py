"""Small tasks for tests of where tasks are done: fine ones, failing ones, and ones that kill their process."""

import os
import signal
from pathlib import Path
from typing import NamedTuple

from testbed.experiments.run import DONE, FAILED, Outcome

FINE, FAILS, DIES_ONCE, DIES = "fine", "fails", "dies once", "dies"


class Order(NamedTuple):
    """A task; an empty file in `markers` remembers that its process was killed."""

    name: str
    fate: str
    markers: str


def work(order, folder):
    """Do what an order asks for; the note names a file of the folder."""
    marker = Path(order.markers) / order.name
    if order.fate == DIES or (order.fate == DIES_ONCE and not marker.exists()):
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if order.fate == FAILS:
        return Outcome(order.name, FAILED, f"ZeroDivisionError of {order.name}")
    return Outcome(order.name, DONE, f"{folder}/{order.name}")


def orders(folder, **fates):
    """Eight tasks, of which some have a fate."""
    names = [f"t{k}" for k in range(8)]
    return [(Order(name, fates.get(name, FINE), str(folder)), folder) for name in names]


def status(outcomes):
    """Status by name; every name occurs once."""
    found = [outcome.name for outcome in outcomes]
    assert len(set(found)) == len(found)
    return {outcome.name: outcome.status for outcome in outcomes}

"""Contracts over a whole registry: one entry of each kind in `make test`, all of them in `make test-all`."""

from collections.abc import Hashable, Iterable
from typing import Any

import pytest

KINDS = ("cut-in", "articulated-turn", "roundabout", "oncoming", "six-radar-highway")  # a scenario of each kind of road
PROBE = "probe-brake"


def rest_slow(every: Iterable[Hashable], *quick: Hashable) -> list[Any]:
    """Every entry as a parameter; all but the quick ones are marked slow."""
    every = list(every)
    assert set(quick) <= set(every), f"no {set(quick) - set(every)} in the registry"
    return [entry if entry in quick else pytest.param(entry, marks=pytest.mark.slow) for entry in every]

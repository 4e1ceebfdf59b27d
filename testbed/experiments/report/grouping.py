"""What is the same of many runs, said once with a count."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from testbed.experiments.run import Outcome
from testbed.experiments.statistics import PHASES
from testbed.experiments.store import Results


class Failure(NamedTuple):
    """All runs that failed for one reason."""

    reason: str  # the last line of what was reported
    outcomes: list[Outcome]


class Reach(NamedTuple):
    """How many finished runs have scans in a phase of the maneuver."""

    phase: str
    reached: int
    runs: int

    @property
    def text(self) -> str:
        """The count in words."""
        return f"{self.phase}: {self.reached} of {self.runs} runs"


def failures(outcomes: Iterable[Outcome]) -> list[Failure]:
    """Failed runs by reason, the most frequent first."""
    found: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        found.setdefault(_last_line(outcome.note), []).append(outcome)
    groups = [Failure(reason, group) for reason, group in found.items()]
    return sorted(groups, key=lambda g: -len(g.outcomes))


def _last_line(text: str) -> str:
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "no reason was given")


def reach(results: Results) -> list[Reach]:
    """The four phases in their order; a run that has no scan in a phase does not reach it."""
    spans, runs = results.spans, len(results.runs)
    if not runs:
        return []
    scanned = spans[spans["gospa"].notna()] if "gospa" in spans else spans
    return [Reach(phase, int((scanned["phase"] == phase).sum()), runs) for phase in PHASES]


def listed(names: Sequence[str], most: int = 4) -> str:
    """Names as a sentence has them; of many, the first ones and how many more.

    >>> listed(["a", "b", "c"]), listed(list("abcdef"))
    ('a, b and c', 'a, b, c and 3 more')
    """
    if len(names) > most:
        return f"{', '.join(names[: most - 1])} and {len(names) - most + 1} more"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))

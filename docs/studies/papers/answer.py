"""Claims of the papers and our answers to them.

A condition under which a claim was tried holds, fails, or is not decided: a 95 % interval holds the bar.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

CONFIRMED, REFUTED, OPEN = "confirmed", "not confirmed", "not decided"


@dataclass(frozen=True)
class Claim:
    """A sentence of a paper that an experiment can decide."""

    text: str
    source: str  # where the paper says it


@dataclass(frozen=True)
class Answer:
    """Our answer to a claim."""

    claim: Claim
    outcome: str  # "confirmed", "not confirmed", "not decided", or under which conditions it is what
    numbers: str  # what was measured, with units

    @property
    def holds(self) -> bool:
        """Whether the claim holds or is open under at least one condition."""
        return self.outcome != REFUTED


def judge(claim: Claim, cases: Mapping[str, bool | None], numbers: str) -> Answer:
    """Answer from the conditions that were tried: whether each holds, None where that is not decided.

    >>> judge(Claim("better", "IV"), {"noise-free": True, "sigma 0.5 m": False}, "").outcome
    'confirmed under noise-free'
    >>> judge(Claim("better", "IV"), {"near": True, "far": None}, "").outcome
    'confirmed under near; not decided under far'
    """
    if not cases:
        raise ValueError(f"cases is empty; the claim {claim.text!r} needs at least one condition that was tried")
    held = [name for name, holds in cases.items() if holds]
    unclear = [name for name, holds in cases.items() if holds is None]
    if len(held) == len(cases):
        return Answer(claim, CONFIRMED, numbers)
    if len(unclear) == len(cases):
        return Answer(claim, OPEN, numbers)
    parts = [f"confirmed under {'; '.join(held)}"] if held else []
    parts += [f"{OPEN} under {'; '.join(unclear)}"] if unclear else []
    return Answer(claim, "; ".join(parts) or REFUTED, numbers)


def every(values: Iterable[bool | None]) -> bool | None:
    """Whether all hold: false if one fails, None if one of the others is not decided."""
    found = list(values)
    return False if False in found else None if None in found else True

"""Answers from the conditions that were tried."""

import pytest

from studies.papers.answer import CONFIRMED, OPEN, REFUTED, Claim, every, judge

CLAIM = Claim("better", "IV")


@pytest.mark.parametrize(
    ("cases", "outcome", "holds"),
    [
        ({"a": True, "b": True}, CONFIRMED, True),
        ({"a": True, "b": False}, "confirmed under a", True),
        ({"a": False, "b": False}, REFUTED, False),
        ({"a": None, "b": None}, OPEN, True),
        ({"a": None, "b": False}, "not decided under a", True),
        ({"a": True, "b": None, "c": False}, "confirmed under a; not decided under b", True),
    ],
)
def test_a_verdict_names_the_conditions_that_hold_and_those_that_are_not_decided(cases, outcome, holds):
    answer = judge(CLAIM, cases, "1 < 2")
    assert (answer.outcome, answer.holds) == (outcome, holds)


def test_a_claim_without_conditions_is_refused():
    with pytest.raises(ValueError, match="'better' needs at least one condition"):
        judge(CLAIM, {}, "")


@pytest.mark.parametrize(("rest", "found"), [([True], True), ([None], None), ([None, False], False)])
def test_one_failure_decides_and_one_doubt_leaves_open(rest, found):
    assert every([True, *rest]) is found

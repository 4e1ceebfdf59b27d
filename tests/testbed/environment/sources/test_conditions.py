"""Names of conditions."""

import pytest

from testbed.environment.sources import conditions
from testbed.environment.sources.in_view import InView
from testbed.environment.sources.injection import Errors, Injected
from testbed.environment.sources.substitution import Substituted


@pytest.mark.parametrize(
    "text",
    ["truth", "in-view", "rm-koch", "rm-koch:sigma=0.3", "rm-koch:EG", "rm-koch:sigma=0.3:V", "in-view+heading=0.1"],
)
def test_a_condition_reads_back_as_it_was_written(text):
    assert str(conditions.parse(text)) == text


def test_a_condition_is_taken_apart():
    found = conditions.parse("rm-koch:VE+covariance=4")
    assert (found.base, found.groups, found.errors) == ("rm-koch", "EV", Errors(covariance=4.0))
    assert found.tracker == "rm-koch"
    assert conditions.parse("in-view+heading=0.1").tracker is None


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("in-view", InView),
        ("rm-koch:E", Substituted),
        ("rm-koch+covariance=2", Injected),
        ("in-view+length=1", Injected),
    ],
)
def test_the_source_of_a_condition(text, kind):
    assert isinstance(conditions.source(conditions.parse(text), "surround", 0), kind)


def test_a_tracker_and_the_truth_are_mounted_by_name():
    for text in ("truth", "rm-koch:sigma=0.3"):
        assert conditions.source(conditions.parse(text), "surround", 0) == text


def test_conditions_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="put into what is in view"):
        conditions.parse("truth+heading=0.1")
    with pytest.raises(ValueError, match="has no tracker to take E from"):
        conditions.parse("in-view:E")
    with pytest.raises(LookupError, match="did you mean 'rm-koch'"):
        conditions.source(conditions.parse("rm-kochh:E"), "surround", 0)


def test_a_fault_of_the_radar_belongs_to_a_tracker():
    found = conditions.parse("rm-koch:sigma=0.3+drop:.2+covariance=4+front:outage:3:5")
    assert (found.base, found.errors) == ("rm-koch:sigma=0.3", Errors(covariance=4.0))
    assert found.faults == ("drop:0.2", "front:outage:3:5")
    assert str(found) == "rm-koch:sigma=0.3+covariance=4+drop:0.2+front:outage:3:5"
    assert conditions.source(conditions.parse("rm-koch+drop:0.2"), "surround", 0) == "rm-koch"
    for text in ("truth+drop:0.2", "in-view+drop:0.2"):
        with pytest.raises(ValueError, match=r"without a tracker, .* write TRACKER\+drop:0.2"):
            conditions.parse(text)

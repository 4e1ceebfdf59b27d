"""What a regression run runs."""

import pytest

from sensors import find
from sensors.fault_text import KINDS, faults_of
from testbed.compare.runs.config import check_case
from testbed.regress.baselines import NONE
from testbed.regress.findings import orphans
from testbed.regress.suite import CASES, FAULTS, Suite


def test_the_fault_matrix_has_every_kind_and_can_be_run():
    assert {str(fault).split(":")[k] for text in FAULTS for fault in faults_of(text) for k in (0, 1)} >= set(KINDS)
    for case in CASES:
        check_case(case, find(Suite().settings.radar).models)
    assert Suite().complete
    assert not Suite.of(["cut-in"], None, "out").complete


def test_baselines_of_faults_that_are_no_longer_in_the_matrix_are_gone():
    values = {("rm-koch", f"cut-in+{fault}"): {} for fault in (FAULTS[0], "drop:0.9")}
    assert orphans(NONE._replace(values=values), Suite()) == [("rm-koch", "cut-in+drop:0.9")]


def test_a_fault_is_held_beside_the_scenario_without_it():
    assert Suite.of(["cut-in"], None, "out", ["drop:.2"]).scenarios == ("cut-in", "cut-in+drop:0.2")
    assert set(Suite.of(["cut-in"], None, "out", FAULTS).scenarios) == {"cut-in", *CASES[-len(FAULTS) :]}
    with pytest.raises(ValueError, match="must read"):
        Suite.of(["cut-in"], None, "out", ["front:outtage:1:2"])

import re
from dataclasses import replace

import pytest

from testbed.compare import identity
from trackers import TRACKERS, find


def test_every_tracker_has_a_digest_of_its_own():
    digests = {name: identity.tracker_digest(name) for name in TRACKERS}
    assert len(set(digests.values())) == len(TRACKERS)
    assert all(len(digest) == 12 for digest in digests.values())


def test_a_digest_stays():
    assert identity.shared_digest() == identity.shared_digest()
    assert identity.tracker_digest("htg-map") == identity.tracker_digest("htg-map")


def test_the_modules_of_a_filter_are_those_that_it_imports():
    found = identity.closure(["trackers.random_matrix"])
    assert "trackers.linalg" in found
    assert "trackers.motion" in found
    assert not any(name.startswith(("trackers.htg", "trackers.multi")) for name in found)


def test_the_catalogue_itself_counts_for_nobody():
    everything = identity.closure([*identity.ROOTS, *(type(entry.filter).__module__ for entry in TRACKERS.values())])
    assert "trackers.registry" not in everything


def test_filters_inside_of_filters_count():
    modules = {type(part).__module__ for part in identity._parts(find("rm-vmm"))}
    assert {"trackers.virtual_measurements", "trackers.koch", "trackers.adaptation"} <= modules


def test_parameters_count():
    filter = find("rm-feldmann")
    assert repr(replace(filter, sigma=0.3)) != repr(filter)  # the text that goes into the digest


@pytest.mark.parametrize("name", TRACKERS)
def test_no_place_on_this_machine_is_part_of_a_digest(name):
    assert not re.search(r"[/\\]", repr(find(name)))


def test_learned_models_of_contours_count():
    assert set(identity.TABLES) & set(identity.closure(["trackers.pmht.filter"])) == {"trackers.pmht.model"}
    assert set(identity.TABLES) & set(identity.closure(["trackers.htg.map"])) == {"trackers.htg.bins"}

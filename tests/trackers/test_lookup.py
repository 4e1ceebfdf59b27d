"""Look-up in a catalogue."""

import pytest

from trackers.lookup import look_up

PAGES = {"cut-in": 1, "cut-out": 2, "merge": 3}


def test_a_known_name_gives_its_entry():
    assert look_up("merge", PAGES, "scenario") == 3


def test_a_misspelt_name_is_told_the_nearest_and_a_strange_one_all():
    with pytest.raises(LookupError, match=r"^no scenario 'cut-ut'; did you mean 'cut-out'\?$") as caught:
        look_up("cut-ut", PAGES, "scenario")
    assert caught.value.__suppress_context__  # the KeyError says nothing more
    with pytest.raises(LookupError, match=r"^no radar 'xyz'; known: cut-in, cut-out, merge$"):
        look_up("xyz", PAGES, "radar")

"""Commands of a checkout find its studies, and say so elsewhere."""

import pytest

from testbed.command_line.checkout import study


def test_a_study_of_the_checkout_is_found_by_its_name():
    assert "yao2021" in study("papers.catalogue", "testbed reproduce").PAPERS


def test_without_a_checkout_the_command_says_what_it_needs(tmp_path):
    with pytest.raises(LookupError, match=r"^`testbed reproduce` is a command of a checkout, and .*; clone the reposi"):
        study("papers.catalogue", "testbed reproduce", tmp_path / "docs" / "studies")

"""Look-up in a catalogue."""

from dataclasses import replace

import pytest

from trackers import SensorModel, build
from trackers.lookup import look_up, parse

PAGES = {"cut-in": 1, "cut-out": 2, "merge": 3}


def test_a_known_name_gives_its_entry():
    assert look_up("merge", PAGES, "scenario") == 3


def test_a_misspelt_name_is_told_the_nearest_and_a_strange_one_all():
    with pytest.raises(LookupError, match=r"^no scenario 'cut-ut'; did you mean 'cut-out'\?$") as caught:
        look_up("cut-ut", PAGES, "scenario")
    assert caught.value.__suppress_context__  # the KeyError says nothing more
    with pytest.raises(LookupError, match=r"^no radar 'xyz'; known: cut-in, cut-out, merge$"):
        look_up("xyz", PAGES, "radar")


def test_parameters_of_an_entry_are_literals_switches_or_text():
    text = "htg-map: shape_std = 3e-2, size=off,model=cars,road=none,motion=on,classes=7"
    assert parse(text) == (
        "htg-map",
        {"shape_std": 0.03, "size": False, "model": "cars", "road": None, "motion": True, "classes": 7},
    )
    assert parse("htg-map") == ("htg-map", {})


@pytest.mark.parametrize("text", ["a:", "a:-b", "a:=1", "a:b=", "a:b=1,", "a:b=1,b=2", "a:b=1,,c=2"])
def test_a_parameter_without_a_value_is_refused_in_a_sentence(text):
    with pytest.raises(ValueError, match=r"^'a:.*(write NAME:key=value,key=value|give it once)$"):
        parse(text)


def test_layers_are_switched_off_by_name():
    whole = build("imm-spline", (SensorModel(),)).filter
    alone = build("imm-spline:size=off,motion=off", (SensorModel(),))
    assert whole.size
    assert whole.motion
    assert alone.filter == whole.place
    assert build("imm-spline:size=off", (SensorModel(),)).filter == replace(whole, size=None)
    assert build("imm-spline:motion=off", (SensorModel(),)).filter == replace(whole, motion=None)
    assert build("imm-spline:iterations=5", (SensorModel(),)).filter.place == replace(whole.place, iterations=5)
    assert alone.ground is None
    assert not build("imm-spline:ground=off", (SensorModel(),)).ground

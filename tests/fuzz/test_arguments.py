"""Whatever the configurations of the Python interface are made of: valid, or an error of one sentence that names it."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from testbed.experiments import compare as comparing
from testbed.experiments import single as running
from testbed.experiments.command import check
from testbed.experiments.engine import Engine
from testbed.learn.models import SplineConfig, TableConfig

OBJECTS = (
    None, True, 0, -1, 1.5, 1e308, float("nan"), float("inf"), 10**30, "", "x", "a\0b", "\ud800", "a" * 5000, b"x", [],
    (), {}, [None], (None,), ("x", "x"), ([],), object(), len, np.array(1.0), np.zeros(3), Path("nowhere"), np.int64(3),
)  # fmt: skip
GIVEN = {
    running.RunConfig: {"scenario": "cut-in"},
    comparing.Settings: {},
    comparing.Comparison: {"scenarios": ("cut-in",), "trackers": ("rm-koch",), "seeds": (0,)},
    TableConfig: {"data": "sampler:front"},
    SplineConfig: {"data": "sampler:front"},
}
CHECKS = {running.RunConfig: running.check, comparing.Comparison: lambda comparison: check(comparison, Engine())}
LATER = {"radar", "planner"}  # of `Settings`: names, which `check` of a comparison looks up


@pytest.mark.parametrize("made", GIVEN)
def test_a_configuration_is_valid_or_refused_in_a_sentence(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for field in fields(made):
        if field.type is bool or (made is comparing.Settings and field.name in LATER):
            continue
        refused = 0
        for value in OBJECTS:
            if field.name == "out" and isinstance(value, str | Path):
                continue  # a folder may have any name
            if sentence := refusal(made, **{field.name: value}):
                refused += 1
                assert field.name.rstrip("s") in sentence, value
                assert "\n" not in sentence
        assert refused >= len(OBJECTS) / 2, field.name


def refusal(made, **changed):
    """What is said against a configuration; nothing where it is valid."""
    try:
        CHECKS.get(made, repr)(made(**{**GIVEN[made], **changed}))
    except (ValueError, LookupError) as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", ["radar", "planner"])
@pytest.mark.parametrize("value", OBJECTS, ids=lambda v: type(v).__name__)
def test_names_in_the_settings_of_a_comparison_are_looked_up(name, value, tmp_path):

    def checked():
        settings = comparing.Settings(**{name: value})
        comparing.Comparison(("cut-in",), ("rm-koch",), (0,), settings, out=str(tmp_path)).check()

    with pytest.raises((LookupError, ValueError), match=name):
        checked()

"""What a comparison takes, and with which sentence it refuses the rest."""

import json
import os
from dataclasses import replace

import pytest

from scenarios import SCENARIOS
from testbed.compare.runs.config import (
    SETTINGS,
    Comparison,
    Settings,
    Task,
    check,
    expand,
    identity,
    parse_seeds,
    read_settings,
    write_settings,
)
from trackers import TRACKERS

SHORT = Settings(radar="front", duration=1.0)


def comparison(out, **changes):
    return replace(Comparison(("cut-in",), ("rm-koch", "htg-map"), (0, 1), SHORT, out=str(out)), **changes)


@pytest.mark.parametrize(
    ("text", "seeds"), [("0:3", (0, 1, 2)), ("2:5", (2, 3, 4)), ("0,3,7", (0, 3, 7)), ("5", (5,)), (" 1, 2", (1, 2))]
)
def test_seeds_are_ranges_lists_or_one_number(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "0:2:4", "1;2", "0-3", ":", "1,", "0.5", "nan"])
def test_other_texts_are_refused_with_what_seeds_read_like(text):
    with pytest.raises(ValueError, match=f"seeds must read like 0:20, 0,3,7 or 5, got '{text}'"):
        parse_seeds(text)


@pytest.mark.parametrize("text", ["0:0", "5:2"])
def test_an_empty_range_is_refused(text):
    with pytest.raises(ValueError, match=f"seeds '{text}' are empty; the range 0:20"):
        parse_seeds(text)


def test_all_stands_for_the_whole_catalogue():
    assert expand(["all"], "scenarios") == tuple(SCENARIOS)
    assert expand(["all"], "trackers") == tuple(TRACKERS)
    assert expand(["merge", "cut-in"], "scenarios") == ("merge", "cut-in")


def test_tasks_are_the_product_and_those_on_one_recording_stand_together(tmp_path):
    wanted = comparison(tmp_path, scenarios=("cut-in", "merge"))
    assert len(set(wanted.tasks)) == len(wanted.tasks) == 8
    assert wanted.tasks[:3] == [
        Task("cut-in", "rm-koch", 0),
        Task("cut-in", "htg-map", 0),
        Task("cut-in", "rm-koch", 1),
    ]
    assert wanted.tasks[0].name == "cut-in_rm-koch_seed0"


def test_the_first_tracker_is_the_reference_unless_one_is_named(tmp_path):
    assert comparison(tmp_path).baseline == "rm-koch"
    assert comparison(tmp_path, reference="htg-map").baseline == "htg-map"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"seeds": ()}, "seeds must name at least one of them, got none"),
        ({"trackers": ()}, "trackers must name at least one"),
        ({"seeds": (1, 2, 1)}, "seeds must differ, got 1, 2, 1; drop the repetition"),
        ({"scenarios": ("merge", "merge")}, "scenarios must differ"),
        ({"seeds": (0, -1)}, "seeds must not be negative, got -1; take 0 or more"),
        ({"reference": "rm-vmm"}, "reference 'rm-vmm' is not compared; choose one of rm-koch, htg-map, or add it"),
    ],
)
def test_a_comparison_that_cannot_be_is_refused(tmp_path, changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        comparison(tmp_path, **changes)


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan"), float("inf")])
def test_a_duration_must_be_positive_and_finite(duration):
    with pytest.raises(ValueError, match=f"duration must be positive and finite, got {duration} s; leave it out"):
        Settings(duration=duration)


def test_a_loop_is_open_or_closed():
    with pytest.raises(ValueError, match="loop must be one of open, closed, got 'half'; choose one of them"):
        Settings(loop="half")


def test_how_long_runs_are_is_given_by_duration_and_maneuver():
    assert (Settings().config("cut-in"), Settings().length) == ({}, "the scenarios' own")
    assert (SHORT.config("cut-in"), SHORT.length) == ({"duration": 1.0}, "1 s")
    both = Settings(duration=60.0, after=3.0)
    assert both.config("cut-in") == {"duration": 60.0, "after": 3.0}
    assert both.config("highway-v0") == {"duration": 60.0}  # nobody knows when its maneuver ends
    assert both.length == "to 3 s after the maneuver, 60 s at most"


@pytest.mark.parametrize("settle", [-1, float("nan"), float("inf"), "2", True])
def test_the_time_to_settle_is_a_time(settle):
    with pytest.raises(ValueError, match="settle must be a number from 0 to 3600 s, got"):
        Settings(settle=settle)


def test_a_run_cannot_end_before_the_maneuver_does():
    with pytest.raises(ValueError, match="after must be positive and finite, got -1 s; leave it out for a run that"):
        Settings(after=-1)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"scenarios": ("cut-inn",)}, "no scenario 'cut-inn'; did you mean 'cut-in'?"),
        ({"trackers": ("htg-mapp",)}, "htg-mapp.*did you mean 'htg-map'"),
        ({"settings": Settings(radar="frnt")}, "frnt.*did you mean 'front'"),
        ({"settings": Settings(planner="imd")}, "imd.*did you mean 'idm'"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(tmp_path, changes, sentence):
    with pytest.raises(LookupError, match=sentence.replace("?", r"\?")):
        check(comparison(tmp_path, **changes))


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_directory_without_leave_to_write_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OSError, match=f"out: cannot write to {tmp_path}"):
        check(comparison(tmp_path))


@pytest.mark.parametrize("inside", [".", "deeper"])
def test_a_file_in_place_of_the_directory_is_refused(tmp_path, inside):
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"out: cannot write to .*; choose another directory"):
        check(comparison(tmp_path / "file" / inside))


def test_a_claimed_folder_takes_the_same_settings_whatever_is_compared(tmp_path):
    write_settings(comparison(tmp_path))
    check(comparison(tmp_path, scenarios=("merge",), trackers=("rm-vmm",), seeds=(7,)))
    settings, known = read_settings(tmp_path)
    assert settings == SHORT
    assert known == identity(SHORT, comparison(tmp_path).trackers)
    assert [p.name for p in tmp_path.iterdir()] == [SETTINGS]


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"radar": "surround"}, "radar 'front'"),
        ({"duration": None}, "duration 1.0"),
        ({"duration": 2.0}, "duration 1.0"),
        ({"loop": "closed"}, "loop 'open'"),
        ({"planner": "truth"}, "planner 'idm'"),
    ],
)
def test_other_settings_are_refused_with_the_field_that_differs(tmp_path, changes, field):
    write_settings(comparison(tmp_path))
    with pytest.raises(ValueError, match=f"holds runs with {field}, wanted is .*; choose another directory"):
        check(comparison(tmp_path, settings=replace(SHORT, **changes)))


@pytest.mark.parametrize("field", ["code", "version of numpy", "version of highway-env"])
def test_runs_of_other_code_or_versions_are_refused(tmp_path, field):
    write_settings(comparison(tmp_path))
    path = tmp_path / SETTINGS
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: "older"}))
    with pytest.raises(ValueError, match=f"holds runs with {field} 'older', wanted is"):
        check(comparison(tmp_path))


def test_a_folder_is_claimed_once(tmp_path):
    write_settings(comparison(tmp_path))
    before = (tmp_path / SETTINGS).read_bytes()
    write_settings(comparison(tmp_path, settings=Settings()))
    assert (tmp_path / SETTINGS).read_bytes() == before


@pytest.mark.parametrize("text", ["", "{", "[1]", "null"])
def test_damaged_settings_are_refused(tmp_path, text):
    (tmp_path / SETTINGS).write_text(text)
    for ask in (lambda: check(comparison(tmp_path)), lambda: read_settings(tmp_path)):
        with pytest.raises(ValueError, match=f"{SETTINGS} is damaged; delete the folder"):
            ask()


def test_a_folder_without_a_comparison_is_refused(tmp_path):
    with pytest.raises(ValueError, match="holds no comparison; make one with `testbed compare --out"):
        read_settings(tmp_path)


def test_a_new_tracker_may_join_a_folder(tmp_path):
    write_settings(comparison(tmp_path, trackers=("rm-feldmann",)))
    check(comparison(tmp_path, trackers=("rm-feldmann", "htg-mm")))
    write_settings(comparison(tmp_path, trackers=("htg-mm",)))
    _, known = read_settings(tmp_path)
    assert {"code of rm-feldmann", "code of htg-mm"} <= set(known)


def test_a_changed_tracker_is_refused_by_name(tmp_path):
    write_settings(comparison(tmp_path, trackers=("rm-feldmann", "htg-mm")))
    path = tmp_path / SETTINGS
    path.write_text(json.dumps(json.loads(path.read_text()) | {"code of htg-mm": "older"}))
    check(comparison(tmp_path, trackers=("rm-feldmann",)))
    with pytest.raises(ValueError, match="holds runs with code of htg-mm 'older', wanted is"):
        check(comparison(tmp_path, trackers=("rm-feldmann", "htg-mm")))

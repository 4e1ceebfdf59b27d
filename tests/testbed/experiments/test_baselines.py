"""The file of the baselines: read as it was written, replaced in part, refused where it is of no use."""

import json
from dataclasses import replace

import numpy as np
import pytest

from testbed.experiments.baselines import NONE, Update, load, merge, save
from testbed.experiments.regress import Regress, update_list
from testbed.experiments.tolerated import TOLERANCES, WORSE, tolerated
from tests.testbed.experiments import made_suites

SUITE = Regress().conditions
TODAY, LATER = Update("2026-11-22", {"numpy": "2.4"}), Update("2026-12-01", {"numpy": "2.5"})
VALUES = made_suites.make(1)
KEY, OTHER = ("a", "scenario-0"), ("b", "scenario-3")


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "baselines.json"
    save(merge(NONE, VALUES, TODAY, ()), SUITE, path)
    return path


def edited(path, change):
    found = json.loads(path.read_text())
    change(found)
    path.write_text(json.dumps(found))


def test_values_come_back_to_six_digits_and_with_their_origin(written):
    found = load(written, SUITE)
    assert set(found.values) == set(VALUES)
    assert all(update == TODAY for update in found.updates.values())
    for key, cell in VALUES.items():
        for measure in TOLERANCES:
            np.testing.assert_allclose(found.values[key][measure], cell[measure], rtol=1e-5)


def test_what_was_not_measured_comes_back_so(tmp_path):
    values = made_suites.changed(VALUES, KEY, "rmse_length", [np.nan, 1.5])
    save(merge(NONE, values, TODAY, ()), SUITE, tmp_path / "b.json")
    np.testing.assert_array_equal(load(tmp_path / "b.json", SUITE).values[KEY]["rmse_length"], [np.nan, 1.5])


def test_writing_what_was_read_changes_no_byte(written):
    before = written.read_bytes()
    save(load(written, SUITE), SUITE, written)
    assert written.read_bytes() == before


def test_the_file_tells_means_and_intervals(written):
    found = json.loads(written.read_text())["trackers"]["a"]
    cell = found["scenarios"]["scenario-0"]["gospa"]
    assert cell["mean"] == pytest.approx(np.mean(cell["values"]), rel=1e-5)
    assert cell["interval"][0] < cell["mean"] < cell["interval"][1]
    low, high = found["overall"]["gospa"]["interval"]
    assert low < found["overall"]["gospa"]["mean"] < high


def test_an_update_of_a_part_leaves_the_rest(written):
    old = load(written, SUITE)
    new = merge(old, {KEY: {m: v + 1 for m, v in VALUES[KEY].items()}}, LATER, old.values)
    assert {key for key in new.values if new.updates[key] == LATER} == {KEY}
    assert all(new.values[key] is old.values[key] for key in VALUES if key != KEY)
    save(new, SUITE, written)
    assert load(written, SUITE).updates == new.updates


def test_what_is_not_to_be_kept_is_dropped():
    old = merge(NONE, VALUES, TODAY, ())
    new = merge(old, {KEY: VALUES[KEY]}, LATER, [OTHER])
    assert set(new.values) == {KEY, OTHER}


def test_the_list_for_the_commit_message_says_what_changed():
    old = merge(NONE, VALUES, TODAY, ())
    values = made_suites.make(2, ("new",)) | made_suites.changed(VALUES, KEY, "gospa", VALUES[KEY]["gospa"] + 1)
    values.pop(OTHER)
    told = update_list(old, merge(old, values, LATER, ()), [OTHER])
    mean = VALUES[KEY]["gospa"].mean()
    assert "- 24 new: new (scenario-0, scenario-1, scenario-2, scenario-3 and 20 more)" in told
    assert f"- a, changed in 1 of 24 scenarios; over these: GOSPA [m] {mean:.3f} -> {mean + 1:.3f}\n" in told
    assert "- 1 dropped, in the catalogues no more: b (scenario-3)" in told
    assert "- 46 unchanged" in told


def test_results_are_their_own_baselines():
    values = merge(NONE, VALUES, TODAY, ()).values
    assert [c for c in tolerated(VALUES, values) if c.verdict == WORSE] == []


def test_a_file_that_is_missing_or_damaged_is_told_in_a_sentence(written, tmp_path):
    with pytest.raises(FileNotFoundError, match="regress --update"):
        load(tmp_path / "none.json", SUITE)
    written.write_text(written.read_text()[:-300])
    with pytest.raises(ValueError, match=r"is damaged .*regress --update"):
        load(written, SUITE)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda f: f.update(layout=0), "has layout 0, not 1"),
        (lambda f: f.update(duration=3.0), "has duration 3.0, the suite has 60.0"),
        (lambda f: f.pop("trackers"), "is damaged"),
        (lambda f: f["updates"].clear(), "is damaged"),
        (lambda f: f["trackers"]["a"]["scenarios"]["scenario-0"].pop("gospa"), "has other measures"),
        (lambda f: f["trackers"]["a"]["scenarios"]["scenario-0"]["gospa"].update(values=[1.0]), "not one value a seed"),
        (lambda f: f["trackers"]["a"]["scenarios"]["scenario-0"]["gospa"].update(values=["x", 1]), "is damaged"),
        (lambda f: f["trackers"].update(a=[]), "is damaged"),
    ],
)
def test_a_file_of_other_runs_or_another_layout_is_refused(written, change, told):
    edited(written, change)
    with pytest.raises(ValueError, match=f"{told}.*regress --update"):
        load(written, SUITE)


def test_a_whole_update_replaces_a_damaged_file_and_a_partial_one_does_not(written):
    written.write_text("{")
    suite = Regress(baselines=written, update=True)
    assert suite.known() == NONE
    with pytest.raises(ValueError, match="without --tracker and --scenario"):
        replace(suite, scenarios=("cut-in",)).known()

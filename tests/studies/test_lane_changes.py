"""How likely a lane change is: what is held against the recordings was not fitted to them."""

import json
from pathlib import Path

import numpy as np

from studies.lane_changes import Samples, calibration, held_out, skill
from testbed.planners.futures import LOG_ODDS

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results" / "lane_changes.json"


def drawn(b=(-2.0, 2.0, 3.0), vehicles: int = 400, each: int = 5) -> Samples:
    rng = np.random.default_rng(0)
    lean = rng.normal(0.0, (0.5, 0.4), (vehicles * each, 2))
    p = 1 / (1 + np.exp(-b[0] - lean @ b[1:]))
    return Samples(lean, rng.random(len(p)) < p, np.repeat(np.arange(vehicles), each))


def test_no_vehicle_has_a_part_in_its_own_probability():
    s = drawn()
    odd = s.vehicle % 2 == 1
    turned = s._replace(changed=s.changed ^ odd)
    before, after = held_out(s), held_out(turned)
    np.testing.assert_array_equal(before[odd], after[odd])
    assert np.abs(before[~odd] - after[~odd]).max() > 0.1


def test_of_changes_by_the_model_as_many_are_expected_as_there_are():
    s = drawn()
    for row in calibration(s.changed, held_out(s))[2:]:
        assert abs(row["changes"] - row["expected"]) < 3 * np.sqrt(row["expected"])
    assert 0.1 < skill(s.changed, held_out(s)) < 1


def test_who_changes_half_as_often_as_is_said_is_found():
    s = drawn()
    rows = calibration(s.changed & (np.arange(len(s.changed)) % 2 == 0), held_out(s))
    assert rows[-1]["expected"] - rows[-1]["changes"] > 3 * np.sqrt(rows[-1]["expected"])


def test_planners_and_their_page_have_the_log_odds_of_recorded_traffic():
    found = json.loads(RESULTS.read_text())
    page = (RESULTS.parents[1] / "methods" / "planners.md").read_text()
    constant, offset, speed = (round(b, 1) for b in found["log_odds"])
    assert [constant, offset, speed] == LOG_ODDS.tolist()
    assert f"z = {constant} + {offset}\\,o + {speed}\\,u" in page
    assert f"{found['vehicles_changing']} of {found['vehicles']} vehicles change" in page


def test_changes_of_recorded_traffic_are_expected_by_the_other_half_of_the_vehicles():
    found = json.loads(RESULTS.read_text())["held_out"]
    assert sum(row["changes"] for row in found["table"]) == json.loads(RESULTS.read_text())["changes"]
    assert found["skill"] > 0.3

"""The table of metrics: every entry is complete, documented and computed; old keys of committed files are read."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import testbed
from testbed.environment.perception import Cost
from testbed.evaluation.driving import Driven
from testbed.evaluation.metric import (
    ALIASES,
    COST,
    DRIVES,
    LEVELS,
    METRICS,
    PAIR,
    SCAN,
    SCORED,
    keys,
    old_names,
    values,
)
from testbed.evaluation.tracking import Evaluator
from tests.testbed.evaluation.test_driving import behind, driven
from tests.testbed.evaluation.test_tracking import road, run, seen, tracks_at

DOCS = Path(__file__).parents[3] / "docs"
UNITS = {"1", "%", "m", "m^2", "m/s", "m/s^2", "m/s^3", "s", "s^2", "deg", "ms", "us"}


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
def test_every_metric_says_what_it_is(metric):
    assert metric.of in LEVELS
    assert metric.unit in UNITS
    assert metric.better in (-1, 0, 1)
    assert "" not in (metric.label, metric.words)
    assert not metric.words.endswith(".")
    assert metric.averaged <= (metric.of in (PAIR, SCAN))


def test_keys_and_labels_are_names_of_one_metric_each():
    assert len({metric.label for metric in METRICS.values()}) == len(METRICS)
    assert all(key == metric.key for key, metric in METRICS.items())
    assert testbed.METRICS is METRICS


def test_every_metric_of_a_result_is_in_the_documentation():
    page = (DOCS / "results.md").read_text()
    shown = [m for m in METRICS.values() if m.of not in (DRIVES, SCORED) and (m.averaged or m.of not in (PAIR, SCAN))]
    assert [metric.key for metric in shown if f"`{metric.key}`" not in page] == []


def test_every_metric_is_computed_where_it_belongs():
    """A number of a run, a drive, two drives and a cost; one number a pair."""
    drive, scene = behind([20.0] * 11), road([20.0])
    found = {**run("..11.222").summary(), **drive.summary(), **values(COST, Cost(0.1, 10, 20))}
    found |= {key: float(value) for key, value in values(SCORED, found, 100.0).items()}
    found |= values(DRIVES, Driven(drive.curves, [1, 1]), Driven(driven([20.0] * 11).curves, [1, 0]))
    assert found.pop("tracker") == "case"
    alone = {m.key for m in METRICS.values() if m.of in (PAIR, SCAN) and not m.averaged}
    assert found.keys() == {m.key for m in METRICS.values() if m.known} - alone
    assert [key for key, value in found.items() if not isinstance(value, int | float)] == []
    score = Evaluator("case").step(0.0, scene, seen(scene), tracks_at([20.5], [1]))
    assert score.errors[1].keys() == set(keys(PAIR))
    assert score.mean.keys() == {*keys(SCAN), *keys(PAIR)}


CASES = {  # tracks of one car, scan by scan -> HOTA, MOTA, IDF1
    "1111": (1.0, 1.0, 1.0),
    # Each track is on the car for 2 of its 4 scans: A = 2 / 4 for all pairs; one switch; the car's own has 2 of 4 + 4.
    "1122": (np.sqrt(1 / 2), 3 / 4, 2 * 2 / 8),
    # One of four missed: A = 3 / 4, detection 3 / 4; the track has 3 scans.
    ".111": (3 / 4, 3 / 4, 2 * 3 / 7),
    "....": (0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("held", CASES)
def test_identities_are_those_counted_by_hand(held):
    summary = run(held).summary()
    assert [summary[key] for key in ("hota", "mota", "idf1")] == pytest.approx(CASES[held])


def test_a_track_beside_its_object_counts_up_to_the_cut_off_of_gospa():
    """2 m off has a similarity of 0.6 and passes 12 of 19 thresholds; 6 m off is a miss and a false track."""
    found = []
    for offset in (2.0, 6.0):
        evaluator, scene = Evaluator("case"), road([20.0])
        for k in range(4):
            evaluator.step(0.5 * k, scene, seen(scene), tracks_at([20.0 + offset], [1]))
        found.append([evaluator.summary()[key] for key in ("hota", "mota", "idf1")])
    np.testing.assert_allclose(found, [[12 / 19, 1.0, 1.0], [0.0, -1.0, 0.0]])


def test_a_track_on_an_object_that_does_not_count_is_no_false_track():
    evaluator, scene = Evaluator("case"), road([20.0, 60.0], kinds=("car", "obstacle"))
    for k in range(4):
        evaluator.step(0.5 * k, scene, seen(scene), tracks_at([20.0, 60.0], [1, 2]))
    assert [evaluator.summary()[key] for key in ("hota", "mota", "idf1")] == pytest.approx([1.0] * 3)


def test_without_its_library_a_metric_is_left_out():
    code = (
        "import sys\nsys.modules['motmetrics'] = None\nfrom testbed.evaluation.metric import keys\nprint(*keys('run'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["plain_view_gap", "uncovered_gap", "orphan_duration", "hota"]
    assert done.stderr == ""


def test_least_times_to_collision_are_those_of_an_empty_road_at_most():
    assert [behind([gap] * 3).summary()["ttc_min"] for gap in (20.0, 200.0)] == pytest.approx([2.0, 10.0])


def test_badness_is_the_value_its_negative_or_its_distance_from_the_ideal():
    found = [METRICS[key].badness(value) for key, value in (("gospa", 2.0), ("progress", 2.0), ("nees_width", 3.0))]
    assert found == [2.0, -2.0, 2.0]
    assert [METRICS[key].sense for key in ("gospa", "progress", "box_iou")] == [
        "less is better", "more is better", "1 is ideal",
    ]  # fmt: skip


def test_counts_are_shown_whole_and_what_was_not_measured_as_missing():
    assert [METRICS["lost"].text(value, "-") for value in (3, 3.0, np.nan, None)] == ["3", "3.00", "-", "-"]
    assert METRICS["gospa"].title == "GOSPA [m]"
    assert METRICS["lost"].title == "lost tracks"


def test_committed_drives_hold_metrics_under_their_keys_and_no_old_name_is_one():
    beside = {"scenario", "planner", "condition", "seed", "cpu", "reference", "parted", "parting"}
    files = sorted((DOCS / "results/regret").glob("*/*.parquet"))
    columns = {name for file in files for name in pq.read_schema(file).names} - beside
    assert files
    assert columns <= METRICS.keys()
    for kind in ("drives", "comparison"):
        assert old_names(kind)
        assert not old_names(kind).keys() & METRICS.keys()
        assert set(old_names(kind).values()) <= METRICS.keys()
    assert set(ALIASES.values()) <= METRICS.keys()

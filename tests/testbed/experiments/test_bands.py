"""Tables of a folder against slow and obvious loops; filters that know how wrong they are, and one that does not."""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbed.evaluation.intervals import crossed_interval
from testbed.evaluation.metric import METRICS
from testbed.experiments import series as bands
from testbed.experiments import statistics
from testbed.experiments.compare import Comparison, write_runs
from testbed.experiments.report import words
from testbed.experiments.rows import COLUMNS, NAMES, SCHEMA
from testbed.experiments.store import ROWS, Results, Store
from testbed.experiments.study import Kept

HONEST, OVERCONFIDENT, BLIND = "rm-koch", "rm-vmm", "htg-map"
SCENARIOS, SEEDS = ("cut-in", "merge"), (0, 1, 2, 5)
PHASES = ("before", "onset", "during", "after", "between")
INSTANTS, OBJECTS = 60, 2  # of a phase
MEASURES = ("gospa", "box_iou", "rmse_length", "nees_position")


class Task(NamedTuple):
    """What names a run in tables."""

    scenario: str
    tracker: str
    seed: int


GONE = Task("merge", OVERCONFIDENT, 5)


def seeded(task, *more):
    return np.random.default_rng((SCENARIOS.index(task.scenario), len(task.tracker), task.seed, *more))


def objects_seen(task):
    """Rows of a filter whose errors have the covariance that it claims, or four times that of the overconfident one."""
    rng = seeded(task)
    claimed = 0.5 if task.tracker == OVERCONFIDENT else 1.0  # standard deviation, as a multiple of the true one
    for k, phase in enumerate(PHASES):
        for instant in range(INSTANTS):
            time = (k * INSTANTS + instant) / 10
            for key in range(OBJECTS):
                row = dict.fromkeys(NAMES) | task._asdict() | {"time": time, "phase": phase, "object": key}
                row |= {"kind": "car", "range": rng.uniform(0, 130), "visible": rng.choice([0, 0.25, 0.7, 0.9995, 1])}
                row |= {"status": "missed", "gospa2": 12.5, "expected": 3.0}
                if task.tracker != BLIND and rng.random() > 0.2:
                    row |= {"status": "pair", "track": 7, "detections": 2, "gospa2": 1.0} | errors(rng, claimed)
                yield row
        yield dict.fromkeys(NAMES) | task._asdict() | {
            "time": time, "phase": phase, "status": "false", "track": 9, "range": 10.0, "gospa2": 12.5, "nis": 99.0,
            "length_std": 1.0,
        }  # fmt: skip


def errors(rng, claimed):
    position, velocity, innovation = rng.normal(size=(3, 2))
    length, width = rng.normal(size=2) * (0.4, 0.2)
    return {
        "position": np.hypot(*position), "velocity": np.hypot(*velocity), "length": length, "width": width,
        "nees_position": position @ position / claimed**2, "nees_velocity": velocity @ velocity / claimed**2,
        "nis": innovation @ innovation / claimed**2, "length_std": 0.4 * claimed, "width_std": 0.2 * claimed,
    }  # fmt: skip


def spans(task):
    """The whole run and its phases with values of their own; the blind tracker has no errors."""
    rng = seeded(task, 1)
    for phase in ("all", *PHASES[:4]):
        values = {key: float(rng.uniform(0, 3)) for key in METRICS}
        values |= {"box_iou": float(rng.uniform(0, 1)), "switches": int(rng.integers(0, 3))}
        if task.tracker == BLIND:
            values |= {key: None for key in METRICS if key.startswith(("rmse", "nees", "box"))}
        times = {} if phase == "all" else {"start": 1.0, "end": 2.0}
        yield task._asdict() | {"phase": phase} | values | times


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    comparison = Comparison(SCENARIOS, (HONEST, OVERCONFIDENT, BLIND), SEEDS, out=str(tmp_path_factory.mktemp("made")))
    out = Path(comparison.out)
    (out / ROWS).mkdir()
    for run in comparison.work():
        task = Task(run.case, run.source, run.seed)
        if task != GONE:
            entries = list(objects_seen(task))
            arrays = [pa.array([entry[c.name] for entry in entries], c.type) for c in COLUMNS]
            Store(comparison).write(run, Kept(pa.table(arrays, SCHEMA), list(spans(task))))
    return Results.read(comparison)


@pytest.fixture(scope="module")
def entries(results):
    """All rows of all files as dicts."""
    paths = [results.store.path(run) for run in results.study.work()]
    return [row for path in paths if path.exists() for row in pq.read_table(path).to_pylist()]


def folder(results):
    return Path(results.study.out)


def value_of(task, measure, phase="all"):
    """What a run has for a measure; NaN without it."""
    if task == GONE:
        return math.nan
    found = next(span[measure] for span in spans(task) if span["phase"] == phase)
    return math.nan if found is None else found


def average(values):
    known = [v for v in values if not math.isnan(v)]
    return sum(known) / len(known) if known else math.nan


def same(a, b):
    return a == pytest.approx(b, rel=1e-5, abs=1e-9, nan_ok=True)


def test_a_run_that_is_gone_is_named_and_the_others_are_read(results):
    assert results.missing == [results.study.run(*GONE)]
    assert len(results.runs) == len(results.study.work()) - 1
    assert len(results.spans) == 5 * len(results.runs)


def test_every_column_of_the_runs_has_its_unit(results):
    schema = pq.read_schema(write_runs(results))
    assert {"start", "end", "phase", *METRICS} <= set(schema.names)
    assert all(b"unit" in field.metadata for field in schema)
    assert schema.field("gospa").metadata[b"unit"] == b"m"
    assert schema.field("end").metadata[b"unit"] == b"s"


@pytest.mark.parametrize("by", [None, "scenario", "phase"])
@pytest.mark.parametrize("measure", MEASURES)
def test_means_are_over_scenarios_of_means_over_seeds(results, measure, by):
    cells = list(statistics.cells(results, [measure], by))
    assert len({(c.group, c.tracker) for c in cells}) == len(cells) > 0
    for cell in cells:
        phase = cell.group if by == "phase" else "all"
        scenarios = (cell.group,) if by == "scenario" else SCENARIOS
        means = [average([value_of(Task(c, cell.tracker, s), measure, phase) for s in SEEDS]) for c in scenarios]
        assert same(cell.mean.value, average(means))


@pytest.mark.parametrize("measure", MEASURES)
def test_differences_are_of_badness_on_the_seeds_that_both_have(results, measure):
    for cell in statistics.cells(results, [measure]):
        if cell.tracker == HONEST:
            assert cell.difference is None
            continue
        means, pairs = [], 0
        for scenario in SCENARIOS:
            differences = []
            for seed in SEEDS:
                bad = []
                for tracker in (cell.tracker, HONEST):
                    value, ideal = value_of(Task(scenario, tracker, seed), measure), METRICS[measure].ideal
                    bad.append(value if ideal is None else abs(value - ideal))
                differences.append(bad[0] - bad[1])
            pairs += sum(not math.isnan(d) for d in differences)
            means.append(average(differences))
        if cell.difference is None:  # of a measure that this tracker never has
            assert pairs == 0
            assert np.isnan([value_of(Task(c, cell.tracker, s), measure) for c in SCENARIOS for s in SEEDS]).all()
            continue
        assert same(cell.difference.mean.value, average(means))
        assert cell.difference.pairs == pairs


@pytest.mark.parametrize("measure", ["gospa", "box_iou", "switches"])
def test_the_probability_of_improvement_counts_runs_one_by_one(results, measure):
    table = statistics.pairwise(results, measure)
    for row in table.index:
        for column in table.columns:
            points, runs = 0.0, 0
            for scenario in SCENARIOS:
                for seed in SEEDS:
                    ideal = METRICS[measure].ideal or 0.0
                    a = abs(value_of(Task(scenario, row, seed), measure) - ideal)
                    b = abs(value_of(Task(scenario, column, seed), measure) - ideal)
                    if not math.isnan(a - b):
                        points, runs = points + (1.0 if a < b else 0.5 if a == b else 0.0), runs + 1
            wanted = math.nan if row == column or not runs else points / runs
            assert same(table.loc[row, column], wanted)
    both = table.to_numpy() + table.to_numpy().T
    assert np.allclose(both[~np.isnan(both)], 1)


def range_label(value):
    for low in (0, 25, 50, 75):
        if low <= value < low + 25:
            return f"{low} to {low + 25} m"
    return "over 100 m"


def visible_label(value):
    return {0.0: "hidden", 0.25: "to 25 %", 0.7: "to 75 %", 0.9995: "whole", 1.0: "whole"}[round(value, 4)]


@pytest.mark.parametrize(("band", "label_of"), [("range", range_label), ("visible", visible_label)])
def test_errors_by_band_are_those_of_a_loop_over_rows(results, entries, band, label_of):
    table = bands.by_band(results, band).set_index(["tracker", "band"])
    assert set(table.index.get_level_values(0)) == {HONEST, OVERCONFIDENT}  # the blind one holds nothing in any band
    counted = [row for row in entries if row["status"] in ("pair", "missed")]
    for tracker, label in table.index:
        part = [r for r in counted if r["tracker"] == tracker and label_of(r[band]) == label]
        found = table.loc[(tracker, label)]
        assert found["frames"] == len(part)
        held, squares = [], {name: [] for name in ("position", "velocity", "length")}
        for scenario in SCENARIOS:
            runs = [[r for r in part if (r["scenario"], r["seed"]) == (scenario, seed)] for seed in SEEDS]
            held.append(average([average([r["status"] == "pair" for r in run]) for run in runs]))
            for name, means in squares.items():
                of_run = [[r[name] ** 2 for r in run if r["status"] == "pair"] for run in runs]
                means.append(average([average(values) for values in of_run]))
        assert same(found["held"], average(held))
        for name, means in squares.items():
            assert same(found[name], math.sqrt(average(means)))
            assert found[f"{name}_low"] <= found[name] <= found[f"{name}_high"]


def test_bands_share_out_all_frames_of_a_tracker_that_holds_something(results, entries):
    counted = sum(r["tracker"] == HONEST and r["status"] in ("pair", "missed") for r in entries)
    for band in bands.BANDS:
        table = bands.by_band(results, band)
        assert table[table["tracker"] == HONEST]["frames"].sum() == counted


def test_a_band_with_too_few_frames_has_no_figures(results, monkeypatch):
    monkeypatch.setattr(bands, "FEWEST_FRAMES", 10**6)
    assert bands.by_band(results, "range").empty


def test_consistency_is_that_of_a_loop_over_pairs(results, entries):
    table = bands.consistency(results).set_index(["tracker", "phase"])
    assert set(table.index) == {(t, p) for t in (HONEST, OVERCONFIDENT) for p in PHASES[:4]}
    for tracker, phase in table.index:
        pairs = [r for r in entries if (r["tracker"], r["phase"], r["status"]) == (tracker, phase, "pair")]
        for name in ("nees_position", "nees_velocity", "nis", "length_covered", "width_covered"):
            means = []
            for scenario in SCENARIOS:
                runs = [[r for r in pairs if (r["scenario"], r["seed"]) == (scenario, seed)] for seed in SEEDS]
                means.append(average([average([quantity(r, name) for r in run]) for run in runs]))
            assert same(table.loc[(tracker, phase), name], average(means))


def quantity(row, name):
    side = name.removesuffix("_covered")
    return abs(row[side]) <= 1.959964 * row[f"{side}_std"] if side != name else row[name]


def test_a_consistent_filter_keeps_its_limits_and_an_overconfident_one_does_not(results):
    table = bands.consistency(results).set_index(["tracker", "phase"])
    honest, other = table.loc[HONEST], table.loc[OVERCONFIDENT]
    frames = len(SCENARIOS) * INSTANTS  # of a phase; four phases
    for name in bands.QUANTITIES:
        assert honest[f"{name}_inside"].mean() == pytest.approx(0.95, abs=4 * math.sqrt(0.05 * 0.95 / (4 * frames)))
        assert honest[name].mean() == pytest.approx(2, abs=0.1)
        assert other[f"{name}_inside"].max() < 0.5
        assert (other[f"{name}_low"] > 2).all()
    for side in ("length", "width"):
        assert honest[f"{side}_covered"].mean() == pytest.approx(0.95, abs=0.01)
        assert other[f"{side}_covered"].max() < 0.8  # twice the claimed deviation: 0.67


def test_the_share_inside_its_limits_by_hand():
    # of one value the limits are 0.0506 and 7.378, of two 0.2422 and 5.572
    mean, count = np.array([0.05, 0.06, 7.3, 7.4, 0.2, 5.5, np.nan]), np.array([1, 1, 1, 1, 2, 2, 0])
    assert bands.inside_share(mean, count) == pytest.approx(3 / 6)
    assert math.isnan(bands.inside_share(mean[-1:], count[-1:]))


def test_an_unresolved_difference_is_named_with_the_seeds_it_takes(results):
    cells = list(statistics.cells(results, ["gospa"]))
    unresolved = [c for c in cells if c.difference and c.difference.verdict == "unresolved"]
    sentences = words.unresolved(cells)
    assert len(sentences) == len(unresolved) > 0
    assert f"about {unresolved[0].difference.needed:.0f} seeds a scenario would resolve it" in sentences[0]


def test_intervals_of_a_cell_are_those_of_its_runs(results):
    (cell,) = [c for c in statistics.cells(results, ["gospa"]) if c.tracker == HONEST]
    values = [np.array([value_of(Task(c, HONEST, s), "gospa") for s in SEEDS]) for c in SCENARIOS]
    assert cell.mean == crossed_interval(values)


def test_files_hold_json_without_nan(results):
    for path in (folder(results) / ROWS).iterdir():
        text = pq.read_metadata(path).metadata[b"testbed"]
        json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))

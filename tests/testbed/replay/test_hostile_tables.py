"""Whatever is wrong with a table: one sentence that names file, column and row, and what to do."""

import copy

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbed.replay.columns import TABLES
from testbed.replay.reading import read
from testbed.replay.scans import MOST_AT_ONCE
from tests.testbed.replay.made_tables import made, save

GOOD = made(0.5)


def put(table, column, row, value):
    def change(tables):
        tables[table][column][row] = value

    return change


def column(table, name, value):
    def change(tables):
        rows = len(next(iter(tables[table].values())))
        tables[table][name] = [value] * rows

    return change


def drop(table, name):
    return lambda tables: tables[table].pop(name)


def rename(table, name, other):
    def change(tables):
        tables[table][other] = tables[table].pop(name)

    return change


def without_rows(table):
    return lambda tables: tables.update({table: {name: [] for name in tables[table]}})


def repeat(table, row):
    def change(tables):
        for values in tables[table].values():
            values.insert(row + 1, values[row])

    return change


def only(table, count):
    def change(tables):
        for values in tables[table].values():
            del values[count:]

    return change


def scaled(table, name, factor):
    def change(tables):
        tables[table][name] = [value * factor for value in tables[table][name]]

    return change


def crowd(tables):
    first = {name: values[0] for name, values in tables["detections"].items()}
    tables["detections"] = {name: [value] * (MOST_AT_ONCE + 1) for name, value in first.items()}


CASES = {
    "sensor table missing": (
        lambda t: t.pop("sensors"),
        r"has no sensors\.parquet or sensors\.csv; .* detections, ego",
    ),
    "ego table missing": (lambda t: t.pop("ego"), r"has no ego\.parquet or ego\.csv"),
    "column missing": (
        drop("ego", "heading"),
        r"ego\.csv has no column heading, direction ahead.* \[rad\]; it has time",
    ),
    "column misspelt": (
        rename("detections", "range_rate", "rangerate"),
        r"a column rangerate; did you mean range_rate",
    ),
    "neither kind of place": (drop("detections", "azimuth"), r"range, row 1: .*neither range and azimuth nor x and y"),
    "no speed": (drop("ego", "speed"), r"ego\.csv, column speed, row 1: .*neither a speed nor vx and vy"),
    "half a velocity": (rename("truth", "speed", "vx"), r"truth\.csv, column speed, row 1"),
    "text for a number": (put("detections", "range", 4, "far"), r"detections\.csv, column range, row 5: .*got 'far'"),
    "comma for a point": (put("ego", "x", 0, "1,5"), r"ego\.csv, column x, row 1: .*'1,5'.*decimal point"),
    "NaN where one is needed": (put("ego", "x", 2, "nan"), r"ego\.csv, column x, row 3: a number is due"),
    "empty cell": (put("sensors", "fov", 1, None), r"sensors\.csv, column fov, row 2: a number is due, got none"),
    "infinite": (put("detections", "range", 3, "inf"), r"column range, row 4: got inf; give a finite number"),
    "half a place": (put("detections", "azimuth", 3, None), r"row 4: there is neither range and azimuth"),
    "azimuth in degrees": (
        put("detections", "azimuth", 6, 37.0),
        r"column azimuth, row 7: .*got 37; angles are in rad",
    ),
    "field of view in degrees": (
        put("sensors", "fov", 0, 120.0),
        r"column fov, row 1: .*rad, got 120; angles are in r",
    ),
    "yaw in degrees": (put("sensors", "yaw", 0, 90.0), r"column yaw, row 1: .*pi / 180"),
    "sigma in degrees": (put("sensors", "sigma_azimuth", 0, 1.2), r"column sigma_azimuth, row 1: .*radians"),
    "heading in degrees": (put("ego", "heading", 1, 90.0), r"ego\.csv, column heading, row 2: .*radians"),
    "range in millimetres": (put("detections", "range", 0, 25e3), r"column range, row 1: .*metres"),
    "size in millimetres": (put("truth", "length", 0, 4500.0), r"truth\.csv, column length, row 1: .*metres"),
    "negative range": (put("detections", "range", 0, -1.0), r"column range, row 1: must be within 0 to"),
    "time in milliseconds": (
        scaled("detections", "time", 1e6),
        r"column time, row \d+: no scan is within 60 s.*millisec",
    ),
    "time in another unit": (
        scaled("detections", "time", 1e-3),
        r"time, row \d+: left has a scan every 0.0001 s.*rate",
    ),
    "zero rate": (put("sensors", "rate", 1, 0), r"sensors\.csv, column rate, row 2: .*leave it out if unknown"),
    "zero sigma": (put("sensors", "sigma_range", 0, 0), r"column sigma_range, row 1"),
    "unsorted detections": (put("detections", "time", 3, 0.4), r"detections\.csv, column time, row 5: .*sort the rows"),
    "unsorted truth": (put("truth", "time", 1, 0.4), r"truth\.csv, column time, row 3: .*sort"),
    "unsorted ego": (put("ego", "time", 1, 0.45), r"ego\.csv, column time, row 3: .*sort"),
    "one time of the ego twice": (repeat("ego", 2), r"ego\.csv, column time, row 4: .*keep one"),
    "one vehicle twice": (repeat("truth", 4), r"truth\.csv, column id, row 6: 'a' is there twice at 0\.2 s; keep one"),
    "ego ends too soon": (only("ego", 3), r"ego\.csv, column time, row 3: the scan at 0\.3 s .*--from and --to"),
    "unknown sensor": (put("detections", "sensor", 2, "rear"), r"column sensor, row 3: .*'rear'; .* has left, right"),
    "one name twice": (put("sensors", "name", 1, "left"), r"column name, row 2: 'left' is empty or there already"),
    "no name": (put("truth", "id", 1, ""), r"truth\.csv, column id, row 2: it is empty"),
    "no detections": (without_rows("detections"), r"detections\.csv has no row"),
    "no sensors": (without_rows("sensors"), r"sensors\.csv has no row"),
    "no ego": (without_rows("ego"), r"ego\.csv has no row"),
    "no truth": (without_rows("truth"), r"truth\.csv has no row; delete it"),
    "too many at once": (crowd, r"detections\.csv, column time, row 1: 20001 detections .* most is 20000"),
    "unknown kind": (column("detections", "kind", "lorry"), r"column kind, row 1: .*'lorry'; choose one of contour"),
    "unknown object": (column("detections", "object", "c"), r"column object, row 1: .*no vehicle 'c'; write its id"),
    "bad contour": (column("truth", "contour", "1 2;3"), r"contour, row 1: '1 2;3' is no outline; write three"),
    "a truth of another clock": (
        lambda t: t["truth"].update(time=[time + 100 for time in t["truth"]["time"]]),
        r"truth\.csv, column time, row 1: the truth is from",
    ),
    "a lane of one place": (scaled("lanes", "x", 0.0), r"lanes\.csv, column lane, row 1: lane '0' is not one line"),
    "a lane of one point": (only("lanes", 3), r"lanes\.csv, column lane, row 3: lane '1' is not one line"),
    "bad profile": (column("sensors", "profile_inside", 2), r"sensors\.csv, row 1: inside, .*profile_"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_table_is_refused_in_a_sentence(case, tmp_path):
    change, sentence = CASES[case]
    tables = copy.deepcopy(GOOD)
    change(tables)
    with pytest.raises(ValueError, match=sentence) as fault:
        read(save(tables, tmp_path))
    text = str(fault.value)
    assert "\n" not in text
    assert any(f"{name}.csv" in text for name in TABLES) or "has no" in text
    assert ";" in text  # and then the remedy


def test_the_tables_are_good_but_for_that(tmp_path):
    assert len(read(save(GOOD, tmp_path)).frames) == 6


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", r"ego\.csv cannot be read: it is empty; write it again"),
        (b"time,x\n1,2,3\n", r"ego\.csv cannot be read: CSV parse error.*; write"),
        (b"time,x,x\n1,2,3\n", r"ego\.csv has the column x twice"),
        (b"\xff\xfe\x00t", r"ego\.csv cannot be read: "),
        (b"time;x;y\n1;2;3\n", r"ego\.csv cannot be read: its columns are separated by ';', not by commas; write it"),
    ],
)
def test_a_broken_csv_is_refused_in_a_sentence(content, sentence, tmp_path):
    (save(GOOD, tmp_path) / "ego.csv").write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        read(tmp_path)


def test_a_broken_parquet_is_refused_in_a_sentence(tmp_path):
    save(GOOD, tmp_path)
    (tmp_path / "ego.csv").unlink()
    (tmp_path / "ego.parquet").write_bytes(b"PAR1 nothing PAR1")
    with pytest.raises(ValueError, match=r"ego\.parquet cannot be read: .*; write it again"):
        read(tmp_path)


def test_a_column_of_another_type_is_refused_in_a_sentence(tmp_path):
    save(GOOD, tmp_path)
    (tmp_path / "ego.csv").unlink()
    lists = {name: [[1.0]] for name in GOOD["ego"]}
    pq.write_table(pa.table(lists), tmp_path / "ego.parquet")
    with pytest.raises(ValueError, match=r"ego\.parquet, column time: numbers are due, got list"):
        read(tmp_path)


def test_a_table_in_both_formats_is_refused(tmp_path):
    save(GOOD, tmp_path)
    pq.write_table(pa.table(GOOD["ego"]), tmp_path / "ego.parquet")
    with pytest.raises(ValueError, match=r"has ego\.parquet and ego\.csv; keep one of them"):
        read(tmp_path)


def test_a_million_detections_are_read_in_seconds_and_refused(tmp_path):
    tables = copy.deepcopy(GOOD)
    detections = tables.pop("detections")
    save(tables, tmp_path)
    (tmp_path / "detections.csv").unlink(missing_ok=True)
    many = {name: np.repeat(values[:1], 1_000_000) for name, values in detections.items()}
    pq.write_table(pa.table(many), tmp_path / "detections.parquet")
    with pytest.raises(ValueError, match=r"detections\.parquet, column time, row 1: 1000000 detections"):
        read(tmp_path)


@pytest.mark.parametrize(
    ("window", "sentence"),
    [
        ((0.6, None), r"no scan is from 0\.6 s to 0\.5 s; the 6 scans"),
        ((None, -1.0), r"no scan is from 0 s to -1 s"),
        ((float("nan"), None), r"--from must be a number of seconds, got nan"),
    ],
)
def test_a_window_without_a_scan_is_refused(window, sentence, tmp_path):
    with pytest.raises(ValueError, match=sentence):
        read(save(GOOD, tmp_path), *window)


def test_what_is_no_folder_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere is not a folder; give that of the tables"):
        read(tmp_path / "nowhere")

"""The page of the calibration: written from an extract made by hand, and its parts."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import sensors
from studies.calibration.figure import CELLS, EDGE, density, unit_frame
from studies.calibration.page import main, missed, parameters
from studies.calibration.report import Compared
from studies.calibration.statistics import ASPECTS, BANDS, NAMES, Vehicles
from studies.page import TABLES


def extract(frames, each):
    """One car ahead in each frame at 10 to 60 m, in the layout of the real extract; its front looks at the radar."""
    rng = np.random.default_rng(0)
    columns = ("frame", "class", "cx", "cy", "yaw", "length", "width", "height")
    k, x = np.arange(frames), rng.uniform(10, 60, frames)
    objects = np.stack([k, 0 * x, x, 0 * x, 0 * x + np.pi, 0 * x + 4.2, 0 * x + 1.8, 0 * x + 1.5], -1)
    on = np.repeat(objects[:, 2:4], each, 0) + rng.uniform(-1, 1, (frames * each, 2)) * [2.1, 0.9]
    return {
        "columns": np.array(columns), "objects": objects, "classes": np.array(["Car"]), "points": on,
        "offsets": np.arange(frames + 1) * each,
    }  # fmt: skip


def test_the_page_its_picture_and_its_results_are_written(tmp_path):
    np.savez(tmp_path / "objects.npz", **extract(60, 10))
    main(tmp_path, tmp_path)
    page = (tmp_path / "calibration.md").read_text()
    result = json.loads((tmp_path / "results" / "calibration.json").read_text())
    assert (tmp_path / "pictures" / "calibration.png").stat().st_size > 10_000
    assert [len(table["heads"]) for table in result["tables"]] == [6, 2]  # all and 10 to 60 m; fronts; no other kind
    assert "| cars | 30 |" in page  # the half that is held out
    assert "| `hidden` |" in page


def one(real, simulated, low, high):
    return Compared(5, *(np.broadcast_to(x, len(NAMES)).astype(float) for x in (real, simulated, low, high)))


def test_sure_misses_are_listed_with_their_interval_and_doubtful_ones_are_counted():
    found = {
        "all": one(1.0, 2.0, 1.9, 2.1),  # of no aspect and no range: not counted
        f"{BANDS[0][0]:.0f}-{BANDS[0][1]:.0f} m": one(1.0, 1.2, 1.15, 1.25),
        ASPECTS[0]: one(1.0, 1.2, 1.05, 1.25),
        ASPECTS[1]: one(1.0, 1.05, 1.0, 1.15),
    }
    rows, doubtful = missed(found)
    assert len(rows) == doubtful == len(NAMES)
    assert rows[0] == ("0-15 m", "facing half", "1.00", "1.20", "1.20 (1.15 to 1.25)")


def test_vehicles_are_mirrored_so_that_the_radar_is_to_the_left_of_each():
    pose = np.array([[20.0, 5.0, 0.0], [20.0, -5.0, 0.0]])  # the radar lies towards -y of the first, +y of the second
    xy = pose[:, :2] + [[1.0, -0.5], [1.0, 0.5]]
    cars = Vehicles(pose, np.tile([4.0, 2.0], (2, 1)), np.full(2, "car"), np.zeros(2, int), xy, np.arange(2))
    np.testing.assert_allclose(unit_frame(cars), [[0.5, 0.5], [0.5, 0.5]])


def test_the_density_of_detections_integrates_to_one():
    u = np.random.default_rng(0).uniform(-1, 1, (500, 2))
    assert density(u).sum() * (2 * EDGE / CELLS) ** 2 == pytest.approx(1.0)


def test_the_parameters_of_the_radar_are_all_on_the_page():
    aspects = sensors.find("imaging").sensors[0].aspects
    table = parameters(aspects)
    assert f"| `fade` | {aspects.fade:g} |" in table
    assert table.count("\n") == 1 + len(vars(aspects))


def rows_of(file):
    with file.open(newline="") as lines:
        return list(csv.reader(lines))


def test_the_committed_page_shows_the_committed_results_and_the_radar_of_the_catalogue():
    docs = Path(__file__).parents[3] / "docs"
    page = (docs / "calibration.md").read_text()
    page += "".join("| " + " | ".join(row) + " |\n" for row in rows_of(docs / TABLES / "calibration" / "tables.csv"))
    for table in json.loads((docs / "results" / "calibration.json").read_text())["tables"]:
        for row in table["rows"]:
            assert "| " + " | ".join(row) + " |\n" in page
    assert parameters(sensors.find("imaging").sensors[0].aspects) in page

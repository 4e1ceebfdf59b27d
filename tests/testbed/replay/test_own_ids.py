"""The ids that a user has given to vehicles stand in log and page."""

import csv

from typer.testing import CliRunner

from testbed.cli import app
from testbed.log.review_page.contents import contents


def renamed(path, column, names):
    rows = list(csv.DictReader(path.open(newline="")))
    for row in rows:
        row[column] = names.get(row[column], row[column])
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def test_ids_of_a_recording_are_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recorded = CliRunner().invoke(app, ["record", "passed", "--duration", "0.4", "--out", "rec", "--format", "csv"])
    assert recorded.exit_code == 0, recorded.output
    names = {"1": "bus-7b"}
    renamed(tmp_path / "rec" / "truth.csv", "id", names)
    renamed(tmp_path / "rec" / "detections.csv", "object", names)
    done = CliRunner().invoke(app, ["replay", "rec", "--tracker", "rm-koch"])
    assert done.exit_code == 0, done.output
    (label,) = contents(next((tmp_path / "runs").glob("*.rrd")))["names"].values()
    assert label.startswith("veh_01 (bus-7b) ")

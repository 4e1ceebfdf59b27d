"""docs/examples: every program runs, is short, and is named in the index."""

import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
SHOWS = {  # what each program prints, at least once
    "first_env": r"track +-?[\d.]+ m ahead, .* m long",
    "own_planner": r"8\.0 s +[\d.]+ m/s +gap .* m\nno collision",
    "own_filter": r"Kalman: GOSPA [\d.]+ m, position RMSE [\d.]+ m",
    "whole_tracker": r"Nearest: GOSPA [\d.]+ m, position RMSE [\d.]+ m",
    "filterpy_tracker": r"Points: GOSPA [\d.]+ m, position RMSE [\d.]+ m",
    "stonesoup_tracker": r"Soup: GOSPA [\d.]+ m, position RMSE [\d.]+ m",
    "own_radar": r"double: \d+ detections a scan, [\d.]+ tracks of \d+ vehicles",
    "own_environment": r"bus, car, .*: \d+ tracks",
    "own_scenario": r"van +at .* m: nearest track off by \d\.\d m",
    "compare_trackers": r"GOSPA \[m\] .* difference -[\d.]+ \+- [\d.]+",
    "train": r"on truth +length .* crashes \d+%\non rm-feldmann",
    "read_log": r"GOSPA +[\d.]+ m in step 0, [\d.]+ m in step \d+\nevent",
}


CONVERTERS = {
    "kitti_scans": 70,
    "nuscenes_radar": 100,
    "mot_text": 75,
    "nuscenes_tracks": 100,
}  # and their lines; test_converters.py makes files for them


LIBRARIES = {  # that a program needs and that are no dependencies
    "train": "stable_baselines3",
    "filterpy_tracker": "filterpy",
    "stonesoup_tracker": "stonesoup",
}


def test_every_program_is_tried():
    assert {file.stem for file in DOCS.glob("examples/*.py")} == {*SHOWS, *CONVERTERS, "plots"}


BRIEFLY = {  # it learns from step 200 on
    "train": ["--tracker", "rm-feldmann", "--first", "in-view", "--steps", "400", "--episodes", "1", "--checks", "1"]
}


@pytest.mark.parametrize("name", SHOWS)
def test_the_program_runs_and_shows_something(name, tmp_path, monkeypatch, capsys):
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name], reason=f"{LIBRARIES[name]} is no dependency; docs/examples needs it")
    monkeypatch.syspath_prepend(DOCS / "examples")
    monkeypatch.chdir(tmp_path)  # where it may leave a folder `runs`
    monkeypatch.setattr("sys.argv", [name, *BRIEFLY.get(name, ())])
    runpy.run_path(str(DOCS / "examples" / f"{name}.py"), run_name="__main__")
    assert re.search(SHOWS[name], capsys.readouterr().out)


@pytest.mark.parametrize("name", [*SHOWS, *CONVERTERS, "plots"])
def test_the_program_is_short_and_in_the_index(name):
    long = {"train": 120, "whole_tracker": 100, "filterpy_tracker": 85, "stonesoup_tracker": 130, "plots": 95}
    lines = (long | CONVERTERS).get(name, 60)
    assert len((DOCS / "examples" / f"{name}.py").read_text().splitlines()) <= lines
    assert f"(examples/{name}.py)" in (DOCS / "index.md").read_text()

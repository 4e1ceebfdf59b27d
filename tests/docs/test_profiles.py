"""The learned profiles of sensors, and what size earns by radar, are on the page as in the committed results."""

import json
from pathlib import Path

import pandas as pd
import pytest

import sensors

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "methods" / "size-from-both-ends.md").read_text()
RESULT = json.loads((DOCS / "results" / "profiles.json").read_text())
RADARS = json.loads((DOCS / "results" / "size-by-radar.json").read_text())["rows"]


@pytest.mark.parametrize("name", RESULT["profiles"])
@pytest.mark.parametrize("table", ["profiles", "log_density"])
def test_a_row_of_the_page_is_that_of_the_result(table, name):
    row = RESULT[table][name]
    learned_from = row if table == "profiles" else {key: row[key] for key in ("default", *RESULT["profiles"])}
    assert f"| {name} | " + " | ".join(f"{x:.2f}" for x in learned_from.values()) + " |\n" in PAGE


def test_the_radars_on_the_page_are_those_of_the_result():
    for row in RADARS:
        if row["radar"] != "imaging":
            head = f"| {row['radar']} | {row['scenario']} | {row['seed']} |"
            assert f"{head} {row['off']:.2f} | {row['ends']:.2f} | |\n" in PAGE


def test_the_drives_of_imaging_are_means_over_scenarios_on_the_page():
    drives = pd.DataFrame([row for row in RADARS if row["radar"] == "imaging"])
    for seed, mean in drives.groupby("seed")[["off", "ends", "not_patchy"]].mean().iterrows():
        assert f"| imaging | seven | {seed} | {' | '.join(f'{x:.2f}' for x in mean)} |\n" in PAGE


def test_what_patchy_detections_cost_is_that_of_the_drives_not_seen_before():
    held = pd.DataFrame([row for row in RADARS if row["radar"] == "imaging" and row["seed"] >= 410])
    text = " ".join(PAGE.split())
    assert f"{held.off.mean():.2f} m without the layer and {held.ends.mean():.2f} m with it" in text
    assert f"better in {(held.ends < held.off).sum()} drives" in text
    assert f"not patchy it is {held.not_patchy.mean():.2f} m" in text


def test_the_imaging_radar_has_the_learned_profile():
    profile = sensors.find("imaging").sensors[0].profile
    for name, value in RESULT["profiles"]["imaging"].items():
        assert getattr(profile, name) == pytest.approx(value, abs=1e-9)

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


TEXT = " ".join(PAGE.split())
SIMULATED = ("surround", "nuscenes-like", "imaging")


def loss(detections, profile):
    """Mean log density [nat] that the detections of one sensor lose under the profile of another."""
    return RESULT["log_density"][detections][detections] - RESULT["log_density"][detections][profile]


def test_what_the_profile_of_another_sensor_costs_is_that_of_the_result():
    radars = [loss(a, b) for a in SIMULATED for b in SIMULATED if a != b]
    outline = [loss(a, "lidar-1deg") for a in SIMULATED]
    assert f"between simulated radars {min(radars):.2f} to {max(radars):.2f} nat" in TEXT
    assert f"costs a radar {min(outline):.2f} to {max(outline):.2f} nat" in TEXT
    assert f"real radar detections {loss('astyx', 'lidar-1deg'):.2f}" in TEXT


def test_how_often_size_is_better_is_that_of_the_result():
    assert f"better with size in {sum(row['ends'] < row['off'] for row in RADARS)} of {len(RADARS)} drives" in TEXT


def test_what_patchy_detections_cost_is_that_of_the_drives_not_seen_before():
    held = pd.DataFrame([row for row in RADARS if row["radar"] == "imaging" and row["seed"] >= 410])
    assert f"{held.off.mean():.2f} m without the layer and {held.ends.mean():.2f} m with it" in TEXT
    assert f"better in {(held.ends < held.off).sum()} drives" in TEXT
    assert f"not patchy it is {held.not_patchy.mean():.2f} m" in TEXT


def test_the_imaging_radar_has_the_learned_profile():
    profile = sensors.find("imaging").sensors[0].profile
    for name, value in RESULT["profiles"]["imaging"].items():
        assert getattr(profile, name) == pytest.approx(value, abs=1e-9)

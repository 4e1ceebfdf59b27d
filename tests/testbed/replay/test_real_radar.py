"""A real radar, replayed: its scans as tables, with the ego's speed from the range rates of what stands still."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from studies.standing.scans import read_real
from studies.standing.statistics import fit_motion
from testbed.replay.reading import read
from testbed.replay.replaying import ReplayConfig, prepare, replay

REAL = Path(__file__).resolve().parents[4] / "shared/data/raflow"
PERIOD = 0.1 * 19 / 15  # [s] of a scan: there are 15 different ones in 19 frames at 10 Hz
SHEET = {"max_range": 120.0, "fov": 2.0, "sigma_range": 0.2, "sigma_azimuth": 0.01, "sigma_rate": 0.1, "clutter": 5.0}

pytestmark = pytest.mark.skipif(not REAL.exists(), reason="the recordings of a real radar are not here")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One of its five drives; the ego is taken to drive straight on."""
    out = tmp_path_factory.mktemp("real")
    scans = [scan for scan in read_real(REAL)[0] if scan.run == "run 0"][4:]  # the first are of another place
    time = PERIOD * np.arange(len(scans))
    speed = np.array([fit_motion(scan.polar)[0] for scan in scans])
    x = np.append(0.0, np.cumsum(speed[:-1] * PERIOD))
    still = np.zeros(len(scans))
    ego = {"time": time, "x": x, "y": still, "heading": still, "speed": speed, "yaw_rate": still}
    pd.DataFrame(ego).to_csv(out / "ego.csv", index=False)
    parts = [
        pd.DataFrame(scan.polar, columns=["range", "azimuth", "range_rate"]).assign(time=t, sensor="radar")
        for t, scan in zip(time, scans, strict=True)
    ]
    pd.concat(parts).to_csv(out / "detections.csv", index=False)
    pd.DataFrame([{"name": "radar", "x": 2.0, "y": 0.0, "yaw": 0.0, **SHEET}]).to_csv(out / "sensors.csv", index=False)
    return out


def test_most_of_what_a_real_radar_sees_stands_still_in_the_world(folder):
    """It would move at the speed of the ego if a sign or a frame were wrong."""
    frames = read(folder).frames
    assert min(frame.scene.ego.velocity[0] for frame in frames) > 8.0
    rates = np.concatenate([frame.scan.ground_rate for frame in frames])
    assert np.mean(np.abs(rates) < 0.5) > 0.5


def test_tracks_of_a_real_radar_go_where_their_velocity_says(folder, tmp_path):
    config = ReplayConfig(str(folder), ("rm-surface",), out=str(tmp_path), log="off")
    done = replay(config, prepare(config))
    tracks = pq.read_table(done.tracks).to_pandas()
    assert np.isfinite(tracks[["x", "y", "heading", "vx", "vy", "length", "width", "cov_x_x"]]).all(axis=None)
    ends = tracks.groupby("track").agg(scans=("x", "size"), vx=("vx", "median"), a=("x", "first"), b=("x", "last"))
    long = ends[ends.scans >= 10]
    assert len(long) >= 4
    assert ((long.b - long.a) / (PERIOD * (long.scans - 1)) - long.vx).abs().median() < 1.5

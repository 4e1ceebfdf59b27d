"""A real radar, replayed: its scans as tables, with the ego's speed from the range rates of what stands still."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from studies.standing.scans import polar_of, read_real
from studies.standing.statistics import fit_motion
from testbed.replay.fixes import DOUBT, FAULT
from testbed.replay.plausibility import judged
from testbed.replay.reading import read
from testbed.replay.replaying import ReplayConfig, prepare, replay

DATA = Path(__file__).resolve().parents[4] / "shared/data"
REAL, DENSE = DATA / "raflow", DATA / "astyx_hires2019_extract"
PERIOD = 0.1 * 19 / 15  # [s] of a scan: there are 15 different ones in 19 frames at 10 Hz
SHEET = {"max_range": 120.0, "fov": 2.0, "sigma_range": 0.2, "sigma_azimuth": 0.01, "sigma_rate": 0.1, "clutter": 5.0}

pytestmark = pytest.mark.skipif(not REAL.exists(), reason="the recordings of a real radar are not here")


def tables(scans, period, out):
    """The tables of polar scans (M, 3) of one radar; the ego is taken to drive straight on."""
    out.mkdir(parents=True, exist_ok=True)
    time = period * np.arange(len(scans))
    speed = np.array([fit_motion(polar)[0] for polar in scans])
    x = np.append(0.0, np.cumsum(speed[:-1] * period))
    still = np.zeros(len(scans))
    ego = {"time": time, "x": x, "y": still, "heading": still, "speed": speed, "yaw_rate": still}
    pd.DataFrame(ego).to_csv(out / "ego.csv", index=False)
    parts = [
        pd.DataFrame(polar, columns=["range", "azimuth", "range_rate"]).assign(time=t, sensor="radar")
        for t, polar in zip(time, scans, strict=True)
    ]
    pd.concat(parts).to_csv(out / "detections.csv", index=False)
    pd.DataFrame([{"name": "radar", "x": 2.0, "y": 0.0, "yaw": 0.0, **SHEET}]).to_csv(out / "sensors.csv", index=False)
    return out


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One of its five drives, without the first scans, which are of another place."""
    scans = [scan.polar for scan in read_real(REAL)[0] if scan.run == "run 0"][4:]
    return tables(scans, PERIOD, tmp_path_factory.mktemp("real"))


@pytest.mark.parametrize("run", range(5))
def test_its_drives_are_plausible_and_a_wrong_unit_or_sign_is_found(run, tmp_path):
    scans = [scan.polar for scan in read_real(REAL)[0] if scan.run == f"run {run}"]
    assert not [f for f in judged(tables(scans, PERIOD, tmp_path))[1] if f.verdict in (DOUBT, FAULT)]
    for fits, factor in (("km/h", 3.6), ("reversed", -1.0)):
        rows = pd.read_csv(tmp_path / "detections.csv")
        rows["range_rate"] *= factor
        wrong = tmp_path / "wrong"
        shutil.copytree(tmp_path, wrong, ignore=shutil.ignore_patterns("wrong"))
        rows.to_csv(wrong / "detections.csv", index=False)
        assert ("range rate", fits) in [(f.test, f.fits) for f in judged(wrong)[1] if f.verdict == FAULT]
        shutil.rmtree(wrong)


@pytest.mark.skipif(not DENSE.exists(), reason="the scans of the imaging radar are not here")
def test_scans_of_an_imaging_radar_are_plausible(tmp_path):
    arrays = np.load(DENSE / "scans_000155_000192.npz")
    parts = np.split(arrays["points"].astype(float), arrays["offsets"][1:-1])
    found = judged(tables([polar_of(p) for p in parts], 1 / 13, tmp_path))[1]
    assert not [f for f in found if f.verdict in (DOUBT, FAULT)]


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
    ends = tracks.groupby("id").agg(scans=("x", "size"), vx=("vx", "median"), a=("x", "first"), b=("x", "last"))
    long = ends[ends.scans >= 10]
    assert len(long) >= 4
    assert ((long.b - long.a) / (PERIOD * (long.scans - 1)) - long.vx).abs().median() < 1.5

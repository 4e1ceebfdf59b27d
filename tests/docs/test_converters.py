"""docs/examples: the converters of recordings, on small files in the layouts of KITTI raw and nuScenes."""

import json
import runpy
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from testbed.replay.reading import read
from testbed.replay.recorded_tracks import TracksSource
from testbed.replay.replaying import ReplayConfig, prepare, replay
from tests.testbed.replay.made_tracks import recording, tracks, written

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SPEED, PERIOD = 10.0, 0.1  # [m/s] of ego and car, [s]


def convert(name, monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", [name, *map(str, arguments)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")


def tracks_of(folder, tmp_path):
    config = ReplayConfig(str(folder), ("rm-surface",), out=str(tmp_path / "runs"), log="off")
    done = replay(config, prepare(config))
    return done, pq.read_table(done.tracks).to_pandas()


def kitti(folder, scans=8):
    """An ego that drives east, and a car 15 m ahead of it at the same speed, above returns from the ground."""
    for sensor in ("oxts", "velodyne_points"):
        (folder / sensor / "data").mkdir(parents=True)
        stamps = [f"2011-09-26 13:02:{25 + PERIOD * k:012.9f}" for k in range(scans)]
        (folder / sensor / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    rear = np.array([(15.0, y, -0.8, 0.3) for y in np.linspace(-0.9, 0.9, 40)])
    deeper = rear + np.array([0.5, 0.0, 0.1, 0.0])  # behind the rear: not the nearest
    ground = np.array([(x, 0.0, -1.73, 0.1) for x in np.linspace(5.0, 12.0, 30)])
    for k in range(scans):
        metres = SPEED * PERIOD * k
        row = np.zeros(30)
        row[[0, 1, 5, 8]] = 49.0, 8.4 + np.degrees(metres / (6378137.0 * np.cos(np.radians(49.0)))), 0.0, SPEED
        np.savetxt(folder / "oxts" / "data" / f"{k:010d}.txt", row[None], fmt="%.12f")
        np.concatenate([ground, deeper, rear]).astype(np.float32).tofile(
            folder / "velodyne_points" / "data" / f"{k:010d}.bin"
        )
    return folder


def test_a_drive_in_the_layout_of_kitti_becomes_contours_that_are_tracked(tmp_path, monkeypatch, capsys):
    convert("kitti_scans", monkeypatch, kitti(tmp_path / "drive"), tmp_path / "out")
    assert "8 scans" in capsys.readouterr().out
    recorded = read(tmp_path / "out")
    scan, ego = recorded.frames[-1].scan, recorded.frames[-1].scene.ego
    assert ego.pose == pytest.approx([7.0, 0.0, 0.0], abs=1e-3)
    assert scan.xy[:, 0] == pytest.approx(7.0 + 0.81 + 15.0, abs=0.05)  # the nearest in each direction, no ground
    assert np.isnan(scan.polar[:, 2]).all()
    done, tracks = tracks_of(tmp_path / "out", tmp_path)
    assert "trackers" not in done.result
    assert tracks.id.nunique() == 1
    assert tracks.vx.iloc[-1] == pytest.approx(SPEED, abs=1.5)


def nuscenes(folder, sweeps=9):
    """Two radars that look ahead in turn, a car 20 m ahead of an ego that drives north."""
    start, token, half = 1_533_151_603_000_000, "sample_{}".format, np.sqrt(0.5)
    north = [half, 0.0, 0.0, half]  # quaternion of 90 degrees
    tables = {name: [] for name in ("sample_data", "ego_pose", "sample_annotation")}
    tables |= {
        "scene": [{"token": "s", "name": "scene-0001"}, {"token": "t", "name": "scene-0002"}],
        "sample": [{"token": token(k), "timestamp": start + 400_000 * k, "scene_token": "s"} for k in range(3)],
        "sensor": [{"token": f"r{k}", "channel": f"RADAR_{k}", "modality": "radar"} for k in range(2)],
        "calibrated_sensor": [
            {"token": f"c{k}", "sensor_token": f"r{k}", "translation": [3.0, 0.5 - k, 0.5], "rotation": [1.0, 0, 0, 0]}
            for k in range(2)
        ],
        "instance": [{"token": "car", "category_token": "k"}],
        "category": [{"token": "k", "name": "vehicle.car"}],
    }
    tables["sensor"].append({"token": "cam", "channel": "CAM_FRONT", "modality": "camera"})
    tables["calibrated_sensor"].append(
        {"token": "c9", "sensor_token": "cam", "translation": [0, 0, 0], "rotation": north}
    )
    (folder / "v1.0-mini").mkdir(parents=True)
    for k in range(sweeps):
        time, channel = start + 100_000 * k, k % 2
        pose = {"timestamp": time, "translation": [600.0, 100.0 + SPEED * PERIOD * k, 0.0], "rotation": north}
        tables["ego_pose"].append({"token": f"p{k}", **pose})
        one = {"token": f"d{k}", "sample_token": token(k // 4), "ego_pose_token": f"p{k}", "timestamp": time}
        tables["sample_data"].append({**one, "calibrated_sensor_token": f"c{channel}", "filename": f"{k}.pcd"})
        tables["sample_data"].append({**one, "token": f"e{k}", "calibrated_sensor_token": "c9", "filename": "none.jpg"})
        y = np.linspace(-0.8, 0.8, 6) - 0.5 + channel
        write_pcd(folder / f"{k}.pcd", np.stack([np.full(6, 17.0), y], -1), np.zeros((6, 2)))
    for k in range(3):
        place = [600.0, 100.0 + 4 * SPEED * PERIOD * k + 22.0, 0.5]
        box = {"translation": place, "size": [1.9, 4.4, 1.5], "rotation": north}
        tables["sample_annotation"].append({"token": f"a{k}", "sample_token": token(k), "instance_token": "car", **box})
    for name, rows in tables.items():
        (folder / "v1.0-mini" / f"{name}.json").write_text(json.dumps(rows))
    return folder


def write_pcd(file, xy, velocity):
    """A sweep with some of the fields of the radars, in their mixture of types."""
    names, types, sizes = "x y z dyn_prop id rcs vx vy", "F F F I I F F F", "4 4 4 1 2 4 4 4"
    kinds = ["<f4", "<f4", "<f4", "i1", "<i2", "<f4", "<f4", "<f4"]
    points = np.zeros(len(xy), list(zip(names.split(), kinds, strict=True)))
    points["x"], points["y"], points["vx"], points["vy"] = *xy.T, *velocity.T
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS {names}\nSIZE {sizes}\nTYPE {types}\nCOUNT 1 1 1 1 1 1 1 1\n"
    head += f"WIDTH {len(xy)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(xy)}\nDATA binary\n"
    file.write_bytes(head.encode() + points.tobytes())


def test_a_scene_in_the_layout_of_nuscenes_is_tracked_and_scored(tmp_path, monkeypatch, capsys):
    convert("nuscenes_radar", monkeypatch, nuscenes(tmp_path / "data"), "scene-0001", tmp_path / "out")
    assert "9 sweeps of 2 radars, 3 annotated samples" in capsys.readouterr().out
    recorded = read(tmp_path / "out")
    assert recorded.sensors.names == ("RADAR_0", "RADAR_1")
    frame = recorded.frames[2]
    assert frame.scene.ego.velocity == pytest.approx([0.0, SPEED], abs=0.01)
    assert frame.scene.objects.pose[0] == pytest.approx([600.0, 124.0, np.pi / 2], abs=0.01)
    assert frame.origin.object.tolist() == [0] * 6  # on the rear of the annotated car
    assert frame.scan.polar[:, 2] == pytest.approx(0.0)
    done, _ = tracks_of(tmp_path / "out", tmp_path)
    row = done.result["trackers"]["rm-surface"]
    assert row["missed_percent"] < 20
    assert row["rmse_position"] < 1.5
    assert row["rmse_velocity"] < 1.5


def score(file, drive, tmp_path):
    config = ReplayConfig(str(drive), (), out=str(tmp_path), log="off", tracks=(("mine", TracksSource(file)),))
    return replay(config, prepare(config)).result["trackers"]["mine"]


@pytest.mark.filterwarnings("ignore:Operation with tuple")  # in motmetrics
def test_tracks_go_out_as_motchallenge_text_that_an_evaluator_reads_and_come_back(tmp_path, monkeypatch):
    """Car b is missed at the first of four scans, and has another track at the last."""
    motmetrics = pytest.importorskip("motmetrics", reason="the extra mot is not installed")
    drive, table = recording(tmp_path / "drive", 0.3), tracks(0.3)
    table = {name: values[:1] + values[2:] for name, values in table.items()}
    table["id"][-1] = "other"
    file = written(table, tmp_path / "mine.csv")
    convert("mot_text", monkeypatch, "out", file, drive, tmp_path / "mot")
    truth, mine = (motmetrics.io.loadtxt(tmp_path / "mot" / f"{name}.txt", fmt="mot15-2D") for name in ("gt", "tracks"))
    accumulator = motmetrics.MOTAccumulator()
    for frame in range(1, 5):
        boxes, other = (rows.loc[frame][["X", "Y", "Width", "Height"]] for rows in (truth, mine))
        off = np.abs(boxes.to_numpy()[:, None] - other.to_numpy()).max(-1)
        accumulator.update(boxes.index, other.index, np.where(off < 0.01, off, np.nan), frameid=frame)
    found = motmetrics.metrics.create().compute(accumulator, metrics=["mota", "num_switches"], return_dataframe=False)
    assert found == {"mota": pytest.approx(1 - 2 / 8), "num_switches": 1}  # a miss and a switch of eight
    convert("mot_text", monkeypatch, "in", tmp_path / "mot" / "tracks.txt", drive, tmp_path / "back.csv")
    own, back = score(file, drive, tmp_path), score(tmp_path / "back.csv", drive, tmp_path)
    assert back["rmse_velocity"] == pytest.approx(0.0, abs=1e-6)
    assert back["rmse_length"] == pytest.approx(0.0, abs=1e-6)
    assert back["tracks_reported"] == own["tracks_reported"] - 1  # one scan gives no velocity


def test_tracks_and_detections_go_out_as_json_of_nuscenes_and_come_back(tmp_path, monkeypatch):
    drive = recording(tmp_path / "drive", 0.3)
    table = tracks(0.3, existence=0.9)
    table["heading"] = [0.3] * len(table["x"])
    file, made = written(table, tmp_path / "mine.csv"), tmp_path / "made.json"
    convert("nuscenes_tracks", monkeypatch, "out", file, drive, made)
    found = json.loads(made.read_text())
    assert list(found["results"]) == ["0", "100000", "200000", "300000"]
    first = found["results"]["100000"][1]
    assert first["translation"] == pytest.approx([16.9, 4.0, 0.8])
    assert (first["size"], first["tracking_score"]) == ([2.5, 8.0, 1.6], 0.9)
    assert len(found["detections"]["0"]) == 48
    back = tmp_path / "back"
    convert("nuscenes_tracks", monkeypatch, "in", made, back)
    assert score(back / "tracks.csv", drive, tmp_path) == score(file, drive, tmp_path)
    for name in ("ego", "sensors", "truth"):
        (back / f"{name}.csv").write_text((drive / f"{name}.csv").read_text())
    for one, other in zip(read(drive).frames, read(back).frames, strict=True):
        assert np.sort(other.scan.polar, 0) == pytest.approx(np.sort(one.scan.polar, 0), abs=1e-9)
    renamed = {f"token{t}": rows for t, rows in found["results"].items()}
    made.write_text(json.dumps({"results": renamed}))
    samples = [{"token": f"token{t}", "timestamp": int(t)} for t in found["results"]]
    (tmp_path / "sample.json").write_text(json.dumps(samples))
    convert("nuscenes_tracks", monkeypatch, "in", made, tmp_path / "named", tmp_path / "sample.json")
    assert (tmp_path / "named" / "tracks.csv").read_text() == (back / "tracks.csv").read_text()

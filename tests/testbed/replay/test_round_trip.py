"""A drive of ours, written as tables and read back, gives trackers, metrics and files the same bits."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from testbed.environment.perception import radar_of
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.replay.reading import read
from testbed.replay.recording import record
from testbed.replay.replaying import ReplayConfig, prepare, replay
from testbed.replay.rescan import replay as replayed
from testbed.replay.writing import write

TRACKERS = ("rm-koch", "imm-htg")  # the second has layers that use counts, fields of view and depth profiles
SEED, DURATION = 3, 1.2


@pytest.fixture(
    scope="module", params=[("cut-in", "surround"), ("articulated-turn", "nuscenes-like")], ids=lambda d: d[0]
)
def drive(request):
    scenario, radar = request.param
    return record(scenario, SEED, radar, DURATION)


@pytest.fixture(scope="module")
def live(drive):
    """Frames and summaries of trackers on the drive itself."""
    frames, judges = [], {name: Evaluator(name) for name in TRACKERS}

    def judge(frame):
        frames.append(frame)
        for name, (tracks, info) in frame.outputs.items():
            judges[name].step(frame.time, frame.scene, frame.origin, tracks, info.owner)

    replayed(drive, TRACKERS, [judge])
    return frames, {name: judge.summary() for name, judge in judges.items()}


def same_bits(a, b):
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_scans_sheets_and_maps_come_back_to_the_last_bit(drive, format, tmp_path):
    write(drive, tmp_path, format)
    back = read(tmp_path)
    assert back.sensors.models == radar_of(drive.radar).models
    assert all(same_bits(a, b) for a, b in zip(drive.road, back.road, strict=True))
    assert len(back.frames) == len(drive.frames) > 10
    for was, now in zip(drive.frames, back.frames, strict=True):
        assert was.scene.time == now.scene.time
        assert all(same_bits(a, b) for a, b in zip(was.scan, now.scan, strict=True))
        assert all(same_bits(getattr(was.origin, n), getattr(now.origin, n)) for n in ("object", "kind", "expected"))
        assert was.scene.objects.kind == now.scene.objects.kind
        for a, b in zip(was.scene.bodies.outline, now.scene.bodies.outline, strict=True):
            assert same_bits(a, b)


def test_the_replay_gives_the_same_tracks_and_measures(drive, live, tmp_path):
    frames, summaries = live
    write(drive, tmp_path / "made", "csv")
    config = ReplayConfig(str(tmp_path / "made"), TRACKERS, out=str(tmp_path), log="off")
    done = replay(config, prepare(config))
    assert done.exit_status == 0
    table = pq.read_table(done.tracks).to_pandas()
    for name in TRACKERS:
        own = table[table.tracker == name]
        of = [(f.time, f.outputs[name][0]._replace(state=None).reported) for f in frames]
        assert own.time.tolist() == [time for time, tracks in of for _ in tracks.id]
        assert own.id.tolist() == [number for _, tracks in of for number in tracks.id.tolist()]
        pose = np.concatenate([tracks.estimate.pose for _, tracks in of])
        cov = np.concatenate([tracks.estimate.cov for _, tracks in of])
        assert same_bits(own[["x", "y", "heading"]].to_numpy(), pose)
        assert same_bits(own.cov_x_vx.to_numpy(), cov[:, 0, 2].copy())
    if "articulated" not in drive.scenario:  # its trailer is a body of its own, whose pose no table has
        expected = json.loads(json.dumps({name: jsonable(row) for name, row in summaries.items()}))
        assert json.loads(done.json.read_text())["trackers"] == expected

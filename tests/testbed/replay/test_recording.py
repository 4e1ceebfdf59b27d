"""A recording is the drive itself: the same bits from the file, and trackers get the same as from the live radar."""

import copy
import os
from contextlib import closing
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.stage import Phase
from sensors import find as find_radar
from sensors.origin import Origin
from sensors.scene import Ego, boxes_scene
from testbed.evaluation.tracking import jsonable
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.rows import Rows
from testbed.experiments.run import Run
from testbed.experiments.store import RECORDINGS, Store
from testbed.log import reader
from testbed.log.record import RoadGeometry
from testbed.planners import find as find_planner
from testbed.replay.recording import RecordedFrame, Recording, load, read_seconds, record, save
from testbed.replay.rescan import REPLAY, replay, rescan, write_log
from trackers.multi.road import RoadMap
from trackers.scan import Scan

TRACKERS = ("rm-feldmann", "htg-map")
DRIVES = (("articulated-turn", "surround"), ("stop-and-go", "nuscenes-like"), ("xia2020-lane", "front"))
DURATION, SEED = 1.0, 3


def watch(recording, tracker):
    """Keeps the rows of a tracker."""
    rows = Rows(Run(recording.scenario, SEED, tracker, loop="open"))
    rows.begin(recording.phases)
    return rows


def differences(a, b, where="."):
    """Paths at which two nested tuples differ in type, length, dtype, shape or any bit."""
    if isinstance(a, tuple):
        if type(a) is not type(b) or len(a) != len(b):
            return [where]
        names = getattr(a, "_fields", range(len(a)))
        return [d for x, y, n in zip(a, b, names, strict=True) for d in differences(x, y, f"{where}{n}.")]
    if isinstance(a, np.ndarray):
        same = isinstance(b, np.ndarray) and (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
        return [] if same else [where]
    return [] if type(a) is type(b) and (a == b or a != a) else [where]


def live(scenario, radar, observers):
    """The drive of a recording with trackers beside the truth."""
    planner = find_planner("truth")
    config = {"duration": DURATION}
    made = gym.make(
        f"testbed/{scenario}-v0", config=config, tracker="truth", also=list(TRACKERS), radar=radar, planner="truth"
    )
    with closing(made) as env:
        for observer in observers:
            env.attach(observer)
        env.reset(seed=SEED)
        done = False
        while not done:
            _, _, terminated, truncated, _ = env.step(planner.choose(env).action)
            done = terminated or truncated


@pytest.fixture(scope="module", params=DRIVES, ids=lambda drive: drive[0])
def drive(request, tmp_path_factory):
    """A recording, the same read back, and its file."""
    scenario, radar = request.param
    made = record(scenario, SEED, radar, DURATION)
    path = tmp_path_factory.mktemp("tape") / "drive.npz"
    save(made, path)
    return made, load(path, scenario, SEED, radar), path


def test_a_file_gives_back_every_bit(drive):
    made, back, _ = drive
    assert len(back.frames) == len(made.frames) > 10
    assert differences(made._replace(seconds=()), back._replace(seconds=())) == []
    assert back.seconds == made.seconds
    assert all(spent > 0 for spent in back.seconds.values())


def test_seconds_are_read_alone(drive):
    made, _, path = drive
    assert read_seconds(path) == made.seconds


def test_a_file_is_small_and_nothing_lies_beside_it(drive):
    made, _, path = drive
    assert path.stat().st_size < 10_000 * len(made.frames)  # 2 to 6 kB a frame
    assert list(path.parent.iterdir()) == [path]


def test_the_live_environment_shows_what_was_recorded_and_trackers_say_the_same(drive):
    _, back, _ = drive
    frames, of_live, of_replay, steps = [], [], [], []

    def keep(frame):
        frames.append(copy.deepcopy(RecordedFrame(frame.scene, frame.scan, frame.origin)))
        of_live.append(copy.deepcopy([frame.outputs[name] for name in TRACKERS]))

    def listen(frame):
        of_replay.append([frame.outputs[name] for name in TRACKERS])
        steps.append((frame.step, frame.action))

    rows = [[watch(back, name) for name in TRACKERS] for _ in range(2)]
    live(back.scenario, back.radar, [keep, *rows[0]])
    perception = replay(back, TRACKERS, [listen, *rows[1]])
    assert differences(tuple(frames), back.frames) == []
    for a, b in zip(of_live, of_replay, strict=True):
        assert [differences(tuple(x), tuple(y)) for x, y in zip(a, b, strict=True)] == [[]] * len(TRACKERS)
    for a, b in zip(*rows, strict=True):
        assert a.table().equals(b.table(), check_metadata=True)
        assert jsonable(a.evaluator.summary()) == jsonable(b.evaluator.summary())
        assert list(map(jsonable, a.evaluator.phase_rows())) == list(map(jsonable, b.evaluator.phase_rows()))
    assert perception.costs[TRACKERS[0]].scans == len(back.frames)
    assert steps == [(k, REPLAY) for k in range(len(back.frames))]


@pytest.fixture(scope="module")
def lane():
    """One vehicle, half a second."""
    return record("xia2020-lane", SEED, "front", 0.5)


def test_a_tracker_alone_says_what_it_says_among_others_and_the_recording_stays_as_it_is(lane):
    before = copy.deepcopy(lane.frames)
    rows = [watch(lane, TRACKERS[1]) for _ in range(2)]
    replay(lane, TRACKERS, rows[:1])
    replay(lane, TRACKERS[1:], rows[1:])
    assert rows[0].table().equals(rows[1].table())
    assert differences(lane.frames, before) == []


def test_another_radar_scans_the_recorded_scenes_with_the_generator_that_it_is_given(lane):
    seen, rng = [], np.random.default_rng(7)
    radar = find_radar("surround")
    rescan(lane, radar, np.random.default_rng(7), TRACKERS[:1], [seen.append])
    assert [frame.scene.time for frame in seen] == [kept.scene.time for kept in lane.frames]
    for frame in seen:
        assert differences(frame.scan, radar.scan(frame.scene, rng)[0]) == []


def test_the_same_seed_gives_the_same_drive_and_another_seed_another(lane):
    again, other = (record("xia2020-lane", seed, "front", 0.5) for seed in (SEED, SEED + 1))
    assert differences(lane.frames, again.frames) == []
    assert differences(lane.frames, other.frames)


def blind(frame):
    """The same frame without any detection."""
    return frame._replace(
        scan=frame.scan._replace(
            polar=np.zeros((0, 3)), mask=np.zeros(0, bool), pose=np.zeros((0, 3)), velocity=np.zeros((0, 2)),
            noise=np.zeros((0, 3)), sensor=np.zeros(0, int),
        ),
        origin=Origin.empty(len(frame.scene.objects.id)),
    )  # fmt: skip


def deserted(frame):
    """The same frame on an empty road."""
    scene = frame.scene
    none = boxes_scene(np.zeros((0, 3)), np.zeros((0, 2)))
    return blind(frame)._replace(
        scene=scene._replace(objects=none.objects, bodies=none.bodies), origin=Origin.empty(0)
    )  # fmt: skip


@pytest.mark.parametrize("empty", [blind, deserted])
@pytest.mark.parametrize("which", [slice(0, 3), slice(4, 6), slice(None)])
def test_empty_frames_come_back_and_are_tracked(lane, tmp_path, empty, which):
    frames = list(lane.frames)
    frames[which] = [empty(frame) for frame in frames[which]]
    made = lane._replace(frames=tuple(frames))
    save(made, tmp_path / "drive.npz")
    back = load(tmp_path / "drive.npz", made.scenario, made.seed, made.radar)
    assert differences(made.frames, back.frames) == []
    rows = watch(made, TRACKERS[0])
    replay(back, TRACKERS[:1], [rows])
    assert len(set(rows.table().column("time").to_pylist())) == len(frames)


@st.composite
def worlds(draw):
    """A few frames with scenes of any number of objects, with any number of detections, NaN and negative zeros."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    frames = []
    for k, (objects, detections, shared) in enumerate(
        draw(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4), st.booleans()), min_size=1, max_size=4))
    ):
        pose, size = rng.normal(size=(objects, 3)), rng.uniform(1, 5, (objects, 2))
        ego = Ego(rng.normal(size=3), rng.normal(size=2), float(rng.normal()), np.ones(2), rng.normal(size=(5, 2)))
        scene = boxes_scene(pose, size, ego=ego, time=k / 10)
        kinds = tuple(draw(st.lists(st.sampled_from(["car", "motorcycle", "ü"]), min_size=objects, max_size=objects)))
        corners = tuple(rng.normal(size=(draw(st.integers(3, 6)), 2)) for _ in range(objects))
        scene = scene._replace(
            objects=scene.objects._replace(kind=kinds),
            bodies=scene.bodies._replace(outline=corners),
            walls=rng.normal(size=(draw(st.integers(0, 2)), 2, 2)),
        )
        width = 1 if shared else detections
        polar = np.where(
            rng.random((detections, 3)) < 0.2, rng.choice([np.nan, -0.0]), rng.normal(size=(detections, 3))
        )
        scan = Scan(
            polar, rng.random(detections) < 0.8, rng.normal(size=(width, 3)), rng.normal(size=(width, 2)),
            np.full((width, 3), np.nan), np.zeros(width, int), rng.normal(size=6),
            draw(st.sampled_from([None, np.array([True, False])])),
        )  # fmt: skip
        whole = rng.integers(-1, 3, (4, detections))
        frames.append(RecordedFrame(scene, scan, Origin(*whole, rng.random(objects), rng.random(objects))))
    lines = tuple(rng.normal(size=(draw(st.integers(2, 4)), 2)) for _ in range(draw(st.integers(0, 2))))
    road = RoadMap(rng.normal(size=(3, 2)), rng.normal(size=(3, 2)), np.ones(3))
    drawn = RoadGeometry(lines, (), lines, (2.0,) * len(lines))
    phases = tuple(Phase(name, k, k + 0.1) for k, name in enumerate(draw(st.lists(st.sampled_from("ab"), max_size=2))))
    return Recording("made", seed, "front", tuple(frames), phases, road, drawn, {"simulation": 1.5, "sensing": 0.25})


@given(worlds())
def test_whatever_is_seen_comes_back(tmp_path_factory, world):
    path = tmp_path_factory.mktemp("made") / "drive.npz"
    save(world, path)
    back = load(path, world.scenario, world.seed, world.radar)
    assert differences(world._replace(seconds=(), phases=()), back._replace(seconds=(), phases=())) == []
    assert back.phases == world.phases
    assert back.seconds == world.seconds


@given(st.integers(0, 10**6), st.integers(1, 255))
def test_a_flipped_byte_is_harmless_or_refused_in_one_sentence(lane_bytes, place, flip):
    made, data, folder = lane_bytes
    damaged = bytearray(data)
    damaged[place % len(data)] ^= flip
    path = folder / "flipped.npz"
    path.write_bytes(damaged)
    try:
        back, refused = load(path, made.scenario, made.seed, made.radar), None
    except ValueError as error:
        back, refused = None, str(error)
    if refused is None:  # a time stamp in the archive, say
        assert differences(made._replace(seconds=()), back._replace(seconds=())) == []
    else:
        assert refused.startswith(f"the recording {path} is damaged (")
        assert refused.endswith("; delete it and it is made again")


@pytest.fixture(scope="module")
def lane_bytes(lane, tmp_path_factory):
    folder = tmp_path_factory.mktemp("damaged")
    made = lane._replace(frames=lane.frames[:4])
    save(made, folder / "whole.npz")
    return made, (folder / "whole.npz").read_bytes(), folder


def flipped(data):
    middle = len(data) // 2
    return data[:middle] + bytes(byte ^ 255 for byte in data[middle : middle + 64]) + data[middle + 64 :]


@pytest.mark.parametrize("damage", [lambda data: b"", lambda data: data[: len(data) // 2], lambda data: b"no", flipped])
def test_a_damaged_recording_is_made_again(lane_bytes, damage, tmp_path):
    _, data, _ = lane_bytes
    study = Comparison(("xia2020-lane",), TRACKERS[:1], (SEED,), Settings("front", duration=0.2), out=str(tmp_path))
    (run,) = study.work()
    store = Store(study)
    path = store.recording_path(run)
    path.parent.mkdir()
    path.write_bytes(damage(data))
    with pytest.raises(ValueError, match="is damaged"):
        load(path, run.scenario, run.seed, "front")
    store.recording(run)
    assert load(path, run.scenario, run.seed, "front").frames
    assert os.listdir(tmp_path / RECORDINGS) == [path.name]


def test_seconds_of_a_damaged_recording_are_refused_like_the_rest(tmp_path):
    (tmp_path / "drive.npz").write_bytes(b"")
    with pytest.raises(ValueError, match=r"the recording .* is damaged \(.*\); delete it and it is made again"):
        read_seconds(tmp_path / "drive.npz")


def test_a_recording_without_a_place_is_refused_in_one_sentence(lane, tmp_path):
    with pytest.raises(OSError, match=r"cannot write .*drive\.npz: No such file or directory"):
        save(lane, tmp_path / "missing" / "drive.npz")


def test_the_log_of_a_replay_shows_all_frames_and_trackers(lane, tmp_path):
    path = write_log(lane, TRACKERS, tmp_path)
    assert path == Path(tmp_path) / f"xia2020-lane_{'+'.join(TRACKERS)}_front_replay_seed{SEED}.rrd"
    assert len(reader.steps(path)) == len(lane.frames)

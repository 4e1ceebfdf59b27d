"""Rows of a run: frames computed by hand, agreement with evaluator and trackers, and damaged files."""

import json
import math
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.stage import Phase
from sensors.origin import CLUTTER, CONTOUR, Origin
from sensors.scene import boxes_scene
from testbed.environment.perception import Cost
from testbed.evaluation.tracking import ERRORS, Evaluator
from testbed.experiments.compare import Comparison
from testbed.experiments.episode import Played
from testbed.experiments.rows import COLUMNS, NAMES, SCHEMA, Rows
from testbed.experiments.run import Run
from testbed.experiments.store import ROWS, Store, read_meta
from testbed.experiments.study import Kept
from testbed.frame import Frame
from testbed.replay.recording import record
from testbed.replay.rescan import replay
from trackers.estimate import prior
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

TASK = Run("cut-in", 4, "rm-koch", loop="open")
CAR = (4.0, 2.0)
PHASES = (Phase("before", 0.0, 1.0), Phase("onset", 1.0, 2.0))
LANE = Run("articulated-turn", 2, "rm-feldmann", loop="open")


def watch(run, phases):
    """Keeps the rows of a run with these phases."""
    rows = Rows(run)
    rows.begin(phases)
    return rows


def tracks_at(positions, ids, existence=None, size=CAR):
    """Tracks of boxes that drive along x at 10 m/s, with covariances .25 and sizes +-.5 m, +-.25 m."""
    n = len(positions)
    pose = np.array([(*p, 0.0) for p in positions]).reshape(n, 3)
    estimate = prior(pose, np.tile([10.0, 0.0], (n, 1)), 0.0, np.tile(size, (n, 1)), 0.5, 0.5, 0.5, 0.1, 0.1)
    estimate = estimate._replace(size_std=np.tile([0.5, 0.25], (n, 1)))
    alive = np.ones(n) if existence is None else np.array(existence)
    return Tracks(np.array(ids, int), alive, np.ones(n, int), np.ones(n), alive > 0.5, None, estimate, 99)


def info_of(track, detections, nis, owner=()):
    n = len(track)
    return StepInfo(
        np.array(owner, int), np.array(track, int), np.ones(n), np.ones(n, bool), np.array(detections, int),
        np.zeros(n), np.array(nis, float), (),
    )  # fmt: skip


def scene_at(positions, ids, time=0.5, kinds=None):
    n = len(positions)
    pose = np.array([(*p, 0.0) for p in positions]).reshape(n, 3)
    scene = boxes_scene(pose, np.tile(CAR, (n, 1)), np.tile([10.0, 0.0], (n, 1)), time=time)
    return scene._replace(objects=scene.objects._replace(id=np.array(ids, int), kind=kinds or ("car",) * n))


def origin_of(expected, real=()):
    expected = np.array(expected, float)
    seen = np.full(len(expected), 0.75)
    empty, kind = Origin.empty(len(expected)), np.where(np.array(real, int) >= 0, CONTOUR, CLUTTER)
    return empty._replace(object=np.array(real, int), kind=kind, expected=expected, visible=seen)


def feed(rows, scene, origin, tracks, info):
    scan = Scan.from_xy(np.zeros((len(origin.object), 2)))
    rows(Frame(0, scene, scan, origin, {rows.run.source: (tracks, info)}, "IDLE", np.zeros((0, 2))))


def entries(rows):
    return rows.table().to_pylist()


@pytest.fixture
def one_frame():
    """Object 5 has track 3 half a metre off, object 7 has none, 8 counts as little as its track; track 6 is false."""
    rows = watch(TASK, PHASES)
    scene = scene_at([(30, 40), (0, 50), (60, 0)], [5, 7, 8], kinds=("van", "car", "bus"))
    tracks = tracks_at([(60, 0), (30.3, 40.4), (-3, 4), (90, 90)], [2, 3, 6, 1], [0.9, 1.0, 0.6, 0.4])
    info = info_of([6, 9, 3, 2], [0, 5, 2, 4], [math.nan, 8.0, 1.5, 7.0], [3, 2, 3, 2, 2, 2])
    feed(rows, scene, origin_of([2, 0.6, 0.1], real=[0, 0, 0, 0, 0, 0]), tracks, info)
    return rows


def test_a_pair_has_its_own_errors_and_the_innovation_of_its_track(one_frame):
    pair = entries(one_frame)[0]
    wanted = {
        "scenario": "cut-in", "tracker": "rm-koch", "seed": 4, "time": 0.5, "phase": "before", "status": "pair",
        "object": 5, "kind": "van", "track": 3, "range": 50.0, "visible": 0.75, "expected": 2.0, "detections": 2,
        "gospa2": 0.25, "gwd": 0.5, "gwd2": 0.25, "position": 0.5, "velocity": 0.0, "heading_deg": 0.0, "length": 0.0,
        "width": 0.0, "box_iou": 3.7 * 1.6 / (16 - 3.7 * 1.6), "contour_iou": 3.7 * 1.6 / (16 - 3.7 * 1.6),
        "nees_position": 1.0, "nees_velocity": 0.0, "nees_heading": 0.0, "nees_length": 0.0, "nees_width": 0.0,
        "length_std": 0.5, "width_std": 0.25, "nis": 1.5, "age": 0.0,
        "bearing": 180 - math.degrees(math.atan2(40, 30)), "ends": 1,  # its detections lie at the origin, behind it
    }  # fmt: skip
    close = {k: v if isinstance(v, str) else pytest.approx(v, rel=1e-5, abs=1e-6) for k, v in wanted.items()}
    assert {name: pair[name] for name in wanted} == close
    assert set(NAMES) - set(wanted) <= set(ERRORS), "a column that is no metric of a pair"


def test_missed_and_false_have_half_a_cut_off_and_no_errors(one_frame):
    _, missed, false = entries(one_frame)
    empty = {*ERRORS}
    assert {k: v for k, v in missed.items() if v is not None} == {
        "scenario": "cut-in", "tracker": "rm-koch", "seed": 4, "time": 0.5, "phase": "before", "status": "missed",
        "object": 7, "kind": "car", "range": 50.0, "visible": 0.75, "expected": pytest.approx(0.6), "gospa2": 12.5,
        "bearing": pytest.approx(90.0), "age": 0.0, "ends": 0,
    }  # fmt: skip
    assert {k: v for k, v in false.items() if v is not None} == {
        "scenario": "cut-in", "tracker": "rm-koch", "seed": 4, "time": 0.5, "phase": "before", "status": "false",
        "track": 6, "range": 5.0, "detections": 0, "gospa2": 12.5, "length_std": 0.5, "width_std": 0.25,
    }  # fmt: skip
    assert all(missed[name] is None for name in empty | {"track", "detections", "nis", "length_std"})


def test_neither_uncounted_objects_nor_unreported_tracks_have_rows(one_frame):
    found = entries(one_frame)
    assert [row["status"] for row in found] == ["pair", "missed", "false"]
    assert {row["object"] for row in found} == {5, 7, None}  # 8 is not expected to be detected
    assert {row["track"] for row in found} == {3, None, 6}  # 2 is on it and costs nothing, 1 is not reported


def test_a_frame_without_anything_to_say_has_a_row():
    rows = watch(TASK, PHASES)
    feed(rows, scene_at([(60, 0)], [8]), origin_of([0.1]), tracks_at([(60, 0)], [2]), info_of([2], [1], [1.0]))
    feed(rows, scene_at([], [], 1.5), origin_of([]), tracks_at([], []), info_of([], [], []))
    found = entries(rows)
    assert [(r["time"], r["status"], r["phase"], r["gospa2"]) for r in found] == [
        (0.5, "empty", "before", 0.0),
        (1.5, "empty", "onset", 0.0),
    ]
    assert all(row[name] is None for row in found for name in NAMES[6:] if name != "gospa2")


def test_a_track_born_at_this_frame_has_no_innovation_yet():
    rows = Rows(TASK)
    feed(rows, scene_at([(20, 0)], [1]), origin_of([3]), tracks_at([(20, 0)], [4]), info_of([], [], []))
    (pair,) = entries(rows)
    assert (pair["status"], pair["track"], pair["nis"], pair["detections"]) == ("pair", 4, None, None)


def test_a_frame_belongs_to_the_phase_that_it_begins_and_to_between_outside_of_all():
    rows = watch(TASK, PHASES)
    for time in (0.0, 0.999, 1.0, 2.0):
        feed(rows, scene_at([], [], time), origin_of([]), tracks_at([], []), info_of([], [], []))
    assert rows.table().column("phase").to_pylist() == ["before", "before", "onset", "between"]
    assert [(s["phase"], s["scans"]) for s in kept(rows).spans] == [("all", 4), ("before", 2), ("onset", 1)]


def test_a_run_without_a_frame_is_an_empty_table():
    table = Rows(TASK).table()
    assert table.num_rows == 0
    assert table.schema.equals(SCHEMA)


@given(st.integers(0, 10**6), st.integers(0, 5), st.integers(0, 5))
def test_rows_of_a_frame_add_up_to_its_gospa(seed, objects, tracks):
    rng = np.random.default_rng(seed)
    rows, evaluator = watch(TASK, PHASES), Evaluator(TASK.source, PHASES)
    for k in range(3):
        scene = scene_at(rng.uniform(0, 15, (objects, 2)), range(objects), k / 2)
        origin = origin_of(rng.uniform(0, 1.2, objects))
        heard = tracks_at(rng.uniform(0, 15, (tracks, 2)), range(10, 10 + tracks), rng.uniform(0.3, 1, tracks))
        feed(rows, scene, origin, heard, info_of(range(10, 10 + tracks), [1] * tracks, rng.chisquare(2, tracks)))
        score = evaluator.step(k / 2, scene, origin, heard)
        mine = [row for row in entries(rows) if row["time"] == k / 2]
        status = [row["status"] for row in mine]
        assert sum(row["gospa2"] for row in mine) == pytest.approx(score.mean["gospa"] ** 2, rel=1e-5)
        assert status.count("missed") == score.mean["unassigned"]
        assert status.count("false") == score.mean["ghosts"]
        assert status.count("pair") + status.count("missed") == score.mean["objects"]


@pytest.fixture(scope="module")
def drive():
    """A short drive with its rows, and every frame of it."""
    recording = record(LANE.scenario, LANE.seed, "surround", 2.0)
    rows, frames = watch(LANE, recording.phases), []
    replay(recording, (LANE.source,), [rows, frames.append])
    return rows, frames


def test_every_frame_of_a_drive_has_rows_that_agree_with_scene_tracks_and_step(drive):
    rows, frames = drive
    found = entries(rows)
    assert sorted({row["time"] for row in found}) == [frame.time for frame in frames]
    assert {"pair", "missed"} <= {row["status"] for row in found}
    frame_at = {frame.time: frame for frame in frames}
    for row in found:
        if row["status"] == "pair":
            scene, origin = frame_at[row["time"]].scene, frame_at[row["time"]].origin
            tracks, info = frame_at[row["time"]].outputs[LANE.source]
            n, k = scene.objects.id.tolist().index(row["object"]), tracks.id.tolist().index(row["track"])
            estimate = tracks.estimate
            off = estimate.pose[k, :2] - scene.objects.pose[n, :2]
            assert row["position"] == pytest.approx(np.hypot(*off), rel=1e-5)
            assert row["nees_position"] == pytest.approx(off @ np.linalg.solve(estimate.cov[k, :2, :2], off), rel=1e-5)
            assert row["length"] == pytest.approx(estimate.size[k, 0] - scene.objects.size[n, 0], rel=1e-5, abs=1e-6)
            assert row["expected"] == pytest.approx(origin.expected[n], rel=1e-6)
            if row["track"] in info.track:
                step = info.track.tolist().index(row["track"])
                nis = info.nis[step]
                assert row["detections"] == info.detections[step] == (info.owner == row["track"]).sum()
                assert row["nis"] == (None if np.isnan(nis) else pytest.approx(nis, rel=1e-5))


def test_summaries_follow_from_the_rows(drive):
    rows, _ = drive
    table = rows.table().to_pandas()
    whole = kept(rows).spans[0]
    pairs = table[table["status"] == "pair"]
    assert whole["phase"] == "all"
    assert whole["gospa"] == pytest.approx(np.sqrt(table.groupby("time")["gospa2"].sum()).mean(), rel=1e-5)
    assert whole["rmse_position"] == pytest.approx(np.sqrt((pairs["position"] ** 2).mean()), rel=1e-5)
    assert whole["nees_position"] == pytest.approx(pairs["nees_position"].mean(), rel=1e-5)
    missed = (table["status"] == "missed").sum()
    assert whole["missed_percent"] == pytest.approx(100 * missed / (missed + len(pairs)))


def kept(rows):
    """What a watch keeps of a run, whose tracker took no time."""
    return rows.kept(Played((), {rows.run.source: Cost()}, {"tracking": 1.0}, 0.0, None))


def stored(rows, folder):
    """A folder that holds the run."""
    store = Store(Comparison((LANE.scenario,), (LANE.source,), (LANE.seed,), out=str(folder)))
    (folder / ROWS).mkdir(parents=True, exist_ok=True)
    store.write(LANE, kept(rows)._replace(seconds={"tracking": 1.0}))
    return store


@pytest.fixture
def store(drive, tmp_path):
    return stored(drive[0], tmp_path)


@pytest.fixture
def part(store):
    return store.path(LANE)


def test_a_file_holds_the_rows_and_what_is_to_be_known(store, part, drive):
    rows, _ = drive
    store.verify(LANE)
    assert pq.read_table(part).equals(rows.table())
    meta = read_meta(part, SCHEMA)
    assert meta["spans"] == kept(rows).spans
    assert meta["rows"] == rows.table().num_rows
    assert set(meta["seconds"]) == {"tracking", "writing"}
    assert list(part.parent.iterdir()) == [part]


def test_every_column_has_its_unit_and_a_note_in_the_file(part):
    schema = pq.read_schema(part)
    assert tuple(schema.names) == NAMES
    for field, column in zip(schema, COLUMNS, strict=True):
        assert field.metadata == {b"unit": column.unit.encode(), b"note": column.note.encode()}
        assert column.note
        assert bool(column.unit) == (column.name not in ("scenario", "tracker", "phase", "status", "kind"))


def test_pandas_reads_a_file(part, drive):
    import pandas as pd

    frame = pd.read_parquet(part)
    assert list(frame) == list(NAMES)
    assert len(frame) == drive[0].table().num_rows
    assert frame["status"].isin(["pair", "missed", "false", "empty"]).all()


def test_polars_reads_a_file(part, drive):
    polars = pytest.importorskip("polars")
    frame = polars.read_parquet(part)
    assert frame.columns == list(NAMES)
    assert frame.height == drive[0].table().num_rows
    assert frame["gospa2"].sum() == pytest.approx(sum(row["gospa2"] for row in entries(drive[0])), rel=1e-4)


@given(place=st.integers(0, 10**6), flip=st.integers(1, 255))
def test_a_flipped_byte_is_harmless_or_refused_in_one_sentence(drive, whole_part, place, flip):
    data, meta, store = whole_part
    damaged = bytearray(data)
    damaged[place % len(data)] ^= flip
    path = store.path(LANE)
    path.write_bytes(damaged)
    try:
        store.verify(LANE)
        refused = None
    except ValueError as error:
        refused = str(error)
    if refused is None:  # the name of the writer, or a length that nobody asks for
        assert store.meta(LANE) == meta
        assert pq.read_table(path).equals(drive[0].table())
    else:
        assert refused.startswith(str(path))
        assert "\n" not in refused


@pytest.fixture(scope="module")
def whole_part(drive, tmp_path_factory):
    store = stored(drive[0], tmp_path_factory.mktemp("damaged"))
    return store.path(LANE).read_bytes(), store.meta(LANE), store


def of_other_columns(path):
    known = {"layout": 1, "rows": 1, "run": LANE.key}
    pq.write_table(pa.table({"a": [1]}).replace_schema_metadata({b"testbed": json.dumps(known).encode()}), path)


@pytest.mark.parametrize(
    ("damage", "refused"),
    [
        (lambda path: path.write_bytes(b""), "is damaged"),
        (lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]), "is damaged"),
        (lambda path: path.write_bytes(b"PAR1" + path.read_bytes()[4:-4] + b"ABCD"), "is damaged"),
        (of_other_columns, "is damaged"),
    ],
)
def test_damage_is_reported_with_the_name_of_the_file(store, part, damage, refused):
    damage(part)
    with pytest.raises(ValueError, match=rf"{LANE.name}\.parquet {refused}"):
        store.verify(LANE)


def test_rows_of_another_run_are_refused(store, part):
    other = replace(LANE, seed=LANE.seed + 1)
    part.rename(store.path(other))
    with pytest.raises(ValueError, match=r"holds the run \{'scenario': 'articulated-turn', 'seed': 2, "):
        store.verify(other)


def test_a_missing_file_is_not_a_damaged_one(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_meta(tmp_path / "none.parquet", SCHEMA)


def test_numbers_that_json_does_not_know_are_refused_and_nothing_is_left(drive, store, part):
    part.unlink()
    with pytest.raises(ValueError, match="JSON"):
        store.write(LANE, Kept(drive[0].table(), [{"gospa": math.nan}]))
    assert list(part.parent.iterdir()) == []


def test_rows_without_a_place_are_refused_in_one_sentence(drive, tmp_path):
    store = Store(Comparison(("cut-in",), ("rm-koch",), (0,), out=str(tmp_path / "missing")))
    with pytest.raises(OSError, match=r"cannot write .*\.parquet: "):
        store.write(LANE, Kept(drive[0].table(), []))

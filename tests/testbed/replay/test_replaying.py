"""Replays of small recordings: sensors of two rates, empty scans, no range rate, no truth, windows, and the files."""

import json
import os
import signal

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.log import reader
from testbed.replay.reading import read
from testbed.replay.replaying import ReplayConfig, prepare, replay
from testbed.replay.tracks_file import SCHEMA
from testbed.replay.truth import parse_contour
from tests.testbed.replay.made_tables import CARS, EGO_SPEED, made, save
from trackers import TRACKERS

TRACKER = "rm-koch"


def run(tables, folder, trackers=(TRACKER,), **options):
    config = ReplayConfig(str(save(tables, folder / "drive")), trackers, out=str(folder), **{"log": "off"} | options)
    return replay(config, prepare(config))


def tracks_of(done, tracker=TRACKER):
    table = pq.read_table(done.tracks).to_pandas()
    return table[table.tracker == tracker]


def test_two_sensors_of_different_rates_share_the_scans_that_they_make_together(tmp_path):
    tables = made(1.0, rates=(10.0, 4.0))
    frames = read(save(tables, tmp_path / "drive")).frames
    together = [tuple(f.scan.delivered.tolist()) for f in frames]
    assert together.count((True, True)) == 3  # at 0, 0.5 and 1 s
    assert together.count((False, True)) == 2
    assert together.count((True, False)) == 8
    done = run(tables, tmp_path)
    assert done.result["trackers"][TRACKER]["missed_percent"] == 0
    assert done.result["trackers"][TRACKER]["switches"] == 0


def test_an_empty_scan_is_evidence_of_absence_and_none_at_all_is_not(tmp_path):
    """From 0.55 s on nothing is detected, by sensors that deliver empty scans, or by none but one that looks back."""
    tables = made(1.5)
    tables["sensors"] = {name: [*values, values[0]] for name, values in tables["sensors"].items()}
    tables["sensors"]["name"][2], tables["sensors"]["yaw"][2] = "rear", np.pi
    rows = [k for k, time in enumerate(tables["detections"]["time"]) if time < 0.55]
    tables["detections"] = {name: [values[k] for k in rows] for name, values in tables["detections"].items()}
    last = {}
    for case, names in (("empty", ("left", "right", "rear")), ("out", ("rear",))):
        pairs = [(time, name) for time in sorted(set(tables["ego"]["time"])) for name in names]
        scans = {"time": [time for time, _ in pairs], "sensor": [name for _, name in pairs]}
        last[case] = tracks_of(run(tables | {"scans": scans}, tmp_path / case)).time.max()
    assert last["empty"] < 1.2
    assert last["out"] == 1.5


@pytest.mark.parametrize("lanes", [True, False])
def test_contours_without_range_rates_are_tracked(lanes, tmp_path):
    tables = made(1.5)
    del tables["detections"]["range_rate"], tables["sensors"]["sigma_rate"]
    if not lanes:
        del tables["lanes"]
    done = run(tables, tmp_path)
    last = tracks_of(done)[lambda t: t.time == 1.5].sort_values("x")
    assert len(last) == len(CARS)
    assert last.vx.tolist() == pytest.approx([CARS["b"][2], CARS["a"][2]], abs=2.5)


@pytest.mark.slow
@pytest.mark.parametrize("tracker", TRACKERS)
def test_every_tracker_follows_contours_without_range_rates(tracker, tmp_path):
    tables = made(1.5)
    del tables["detections"]["range_rate"]
    row = run(tables, tmp_path, (tracker,)).result["trackers"][tracker]
    assert row["missed_percent"] < 5
    assert row["objects_confirmed"] == len(CARS)


def test_places_in_x_and_y_are_those_in_range_and_azimuth(tmp_path):
    polar, plain = made(0.3), made(0.3)
    r, a = (np.array(plain["detections"].pop(name)) for name in ("range", "azimuth"))
    plain["detections"] |= {"x": (r * np.cos(a)).tolist(), "y": (r * np.sin(a)).tolist()}
    one, other = (read(save(t, tmp_path / n)) for t, n in ((polar, "polar"), (plain, "plain")))
    for f, g in zip(one.frames, other.frames, strict=True):
        assert g.scan.polar == pytest.approx(f.scan.polar, abs=1e-9)


def test_ego_and_truth_are_interpolated_between_their_rows(tmp_path):
    tables = made(1.0)
    for name, every in (("ego", 2), ("truth", 10)):
        kept = [k for k, t in enumerate(tables[name]["time"]) if round(t * 10) % every == 0]
        tables[name] = {column: [values[k] for k in kept] for column, values in tables[name].items()}
    tables["truth"]["heading"] = [3.1, 3.1, -3.1, -3.1]  # over the seam: the shorter way round
    frame = read(save(tables, tmp_path)).frames[3]
    assert frame.scene.ego.pose == pytest.approx([0.3 * EGO_SPEED, 0.0, 0.0])
    assert frame.scene.ego.velocity == pytest.approx([EGO_SPEED, 0.0])
    objects = frame.scene.objects
    assert objects.id.tolist() == [1, 2]  # the names a and b, in the order of their rows
    assert objects.pose[0] == pytest.approx([25 + 22 * 0.3, 0.0, 3.1 + 0.3 * (2 * np.pi - 6.2)])


def test_without_ids_detections_belong_to_the_box_around_them(tmp_path):
    tables = made(0.2)
    first = {name: values[0] for name, values in tables["detections"].items()}
    for name, value in first.items():
        tables["detections"][name].insert(0, 60.0 if name == "range" else value)  # far behind all cars
    origin = read(save(tables, tmp_path)).frames[0].origin
    assert origin.object[0] == -1
    assert set(origin.object[1:].tolist()) == {0, 1}
    assert origin.expected.tolist() == [24.0, 24.0]


def test_scans_outside_the_truth_are_tracked_but_not_scored(tmp_path):
    tables = made(1.5)
    kept = [k for k, t in enumerate(tables["truth"]["time"]) if 0.5 <= t <= 1.0]
    tables["truth"] = {name: [values[k] for k in kept] for name, values in tables["truth"].items()}
    for level in ("off", "metrics"):
        done = run(tables, tmp_path, log=level)
        assert done.result["trackers"][TRACKER]["scans"] == 6
        assert done.result["trackers"][TRACKER]["false_per_scan"] == 0
    assert tracks_of(done).time.nunique() == 16


def test_without_truth_there_are_tracks_and_a_log_but_no_measures(tmp_path):
    tables = made(0.5)
    del tables["truth"]
    done = run(tables, tmp_path, (TRACKER, "rm-surface"), log="full")
    assert set(json.loads(done.json.read_text())) == {"run", "interrupted", "timing", "made"}
    assert done.lives["rm-surface"]["tracks_reported"] == 2
    assert reader.complete(done.rrd)
    with pytest.raises(ValueError, match=r"tracker truth needs a table truth"):
        run(tables, tmp_path, ("truth",))


def test_the_tracks_of_all_trackers_are_in_one_table_with_units(tmp_path):
    done = run(made(0.5), tmp_path, (TRACKER, "pmht-spline"))
    table = pq.read_table(done.tracks)
    assert table.schema.equals(SCHEMA)
    assert table.schema.field("cov_x_vx").metadata == {b"unit": b"m^2/s"}
    rows = table.to_pandas()
    assert set(rows.tracker) == {TRACKER, "pmht-spline"}
    contours = rows[rows.tracker == "pmht-spline"].contour
    assert all(len(parse_contour(text)[0]) > 10 for text in contours)
    assert rows[rows.tracker == TRACKER].contour.isna().all()
    assert (rows.existence > 0.5).all()


def test_a_window_counts_from_the_first_scan_and_keeps_the_times_of_the_tables(tmp_path):
    tables = made(1.0)
    for name in ("detections", "ego", "truth"):
        tables[name]["time"] = [1.6e9 + t for t in tables[name]["time"]]
    done = run(tables, tmp_path, start=0.25, end=0.75)
    assert "from0.25s_to0.75s" in done.tracks.name
    times = tracks_of(done).time
    assert times.min() - 1.6e9 == pytest.approx(0.3, abs=1e-6)
    assert times.max() - 1.6e9 == pytest.approx(0.7, abs=1e-6)


def test_an_interrupted_replay_keeps_what_it_has(tmp_path):
    config = ReplayConfig(str(save(made(1.0), tmp_path / "drive")), (TRACKER,), out=str(tmp_path))

    def stop(done, total):
        if done == 4:
            os.kill(os.getpid(), signal.SIGINT)

    done = replay(config, prepare(config), stop)
    assert done.exit_status == 128 + signal.SIGINT
    assert done.result["interrupted"]
    assert tracks_of(done).time.max() == 0.3
    assert reader.complete(done.rrd)


def test_a_full_disk_costs_the_tracks_and_not_the_results(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    with pytest.warns(UserWarning, match="cannot write"):
        done = run(made(0.3), tmp_path)
    assert done.exit_status == 2
    assert done.tracks is None
    assert "No space left" in done.lost[0]
    assert done.json.is_file()
    assert not list(tmp_path.glob("*.parquet")) + list(tmp_path.glob(".*part"))


def test_the_commands_show_what_there_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made_now = CliRunner().invoke(app, ["record", "cut-in", "--duration", "0.4", "--out", "d", "--format", "csv"])
    assert made_now.exit_code == 0, made_now.output
    done = CliRunner().invoke(app, ["replay", "d", "--tracker", TRACKER, "--log", "off", "--to", "0.2"])
    assert done.exit_code == 0, done.output
    assert "d: tracks against the truth" in done.output
    assert "longest life [s]" in done.output
    wrong = CliRunner().invoke(app, ["record", "cut-in", "--out", "d", "--format", "parquet"])
    assert wrong.exit_code == 2
    assert "out: d has a table" in wrong.stderr
    assert CliRunner().invoke(app, ["replay", "nowhere"]).exit_code == 2


def test_a_default_of_a_depth_profile_may_depend_on_what_the_sheet_says(tmp_path):
    """Where detections of the inside thin out, depths do not lie along the line of sight unless the sheet says so."""
    tables = made(0.2)
    tables["sensors"] |= {"profile_inside_depth": [1.3, None]}
    assert [m.profile.slant for m in read(save(tables, tmp_path / "few")).sensors.models] == [0.0, 1.0]
    tables["sensors"] |= {"profile_slant": [0.7, None]}
    assert [m.profile.slant for m in read(save(tables, tmp_path / "more")).sensors.models] == [0.7, 1.0]

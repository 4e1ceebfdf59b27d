"""Tracks from files: right ones are perfect, exported ones come back to the last bit, wrong ones end in a sentence."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.log import reader
from testbed.replay.pairing import Files
from testbed.replay.reading import read
from testbed.replay.recorded_tracks import Matching, TracksSource, columns_of, recorded_tracks
from testbed.replay.replaying import ReplayConfig, prepare, replay
from tests.testbed.replay.made_tracks import recording, tracks, written

STDS = {"length_std": 0.5, "width_std": 0.5, "heading_std": 0.1}
COVS = {f"cov_{a}_{b}": float(a == b) for a, b in zip("xxxxyyy", ("x", "y", "vx", "vy", "y", "vx", "vy"), strict=True)}
COVS |= {"cov_vx_vx": 1.0, "cov_vx_vy": 0.0, "cov_vy_vy": 1.0}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return recording(tmp_path_factory.mktemp("recorded") / "drive")


def scored(drive, out, table, level="off", **source):
    file = written(table, out / "mine.csv")
    config = ReplayConfig(str(drive), (), out=str(out), log=level, tracks=(("mine", TracksSource(file, **source)),))
    return replay(config, prepare(config))


def row_of(done):
    return done.result["trackers"]["mine"]


def test_right_tracks_have_no_error_and_no_nees_without_covariances(drive, tmp_path):
    done = scored(drive, tmp_path, tracks(), "full")
    row = row_of(done)
    assert row["gospa"] == pytest.approx(0.0, abs=1e-6)
    assert (row["missed_percent"], row["false_per_scan"], row["hota"]) == (0.0, 0.0, 1.0)
    assert [key for key in row if "nees" in key and row[key] is not None] == []
    assert row["rmse_velocity"] == pytest.approx(0.0, abs=1e-9)
    assert row["tracks_clutter"] == 0
    assert done.result["timing"]["trackers"]["mine"]["ms_per_scan"] is None
    assert reader.complete(done.rrd)
    assert done.exit_status == 0


def test_nees_is_over_the_rows_that_have_a_covariance(drive, tmp_path):
    columns = tracks(**COVS, **STDS)
    columns["x"] = [x + 1.0 for x in columns["x"]]
    columns["heading_std"] = [None] * len(columns["x"])
    columns["cov_x_x"][::2] = [None] * len(columns["x"][::2])
    columns["cov_y_y"][1] = 4.0
    row = row_of(scored(drive, tmp_path, columns))
    assert row["nees_position"] == pytest.approx(1.0)  # 1 m of error with 1 m of deviation, where it is known
    assert row["nees_low"] > 0
    assert row["nees_length"] == pytest.approx(0.0, abs=1e-12)
    assert row["nees_heading"] is None


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_exported_tracks_are_scored_as_the_tracker_is(drive, format, tmp_path):
    config = ReplayConfig(
        str(drive), ("rm-koch", "pmht-spline", "imm-htg"), out=str(tmp_path), log="off", format=format
    )
    done = replay(config, prepare(config))
    assert done.tracks.suffix == f".{format}"
    again = ReplayConfig(str(drive), (), out=str(tmp_path), log="off", tracks=(("back", TracksSource(done.tracks)),))
    back = replay(again, prepare(again)).result["trackers"]
    for name, row in json.loads(json.dumps(done.result["trackers"])).items():
        assert back[f"back/{name}"] == row | {"tracker": f"back/{name}"}


def test_rows_between_scans_are_left_out_matched_or_interpolated(drive, tmp_path):
    recorded = read(drive)
    late = tracks()
    late["time"] = [t + 0.02 for t in late["time"]]
    late["time"][0] -= 0.02
    file = written(late, tmp_path / "late.csv")

    def found(**matching):
        (one,) = recorded_tracks(TracksSource(file, matching=Matching(**matching)), "late", recorded)
        return one, [len(one.steps[frame.scene.time][0].id) for frame in recorded.frames]

    few, count = found()
    assert sum(count) == 1
    assert few.said == "21 of 22 rows are of no scan and left out, up to 0.02 s off"
    assert found(tolerance=0.03)[1] == [2] * 11
    one, count = found(interpolate=True)
    assert count == [1, *[2] * 10]
    for frame in recorded.frames[1:]:
        pose = one.steps[frame.scene.time][0].estimate.pose[1]  # of b, which is 0.02 s late in all rows
        assert pose == pytest.approx([15 + 19 * (frame.scene.time - 0.02), 4.0, 0.0])


def test_of_two_rows_at_a_scan_the_nearer_one_counts(drive, tmp_path):
    near = tracks(0.0)
    table = {name: [value for value in values for _ in range(3)] for name, values in near.items()}
    table["time"] = [0.008, 0.002, 0.004] * 2
    table["x"] = [500.0, *table["x"][1:2], 500.0] * 2
    (one,) = recorded_tracks(TracksSource(written(table, tmp_path / "t.csv")), "t", read(drive))
    assert one.steps[0.0][0].estimate.pose[:, 0].tolist() == [25.0, 25.0]


def test_an_angle_is_interpolated_the_shorter_way(drive, tmp_path):
    columns = {name: values[::2] for name, values in tracks().items()}  # of a alone
    columns = {name: values[::2] for name, values in columns.items()}
    columns |= {"heading": [3.1, -3.1, 3.1, -3.1, 3.1, -3.1], "vx": [0.0] * 6}
    source = TracksSource(written(columns, tmp_path / "a.csv"), matching=Matching(interpolate=True))
    (one,) = recorded_tracks(source, "a", recorded := read(drive))
    assert one.steps[recorded.frames[1].scene.time][0].estimate.pose[0, 2] == pytest.approx(np.pi)


def test_other_names_of_columns_are_read(drive, tmp_path):
    columns = tracks()
    columns["nr"], columns["pos"] = columns.pop("id"), columns.pop("x")
    toml = tmp_path / "names.toml"
    toml.write_text('id = "nr"\nx = "pos"\n')
    for text in ("id=nr,x=pos", str(toml)):
        assert row_of(scored(drive, tmp_path, columns, columns=columns_of(text)))["missed_percent"] == 0


def change(column, row, value):
    def changed(columns):
        columns[column][row] = value

    return changed


def scaled(column, factor):
    return lambda columns: columns.update({column: [factor * value for value in columns[column]]})


WRONG = {
    "no such column": (lambda c: c.pop("vx"), r"mine\.csv has no column vx, velocity of the centre.*--columns vx=NAME"),
    "another name": (lambda c: c.update(psi=c.pop("heading")), r"no column heading.*rename psi, or give --columns"),
    "misspelt": (lambda c: c.update(lenght=c.pop("length")), r"column lenght; did you mean length\? .*--columns"),
    "twice": (change("id", 1, "track a"), r"column id, row 2: 'track a' is there twice at 0\.0 s; keep one"),
    "nan": (change("y", 2, "nan"), r"column y, row 3: a number is due, got none"),
    "inf": (change("y", 2, "inf"), r"column y, row 3: got inf; give a finite number"),
    "text": (change("vx", 0, "fast"), r"column vx, row 1: a number is due, got 'fast'"),
    "no id": (change("id", 3, ""), r"column id, row 4: it is empty"),
    "degrees": (change("heading", 5, 90.0), r"column heading, row 6: must be within .* got 90; angles are in radians"),
    "small degrees": (
        lambda c: c.update(heading=[2.0] * 22, vy=[v * np.tan(np.radians(2.0)) for v in c["vx"]]),
        r"column heading, row \d+: 2 fits the velocity in degrees only; angles are in radians",
    ),
    "millimetres": (scaled("length", 1000), r"column length, row 1: must be within 0\.1 to 100 m"),
    "another clock": (
        lambda c: c.update(time=[t + 1.6e9 for t in c["time"]]),
        r"from 1600000000\.00 s to 1600000001\.00 s, scans from .* s to 1\.00 s; no row is at a scan.*--inter",
    ),
    "no covariance": (lambda c: c.update(**{k: [-1.0] * 22 for k in COVS}), r"cov_x_x, row 1: .* an eigenvalue"),
    "no deviation": (lambda c: c.update(width_std=[0.0] * 22), r"width_std, row 1: it is 0; leave it empty"),
    "an outline": (lambda c: c.update(contour=["1 2"] * 22), r"contour, row 1: '1 2' is no outline"),
    "half an outline": (lambda c: c.update(contour=["0 0;1 0;0 1", ""] * 11), r"contour, row 2: '' is no outline"),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("interpolate", [False, True])
def test_a_wrong_file_ends_in_one_sentence(case, interpolate, drive, tmp_path):
    columns = tracks()
    WRONG[case][0](columns)
    with pytest.raises(ValueError, match=WRONG[case][1]) as raised:
        scored(drive, tmp_path, columns, matching=Matching(interpolate=interpolate))
    assert "\n" not in str(raised.value)


def test_rows_in_any_order_are_the_same_tracks(drive, tmp_path):
    columns = tracks()
    order = np.random.default_rng(0).permutation(len(columns["x"]))
    mixed = {name: [values[k] for k in order] for name, values in columns.items()}
    rows = [row_of(scored(drive, tmp_path / name, c)) for name, c in (("a", columns), ("b", mixed))]
    assert rows[0] == rows[1]


def test_a_table_without_rows_misses_all(drive, tmp_path):
    row = row_of(scored(drive, tmp_path, {name: [] for name in tracks()}))
    assert (row["missed_percent"], row["tracks_reported"]) == (100.0, 0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("x", "is not like x=pos_x"), ("z=a", "no column 'z'; choose of"), ("x=a,y=a", "two columns have one name"),
     ("nowhere.toml", "is not like"), ("x=", "must be the name of a column")],
)  # fmt: skip
def test_wrong_names_of_columns_are_refused(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        columns_of(text)


@pytest.mark.parametrize("name", ["", " ", "a\nb", "\udcff", "a" * 61])
def test_wrong_names_of_tracks_are_refused(name, drive, tmp_path):
    with pytest.raises(ValueError, match=r"is no name; give one of letters"):
        recorded_tracks(TracksSource(written(tracks(), tmp_path / "t.csv")), name, read(drive))


@pytest.fixture
def several(tmp_path):
    drives = [recording(tmp_path / "drives" / name, 0.3) for name in ("a", "a_b", "c")]
    return tmp_path, drives


def test_files_belong_to_recordings_by_name_folder_or_time(several):
    folder, (a, a_b, c) = several
    files = [written(tracks(0.2), folder / "t" / name) for name in ("a.csv", "a_b-mine.csv")]
    files.append(written(tracks(0.2), folder / "t" / "c" / "mine.csv"))
    found = Files.of([*map(str, files[:2]), str(folder / "t" / "*" / "*.csv")], [str(folder / "drives")])
    assert [[source.path.stem for source in found.tracks[d]] for d in (a, a_b, c)] == [["a"], ["a_b-mine"], ["mine"]]
    stray = Files.of([str(files[0]), str(c)], [str(a)])  # as a shell expands `--against drives/*`
    assert stray.recordings == [a, c]
    with pytest.raises(ValueError, match=r"of which recording is .*other\.csv\? its times fit 3 recordings"):
        Files.of([str(written(tracks(0.2), folder / "other.csv"))], [str(folder / "drives")])
    with pytest.raises(ValueError, match=r"are of one recording; compare them by --tracks"):
        Files.of([str(files[0]), str(written(tracks(0.2), folder / "a.2.csv"))], [str(a), str(c)]).each  # noqa: B018
    with pytest.raises(ValueError, match=r"is no recording and has none"):
        Files.of([str(files[0])], [str(folder / "nowhere")])


def test_a_folder_of_recordings_is_replayed_one_after_the_other(several):
    folder, drives = several
    call = ["replay", str(folder / "drives"), "--tracker", "rm-koch", "--log", "off", "--format", "csv", "--out"]
    assert CliRunner().invoke(app, [*call, str(folder / "out")]).exit_code == 0
    assert {p.name for p in (folder / "out").glob("*.csv")} == {f"{d.name}_rm-koch_replay.csv" for d in drives}


def test_the_command_scores_and_says_what_is_wrong(drive, tmp_path):
    file = written(tracks(), tmp_path / "drive_mine.csv")
    call = ["score", str(file), "--against", str(drive), "--out", str(tmp_path / "out"), "--log", "off"]
    done = CliRunner().invoke(app, [*call, "--tracker", "rm-koch"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "drive_rm-koch+mine_replay.json").is_file()
    wrong = CliRunner().invoke(app, [*call, "--tolerance", "5"])
    assert (wrong.exit_code, "tolerance must be within 0 and 1 s" in wrong.stderr) == (2, True)

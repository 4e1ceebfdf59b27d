"""Recordings that cannot be right: what is wrong is found, the sentence names it, and its option puts it right."""

import re
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from scenarios import SCENARIOS
from testbed.cli import app
from testbed.environment.perception import radar_of
from testbed.replay.fixes import DOUBT, FAULT, OPEN
from testbed.replay.plausibility import faults, judged
from testbed.replay.reading import read
from testbed.replay.readings import CLAIMED, LEVELS, READINGS, STANDING, Judged
from testbed.replay.recording import RecordedFrame, record
from testbed.replay.replaying import ReplayConfig, prepare
from testbed.replay.writing import write
from tests.testbed.replay.made_tables import made, save


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Three seconds of a front radar between guard rails."""
    out = tmp_path_factory.mktemp("plausible") / "drive"
    write(record("cut-in", 3, "front", 3.0), out, "parquet")
    return out


@pytest.fixture(scope="module")
def turn(tmp_path_factory):
    """Six seconds of a drive through tight bends, with corner radars."""
    out = tmp_path_factory.mktemp("turning") / "turn"
    write(record("xia2020-s-curve", 3, "corners", 6.0), out, "parquet")
    return out


def table(folder, name):
    return pq.read_table(folder / f"{name}.parquet").to_pandas()


def changed(folder, out, **columns):
    """A copy of a recording, with functions of a column by TABLE__COLUMN."""
    shutil.copytree(folder, out)
    for key, change in columns.items():
        name, column = key.split("__")
        rows = table(out, name)
        rows[column] = change(rows[column])
        pq.write_table(pa.Table.from_pandas(rows), out / f"{name}.parquet")
    return out


def wrong(folder, fixes=()):
    return [one for one in judged(folder, fixes=fixes)[1] if one.verdict in (DOUBT, FAULT)]


def times(factor):
    return lambda values: factor * values


def over_ground(folder, out):
    own = np.concatenate(
        [f.scan.ground_rate - f.scan.polar[:, 2] for f in read(folder).frames]  # what the ego's motion makes of 0
    )
    return changed(folder, out, detections__range_rate=lambda rate: rate + own)


def twice(folder, out):
    shutil.copytree(folder, out)
    rows = table(out, "detections")
    pq.write_table(pa.Table.from_pandas(rows.loc[rows.index.repeat(2)]), out / "detections.parquet")
    return out


def crowded(folder, out):
    """With a thousand times the false alarms that the sensor is said to have."""
    shutil.copytree(folder, out)
    rng, rows, sheet = np.random.default_rng(1), table(out, "detections"), table(out, "sensors").iloc[0]
    count = int(1000 * sheet.clutter) // 2
    parts = [rows]
    for time in np.unique(rows.time):
        far = sheet.max_range * np.sqrt(rng.random(count))
        azimuth, rate = rng.uniform(-sheet.fov / 2, sheet.fov / 2, count), rng.uniform(-60, 60, count)
        alarms = {"range": far, "azimuth": azimuth, "range_rate": rate, "object": "-", "kind": "clutter"}
        parts.append(rows.iloc[:0].reindex(range(count)).assign(time=time, sensor=sheet["name"], **alarms))
    joined = pa.Table.from_pylist([row for part in parts for row in part.to_dict("records")])
    pq.write_table(joined.sort_by("time"), out / "detections.parquet")
    return out


FOUND = {  # what was done to the drive, the line of the report, what fits, and the options
    "km/h": ({"detections__range_rate": times(3.6)}, "range rate", "km/h", "range_rate=km/h"),
    "mph": ({"detections__range_rate": times(1 / 0.44704)}, "range rate", "mph", "range_rate=mph"),
    "reversed": ({"detections__range_rate": times(-1)}, "range rate", "reversed", "range_rate=reversed"),
    "both": (
        {"detections__range_rate": times(-3.6)}, "range rate", "reversed, km/h",
        "range_rate=km/h range_rate=reversed",
    ),
    "all zero": ({"detections__range_rate": times(0)}, "range rate", "all zero", "range_rate=none"),
    "mirrored": ({"detections__azimuth": times(-1)}, "azimuth", "mirrored", "azimuth=mirrored"),
    "feet": ({"detections__range": times(1 / 0.3048)}, "reach", "ranges may be in ft", "range=ft"),
    "speed": (
        {"ego__vx": times(3.6), "ego__vy": times(3.6)}, "speed of the ego", "km/h", "ego.speed=km/h",
    ),
    "yaw rate": ({"ego__yaw_rate": lambda w: w + 5}, "yaw rate of the ego", "does not fit", "ego.yaw_rate=heading"),
    "truth": ({"truth__vx": times(3.6), "truth__vy": times(3.6)}, "speed of the truth", "km/h", "truth.speed=km/h"),
    "sizes": (
        {"truth__length": lambda v: v * 0.3, "truth__width": lambda v: v * 3}, "boxes of the truth",
        "length and width may be swapped", "truth.size=swapped",
    ),
}  # fmt: skip


def check_cured(folder, right, test, fits, options):
    """The fault is found alone, and its options give the recording that is right."""
    found = [one for one in judged(folder)[1] if one.verdict == FAULT]
    assert (found[0].test, found[0].fits) == (test, fits), found
    fixes = re.findall(r"--fix ([^\s,]+)", found[0].remedy)
    assert " ".join(fixes) == options
    cured, again = judged(folder, fixes=fixes)
    assert faults(again) == []
    for a, b in zip(cured.frames, read(right).frames, strict=True):
        if "none" not in options and "measured" not in options:
            np.testing.assert_allclose(a.scan.polar, b.scan.polar, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(a.scene.ego.velocity, b.scene.ego.velocity, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(a.scene.objects.velocity, b.scene.objects.velocity, rtol=1e-6, atol=1e-9)


def test_a_right_recording_has_no_doubt_and_what_cannot_be_tested_is_said(drive, turn):
    assert wrong(drive) == wrong(turn) == []
    assert next(one for one in judged(drive)[1] if one.test == "yaw rate of the ego").verdict == "nothing can be said"
    assert next(one for one in judged(turn)[1] if one.test == "yaw rate of the ego").verdict == "right"


@pytest.mark.parametrize("case", FOUND)
def test_a_column_that_cannot_be_right_is_found_and_cured(case, drive, tmp_path):
    change, test, fits, options = FOUND[case]
    check_cured(changed(drive, tmp_path / "wrong", **change), drive, test, fits, options)


@pytest.mark.parametrize("case", ["km/h", "mph", "reversed", "both", "all zero", "feet"])
def test_it_is_found_without_truth_too(case, drive, tmp_path):
    change, test, fits, options = FOUND[case]
    right = changed(drive, tmp_path / "right")
    (right / "truth.parquet").unlink()
    check_cured(changed(right, tmp_path / "wrong", **change), right, test, fits, options)


def test_range_rates_over_ground_are_found_and_cured(drive, tmp_path):
    wrong = over_ground(drive, tmp_path / "wrong")
    check_cured(wrong, drive, "range rate", "relative to the ground", "range_rate=ground")


def test_equal_detections_are_found_and_cured(drive, tmp_path):
    wrong = twice(drive, tmp_path / "wrong")
    check_cured(wrong, drive, "equal detections", "there more than once", "detections=once")


def test_a_thousandfold_clutter_is_found_and_cured(drive, tmp_path):
    short = changed(drive, tmp_path / "short")
    for name in ("detections", "scans"):
        rows = table(short, name)
        pq.write_table(pa.Table.from_pandas(rows[rows.time < 0.9]), short / f"{name}.parquet")
    folder, fits = crowded(short, tmp_path / "wrong"), "far more than the sensors are said to have"
    check_cured(folder, short, "detections a scan", fits, "clutter=measured")
    assert judged(folder, fixes=["clutter=measured"])[0].sensors.models[0].clutter > 1000


@pytest.mark.parametrize("name", ["doppler", "vr", "V_R", "radial_velocity", "Doppler_mps"])
def test_range_rates_under_another_name_are_not_dropped_in_silence(name, drive, tmp_path):
    folder = changed(drive, tmp_path / "wrong")
    rows = table(folder, "detections").rename(columns={"range_rate": name})
    pq.write_table(pa.Table.from_pandas(rows), folder / "detections.parquet")
    check_cured(folder, drive, "columns", "it seems to be range_rate", f"{name}=range_rate")


def test_other_columns_are_named_and_no_alarm(drive, tmp_path):
    folder = changed(drive, tmp_path / "more")
    rows = table(folder, "detections").assign(rcs=1.0, doppler=0.0)
    pq.write_table(pa.Table.from_pandas(rows), folder / "detections.parquet")
    assert judged(folder)[1][0].figure == "not read: rcs of detections.parquet, doppler of detections.parquet"
    assert wrong(folder) == []


def test_one_sensor_of_two_is_named(drive, tmp_path):
    """Every second detection is given to another sensor at the same place, whose sign is wrong."""
    right = changed(drive, tmp_path / "right")
    rows, sheet, scans = (table(right, name) for name in ("detections", "sensors", "scans"))
    rows.loc[1::2, "sensor"] = "second"
    second = sheet.assign(name="second")
    for name, parts in (("sensors", [sheet, second]), ("scans", [scans, scans.assign(sensor="second")])):
        joined = [row for part in parts for row in part.to_dict("records")]
        pq.write_table(pa.Table.from_pylist(joined).sort_by("time" if name == "scans" else "name"),
                       right / f"{name}.parquet")  # fmt: skip
    pq.write_table(pa.Table.from_pandas(rows), right / "detections.parquet")
    assert wrong(right) == []
    sign = np.where(rows.sensor == "second", -1.0, 1.0)
    folder = changed(right, tmp_path / "wrong", detections__range_rate=lambda rate: rate * sign)
    check_cured(folder, right, "range rate of second", "reversed", "range_rate@second=reversed")


def test_one_radar_that_looks_aside_and_is_mirrored_is_named(tmp_path):
    """On a straight road and without truth."""
    right = tmp_path / "right"
    write(record("cut-in", 3, "surround", 4.0), right, "parquet")
    (right / "truth.parquet").unlink()
    assert wrong(right) == []
    side = np.where(table(right, "detections").sensor == "radar-3", -1.0, 1.0)
    folder = changed(right, tmp_path / "wrong", detections__azimuth=lambda angle: angle * side)
    check_cured(folder, right, "azimuth of radar-3", "mirrored", "azimuth@radar-3=mirrored")


def test_a_truth_that_is_elsewhere_is_doubtful(drive, tmp_path):
    folder = changed(drive, tmp_path / "wrong", truth__x=lambda x: x + 40)
    assert [(one.test, one.fits) for one in wrong(folder)] == [("truth and detections", "they are at different places")]


def test_a_truth_that_is_aside_may_be_what_is_wrong(drive, tmp_path):
    """The boxes are then where mirrored azimuths would show the vehicles."""
    folder = changed(drive, tmp_path / "wrong", truth__y=lambda y: y - 8)
    (said,) = faults(judged(folder)[1])
    assert said.startswith("azimuth: mirrored")
    assert said.endswith("--fix azimuth=mirrored, or correct the places of the truth, which alone say so")


def level_of(fixes, standing, claimed):
    """The verdict on one reading, from what stands and what would be due in the next scan."""
    votes = np.zeros((len(READINGS), 4, 4), int)
    k = next(k for k, how in enumerate(READINGS) if how.fixes == fixes)
    votes[k, STANDING], votes[k, CLAIMED] = standing, claimed
    return LEVELS[Judged.of(votes).level[k]]


def test_one_vehicle_at_the_speed_of_the_ego_is_not_what_stands():
    """It is a quarter of what a radar sees in a roundabout, but it is in few places."""
    few, many = (59, 2, 227, 10), (590, 20, 2270, 30)
    ground, reversed_ = ("range_rate=ground",), ("range_rate=reversed",)
    assert level_of(ground, few, (4, 13, 25, 2)) == OPEN
    assert level_of(ground, many, (40, 130, 250, 12)) == FAULT
    assert level_of(ground, many, (0, 0, 0, 0)) == OPEN  # the next scan could not have spoken against it
    assert level_of(ground, (596, 41, 798, 12), (6, 5, 67, 2)) == DOUBT  # a column beside the ego, between rails
    assert level_of(reversed_, few, (0, 0, 0, 0)) == FAULT  # vehicles hardly ever have these range rates
    assert level_of(reversed_, (590, 100, 2270, 30), (0, 0, 0, 0)) == OPEN  # too many stand as it is


def test_a_truth_that_lies_across_its_way_is_found(drive, tmp_path):
    folder = changed(drive, tmp_path / "wrong", truth__heading=lambda angle: angle + np.pi / 2)
    assert faults(judged(folder)[1])[0].startswith("boxes of the truth: headings are not those of the ways")


def test_a_radar_without_noise_is_recorded_so_that_it_can_be_replayed(tmp_path):
    write(record("cut-in", 3, "ideal", 1.0), tmp_path, "parquet")
    recorded, found = judged(tmp_path)
    assert recorded.sensors.sigma.min() > 0
    assert faults(found) == []


def test_detections_that_are_late_are_doubtful(tmp_path):
    right = tmp_path / "right"
    write(record("overtake", 3, "front", 5.0), right, "parquet")
    assert wrong(right) == []
    folder = changed(right, tmp_path / "late", **dict.fromkeys(("detections__time", "scans__time"), lambda t: t + 0.6))
    for name in ("detections", "scans"):
        rows = table(folder, name)
        pq.write_table(pa.Table.from_pandas(rows[rows.time < 4.95]), folder / f"{name}.parquet")
    assert [one.fits for one in wrong(folder)] == ["detections may be about 0.6 s late"]


def test_azimuths_of_radars_that_look_aside_are_found_without_truth(turn, tmp_path):
    right = changed(turn, tmp_path / "right")
    (right / "truth.parquet").unlink()
    folder = changed(right, tmp_path / "wrong", detections__azimuth=times(-1))
    check_cured(folder, right, "azimuth", "mirrored", "azimuth=mirrored")


def test_a_yaw_rate_that_turns_the_other_way_is_found(turn, tmp_path):
    folder = changed(turn, tmp_path / "wrong", ego__yaw_rate=times(-1))
    check_cured(folder, turn, "yaw rate of the ego", "reversed", "ego.yaw_rate=reversed")


def test_of_an_ego_that_stands_nothing_can_be_said_about_the_sign(drive, tmp_path):
    """The same scans as of an ego that stands, of which only those rates remain that do not move a car by metres."""
    slow = lambda rate: rate.where(rate.abs() < 2, 0.1)  # noqa: E731
    still = {f"ego__{name}": times(0) for name in ("x", "y", "vx", "vy", "yaw_rate")}
    folder = changed(drive, tmp_path / "right", detections__range_rate=slow, **still)
    (folder / "truth.parquet").unlink()
    for sign in (1, -1):
        found = judged(changed(folder, tmp_path / f"signed{sign}", detections__range_rate=times(sign)))[1]
        rate = next(one for one in found if one.test == "range rate")
        assert rate.verdict == "nothing can be said"


EGO = {  # what was done to the ego of the made drive, what fits, and the option
    "speed in km/h": ({"speed": times(3.6)}, "km/h", "ego.speed=km/h"),
    "places that are not known": ({"x": times(0.0)}, "does not fit", "ego.places=speed"),
    "small heading in degrees": ({"heading": lambda h: h + 5.0}, "does not fit", "ego.heading=places"),
    "heading turned round": ({"heading": lambda h: h + np.pi}, "does not fit", "ego.heading=places"),
    "places in feet": ({"x": times(1 / 0.3048)}, "does not fit", "ego.speed=places"),
}


@pytest.mark.parametrize("case", EGO)
def test_places_that_do_not_move_as_the_speed_says_are_found(case, tmp_path):
    change, fits, option = EGO[case]
    tables = made(0.5)
    for name, function in change.items():
        tables["ego"][name] = function(np.array(tables["ego"][name])).tolist()
    folder = save(tables, tmp_path)
    found = next(one for one in judged(folder)[1] if one.test == "speed of the ego")
    assert (found.verdict, found.fits) == (FAULT, fits)
    assert found.remedy == f"read it with --fix {option}"
    cured = next(one for one in judged(folder, fixes=[option])[1] if one.test == "speed of the ego")
    assert cured.verdict == "right"


def test_a_replay_refuses_what_cannot_be_right_or_goes_on(drive, tmp_path):
    folder = changed(drive, tmp_path / "wrong", detections__range_rate=times(-1))
    options = {"trackers": ("rm-koch",), "end": 1.5, "out": str(tmp_path), "log": "off"}
    with pytest.raises(
        ValueError, match=r"range rate: reversed \(.*--fix range_rate=reversed\. Or go on with --accept"
    ):
        prepare(ReplayConfig(str(folder), **options))
    assert prepare(ReplayConfig(str(folder), **options, accept=True)).findings
    assert prepare(ReplayConfig(str(folder), **options, fixes=("range_rate=reversed",))).findings


@pytest.mark.parametrize(
    ("fix", "sentence"),
    [
        ("range_rate", "--fix is COLUMN=HOW, got 'range_rate'"),
        ("range_rte=km/h", "no thing to fix 'range_rte'; did you mean 'range_rate'"),
        ("range_rate=kmh", "--fix range_rate can be km/h, mph, reversed, ground, none, got 'kmh'"),
        ("ego.speed@left=km/h", "only range_rate, azimuth, range can be of one sensor"),
        ("range_rate@left=km/h", "no detection is of such a sensor"),
    ],
)
def test_a_fix_that_there_is_not_is_one_sentence(fix, sentence, drive):
    with pytest.raises((ValueError, LookupError), match=re.escape(sentence)):
        judged(drive, fixes=[fix])


def run(*args):
    return CliRunner().invoke(app, list(map(str, args)), env={"COLUMNS": "200"})


def test_the_commands_print_the_report(drive, tmp_path):
    folder = changed(drive, tmp_path / "wrong", detections__range_rate=times(3.6))
    short = ("--tracker", "rm-koch", "--to", 0.3, "--log", "off", "--out", tmp_path / "runs")
    good = run("replay", drive, *short)
    assert good.exit_code == 0
    assert good.output.count("plausible  13 tests; nothing can be said of") == 1
    bad = run("replay", folder, *short[:2], "--out", tmp_path / "runs")
    assert bad.exit_code == 2
    assert "testbed: range rate: km/h" in bad.output
    anyway = run("replay", folder, *short, "--accept-implausible")
    assert anyway.exit_code == 0
    assert "fault  range rate: km/h" in anyway.output
    checked = run("check", "recording", folder)
    assert checked.exit_code == 1
    assert "verdict" in checked.output
    assert "--fix range_rate=km/h" in checked.output
    assert run("check", "recording", folder, "--fix", "range_rate=km/h").exit_code == 0


def rescanned(driven, radar, folder):
    rng = np.random.default_rng(61)
    frames = tuple(RecordedFrame(f.scene, *radar_of(radar).scan(f.scene, rng)) for f in driven.frames)
    write(driven._replace(radar=radar, frames=frames), folder, "parquet")


@pytest.mark.parametrize("scenario", ["slow-tractor", "u-turn"])
def test_a_few_vehicles_that_pass_are_no_alarm(scenario, tmp_path):
    """They are seen in many scans, across the line of sight, and without a radar's clutter."""
    rescanned(record(scenario, 61, "ideal", 5.0), "lidar-1deg", tmp_path)
    assert wrong(tmp_path) == []
    (tmp_path / "truth.parquet").unlink()
    assert wrong(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_right_recordings_of_every_scenario_have_no_alarm(scenario, tmp_path):
    """Of three radars, with truth and without."""
    driven = record(scenario, 61, "ideal", 5.0)
    for radar in ("front", "nuscenes-like", "lidar-1deg"):
        rescanned(driven, radar, tmp_path / radar)
        assert wrong(tmp_path / radar) == []
        (tmp_path / radar / "truth.parquet").unlink()
        assert wrong(tmp_path / radar) == []

"""Offline learning end to end: data sources, the table on disk, shipped tables."""

import io
import json
import shlex
import sys

import numpy as np
import pytest
from rich.console import Console

import sensors
from studies.calibration.statistics import DATA
from testbed.cli import main
from testbed.experiments.single import RunConfig
from testbed.experiments.single import run as run_once
from testbed.learn.detections import (
    GROWN,
    TrainingDetections,
    lone_vehicle,
    lone_vehicle_scans,
    read,
    sample,
    split_kind,
    unit_coordinates,
    unit_noise,
)
from testbed.learn.models import LearnedTable, SplineConfig, TableConfig, learn
from testbed.log.detections import read_detections
from trackers.geometry import box_corners, rotation, to_frame
from trackers.htg.bins import SHIPPED, load
from trackers.htg.density import log_density, log_mass
from trackers.htg.learning import TableFit

needs_data = pytest.mark.skipif(
    not (DATA / "objects.npz").exists(), reason="the real detections are not part of this project and not beside it"
)
TABLES = sorted(file.stem for file in SHIPPED.glob("*.json"))


# -- coordinates and sources ------------------------------------------------------------------------------------------


def test_corners_of_a_box_have_unit_coordinates_of_one():
    pose, size = np.array([12.0, -3.0, 0.7]), np.array([4.6, 1.8])
    u = unit_coordinates(box_corners(pose, size), np.tile(pose, (4, 1)), np.tile(size, (4, 1)))
    np.testing.assert_allclose(u, [[1, 1], [-1, 1], [-1, -1], [1, -1]], atol=1e-12)


def test_noise_in_unit_coordinates_is_that_of_transformed_draws():
    rng = np.random.default_rng(0)
    R, heading, size = np.array([[0.3, 0.1], [0.1, 0.2]]), 0.6, np.array([5.0, 2.0])
    draws = rng.multivariate_normal(np.zeros(2), R, 200_000) @ rotation(heading) * (2 / size)
    got = unit_noise(R[None], np.array([heading]), size[None])[0]
    np.testing.assert_allclose(got, np.cov(draws.T), rtol=0.02, atol=1e-3)


@pytest.mark.parametrize(
    ("data", "name", "kind"),
    [
        ("sampler:surround", "sampler:surround", "car"),
        ("sampler:imaging:truck", "sampler:imaging", "truck"),
        ("runs/a.rrd:car", "runs/a.rrd", "car"),
        ("C:folder", "C:folder", "car"),
    ],
)
def test_a_data_source_may_end_in_a_class(data, name, kind):
    assert split_kind(data) == (name, kind)


@pytest.mark.parametrize(
    ("data", "name"),
    [
        ("sampler:imaging:truck", "sampler:imaging:truck"),
        ("somewhere/else/extract:car", "extract:car"),
        ("../runs/a.rrd", "a.rrd"),
    ],
)
def test_a_command_in_the_provenance_names_no_folder(data, name):
    for config in (TableConfig(data), SplineConfig(data)):
        assert config.command("out/mine.json").split()[2:] == [name, "--out", "mine.json"]


def test_a_radar_that_sees_only_contours_samples_the_outline_on_the_side_it_sees():
    got = sample(sensors.find("ideal"), "car", 6000, np.random.default_rng(1))
    assert len(got.u) >= 6000
    assert (np.abs(got.u) < 1 + 1e-9).all()
    behind, ahead = np.abs(got.aspect) < 0.3, np.abs(got.aspect) > np.pi - 0.3
    assert got.u[behind, 0].mean() < -0.6  # the rest lies on the flank, seen at a grazing angle
    assert got.u[ahead, 0].mean() > 0.6
    left = (got.aspect > 1.2) & (got.aspect < 1.9)  # the nose points left of the line of sight: its left is hidden
    assert (got.u[left, 1] > 0).mean() > 0.9
    np.testing.assert_allclose(got.noise, 0.0, atol=1e-12)


def test_sampled_noise_is_that_of_the_data_sheet():
    one = next(
        found for found in lone_vehicle_scans(sensors.find("front"), "truck", np.random.default_rng(2)) if len(found.u)
    )
    variance = np.linalg.eigvalsh(one.noise).max()
    assert 0 < variance < (2 * 0.8 / 2.25) ** 2  # at 80 m 0.7 m across, of a half width of 1.1 m at least


def test_the_same_seed_samples_the_same_detections():
    a, b, c = (sample(sensors.find("surround"), "car", 50, np.random.default_rng(seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(a.u, b.u)
    assert not np.array_equal(a.u[:10], c.u[:10])


def test_an_articulated_truck_fills_its_box():
    pose, size = np.array([30.0, 5.0, 0.4]), np.array([16.5, 2.55])
    scene = lone_vehicle("articulated", pose, size)
    points = to_frame(pose, np.concatenate(scene.bodies.outline))
    np.testing.assert_allclose([points.min(0), points.max(0)], [-size / 2, size / 2], atol=1e-9)
    assert len(scene.bodies.outline) == 2


def write(path, **arrays):
    np.savez(path, **arrays)
    return path


def test_both_layouts_of_an_archive_say_the_same(tmp_path):
    rng = np.random.default_rng(5)
    n = 40
    pose = np.column_stack([rng.uniform(10, 40, n), rng.uniform(-5, 5, n), rng.uniform(-3, 3, n)])
    size, sensor = np.tile([4.5, 1.8], (n, 1)), np.tile([1.0, 0.5], (n, 1))
    xy = pose[:, :2] + rng.normal(size=(n, 2))
    noise = np.tile(0.04 * np.eye(2), (n, 1, 1))
    metric = read(str(write(tmp_path / "a.npz", xy=xy, pose=pose, size=size, sensor=sensor, noise=noise)))
    again = read(str(write(tmp_path / "b.npz", u=metric.u, aspect=metric.aspect, noise=metric.noise)))
    for a, b in zip(metric[:4], again[:4], strict=True):
        np.testing.assert_array_equal(a, b)
    d = pose[0, :2] - sensor[0]
    assert np.cos(metric.aspect[0] - (pose[0, 2] - np.arctan2(d[1], d[0]))) == pytest.approx(1.0)


def test_an_archive_gives_the_detections_of_one_class(tmp_path):
    file = write(tmp_path / "a.npz", u=np.zeros((3, 2)), aspect=np.arange(3.0), kind=np.array(["car", "bus", "van"]))
    assert read(f"{file}:car").aspect.tolist() == [0.0, 2.0]
    assert read(f"{file}:truck").aspect.tolist() == [1.0]


U = np.tile([[0.9, 0.1]], (3, 1))
METRIC = {"xy": U, "pose": np.zeros((3, 3)), "size": np.ones((3, 2)), "sensor": np.ones((3, 2))}


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"u": U}, "lacks aspect; it must hold u, aspect; or xy, pose, size, sensor"),
        ({"xy": U, "pose": np.zeros((3, 3))}, "lacks size, sensor"),
        ({"u": U, "aspect": np.zeros(4)}, r"aspect of .* must be \(N,\) with N of u, got \(4,\)"),
        ({"u": 1.0, "aspect": np.zeros(3)}, r"u of .* must be \(N, 2\)"),
        ({"u": U.astype(str), "aspect": np.zeros(3)}, "u of .* must be real numbers"),
        ({"u": U, "aspect": np.zeros(3), "look": np.zeros(3)}, "look of .* must be whole numbers"),
        ({"u": np.array([None, 1], object), "aspect": np.zeros(2)}, "without unpickling"),
        ({"u": U * [np.nan, 1], "aspect": np.zeros(3)}, "u of .* has 3 values that are not finite"),
        ({"u": U, "aspect": np.array([0, 0, np.inf])}, "aspect of .* has 1 values that are not finite"),
        ({"u": U, "aspect": np.array([0.0, 90.0, 180.0])}, "aspect of .* must be in radians, got up to 180"),
        ({"u": U * 20, "aspect": np.zeros(3)}, "are positions in metres"),
        ({"u": U, "aspect": np.zeros(3), "noise": np.tile(-np.eye(2), (3, 1, 1))}, "negative variance"),
        ({"u": U, "aspect": np.zeros(3), "kind": np.array(["Car"] * 3)}, r"no detection of a car .* only of Car"),
        (METRIC | {"size": np.zeros((3, 2))}, "size of .* must be positive, got 0 m"),
    ],
)
def test_a_wrong_archive_is_refused_in_one_sentence(tmp_path, arrays, message):
    with pytest.raises(ValueError, match=message):
        read(str(write(tmp_path / "a.npz", **arrays)))


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "npy"])
def test_a_damaged_archive_is_refused_in_one_sentence(tmp_path, damage):
    file = write(tmp_path / "a.npz", u=np.zeros((50, 2)), aspect=np.zeros(50))
    content = bytearray(file.read_bytes())
    content[300:310] = b"\1" * 10
    if damage == "npy":
        np.save(tmp_path / "a.npy", U)
        (tmp_path / "a.npy").replace(file)
    else:
        file.write_bytes({"empty": b"", "cut": content[:400], "flipped": content}[damage])
    with pytest.raises(ValueError, match=r"is not an \.npz file|is damaged"):
        read(str(file))


def test_what_is_not_there_is_said_so(tmp_path):
    with pytest.raises(ValueError, match=r"there is no nowhere\.npz"):
        read("nowhere.npz")
    with pytest.raises(ValueError, match=r"no objects\.npz"):
        read(str(tmp_path))
    with pytest.raises(LookupError, match="did you mean 'surround'"):
        read("sampler:suround")
    write(tmp_path / "objects.npz", u=U)
    with pytest.raises(ValueError, match="lacks columns, objects, points, offsets, classes"):
        read(str(tmp_path))
    (tmp_path / "a.rrd").write_text("no log")
    with pytest.raises(ValueError, match="is not a review log"):
        read(str(tmp_path / "a.rrd"))


def test_a_recording_gives_the_detections_of_its_radar(tmp_path):
    config = RunConfig("truck-convoy", ("rm-feldmann",), "surround", "idle", 0, 1.0, str(tmp_path), "full")
    log = run_once(config).rrd
    truck = read(f"{log}:truck")
    assert len(truck.u) > 30
    assert (np.abs(truck.u) < 1.5).all(-1).mean() > 0.9
    facing = np.where(np.abs(truck.aspect) < np.pi / 2, -1, 1)
    assert (np.sign(truck.u[:, 0]) == facing)[np.abs(np.cos(truck.aspect)) > 0.95].mean() > 0.6
    assert np.linalg.eigvalsh(truck.noise).min() > 0
    logged = read_detections(log)
    assert len(read(f"{log}:car").u) + len(truck.u) == len(logged.xy)
    assert (logged.size[logged.kind == "articulated"][:, 0] > 12).all()


@needs_data
def test_the_real_extract_has_the_published_number_of_points_in_grown_boxes():
    real = read(f"{DATA}:car")
    assert len(real.u) == 118815
    assert real.noise is None
    assert (np.abs(real.u) < GROWN).all()
    assert (real.u[np.abs(real.aspect) < 0.3, 0] < 0).mean() > 0.7


# -- learn ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    config = TableConfig("sampler:surround:car", bins=2, count=1500)
    calls = []
    got = learn(config, tmp_path_factory.mktemp("out") / "mine.json", lambda *call: calls.append(call))
    return got, calls


def test_a_learned_table_is_what_the_filters_load(learned):
    got, _ = learned
    again = load(str(got.path))
    np.testing.assert_allclose(again.p.bounds, got.fit.table.p.bounds)
    np.testing.assert_allclose(again.mean, got.fit.table.mean)
    rear, front = again.bin_of(np.array([0.0, np.pi]))
    assert again.mean[rear, 0] < -0.2
    assert again.mean[front, 0] > 0.2


def test_a_learned_table_has_the_typical_size_of_its_vehicles(learned, tmp_path):
    got, _ = learned
    np.testing.assert_allclose(load(str(got.path)).size, got.detections.size.mean(0), atol=1e-3)
    assert 4.0 < got.fit.table.size[0] < 5.5
    rng = np.random.default_rng(19)
    u, aspect = rng.normal(0, 0.5, (60, 2)), rng.uniform(-3, 3, 60)
    for size, words in (({"size": np.tile([12.0, 2.5], (60, 1))}, "12.00 x 2.50 m"), ({}, "1.86 m, taken for granted")):
        file = write(tmp_path / "a.npz", u=u, aspect=aspect, **size)
        assert words in " ".join(printed(learn(TableConfig(str(file), bins=1), tmp_path / "a.json")).split())


def test_a_learned_table_tells_where_it_comes_from(learned):
    got, _ = learned
    facts = json.loads(got.path.read_text())["provenance"]
    assert facts["command"] == "testbed learn-htg sampler:surround:car --out mine.json --bins 2 --count 1500"
    assert facts["noise"] == "data sheet taken out of r"
    assert sum(facts["counts"]) == facts["detections"] == len(got.detections.u)
    assert facts["versions"]["numpy"] == np.__version__
    own = got.detections.u[got.fit.table.bin_of(got.detections.aspect) == 1]
    assert len(own) == facts["counts"][1]
    assert len(facts["log_likelihood"]) == 2


def test_learning_tells_its_progress_and_reports_every_bin(learned):
    got, calls = learned
    assert {what for _, _, what in calls} == {"surround on cars", "fitting mine"}
    assert calls[-1][:2] == (2, 2)
    table, *_ = got.report()
    assert table.row_count == 2


def printed(learned):
    console = Console(width=80, record=True, file=io.StringIO())
    for part in learned.report():
        console.print(part)
    return console.export_text()


@pytest.mark.parametrize("name", TABLES)
def test_a_report_fits_80_columns_without_losing_a_digit(name):
    shipped, facts = load(name), json.loads((SHIPPED / f"{name}.json").read_text())["provenance"]
    warnings = tuple(tuple(facts["warnings"].get(str(k), ())) for k in range(8))
    fit = TableFit(shipped, np.array(facts["counts"]), np.array(facts["log_likelihood"]), warnings)
    data = TrainingDetections(np.zeros((facts["detections"], 2)), np.zeros(0), None, np.zeros(0), facts["data"])
    text = printed(LearnedTable(fit, data, SHIPPED / f"{name}.json"))
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80
    numbers = [f"{x:.2f}" for x in shipped.p.bounds.ravel()] + [f"{x:.3f}" for x in facts["log_likelihood"]]
    for number in (*map(str, facts["counts"]), *numbers):
        assert number in text
    words = " ".join(text.split())
    for warning in {text for bin_ in warnings for text in bin_}:
        assert warning in words


def test_bins_with_the_same_caution_share_a_line(learned):
    got, _ = learned
    warned = got._replace(fit=got.fit._replace(warnings=(("only 60 detections",), ("only 60 detections",))))
    assert "caution, aspect -180, +0: only 60 detections" in printed(warned)
    assert "caution" not in printed(got._replace(fit=got.fit._replace(warnings=((), ()))))


def test_what_cannot_be_written_or_learned_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"out must be a \.json file"):
        learn(TableConfig("sampler:surround"), tmp_path / "table.npz")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(OSError, match="it is a directory"):
        learn(TableConfig("sampler:surround"), tmp_path / "folder.json")
    file = write(tmp_path / "a.npz", u=np.zeros((0, 2)), aspect=np.zeros(0))
    with pytest.raises(ValueError, match="has no detection of that class"):
        learn(TableConfig(str(file)), tmp_path / "a.json")
    file = write(tmp_path / "a.npz", u=np.tile(U, (30, 1)), aspect=np.zeros(90))
    with pytest.raises(ValueError, match="bin 0 of 8, at an aspect of -180 deg, has 0 detections, needs 20"):
        learn(TableConfig(str(file)), tmp_path / "a.json")
    assert not (tmp_path / "a.json").exists()


@pytest.mark.parametrize("wrong", [{"bins": 0}, {"count": 0}, {"seed": -1}, {"mass_min": 2.0}])
def test_a_wrong_setting_is_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        TableConfig("sampler:surround", **wrong)


def test_the_command_in_the_provenance_is_one_that_the_command_line_takes(tmp_path, monkeypatch, capsys):
    rng = np.random.default_rng(18)
    file = write(tmp_path / "a b.npz", u=rng.normal(0, 0.5, (60, 2)), aspect=rng.uniform(-3, 3, 60))
    monkeypatch.chdir(tmp_path)
    config = TableConfig(file.name, bins=2, centred=False, mirrored=False, mass_min=0.1, count=5, seed=2)
    monkeypatch.setattr(sys, "argv", shlex.split(config.command("o.json")))
    with pytest.raises(SystemExit) as done:
        main()
    assert not done.value.code
    assert "table    o.json" in capsys.readouterr().out
    assert json.loads((tmp_path / "o.json").read_text())["provenance"]["command"] == config.command("o.json")


def test_a_fault_of_the_input_is_one_sentence_and_exit_status_2(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["testbed", "learn-htg", "nowhere.npz", "--out", str(tmp_path / "o.json")])
    with pytest.raises(SystemExit) as done:
        main()
    assert done.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("testbed: data: there is no nowhere.npz")


@pytest.mark.parametrize("name", TABLES)
def test_a_shipped_table_says_how_it_was_made_and_looks_the_right_way(name):
    shipped = load(name)
    facts = json.loads((SHIPPED / f"{name}.json").read_text())["provenance"]
    assert facts["command"].startswith("testbed learn-htg ")
    assert f"--out {name}.json" in facts["command"]
    assert len(shipped) == len(facts["counts"]) == 8
    assert sum(facts["counts"]) == facts["detections"] > 5000
    rear, front = shipped.bin_of(np.array([0.0, np.pi]))
    assert shipped.mean[rear, 0] < -0.2
    assert shipped.mean[front, 0] > 0.2
    np.testing.assert_allclose(np.exp(log_mass(shipped.p)), facts["mass"], rtol=0.01)
    assert (np.linalg.eigvalsh(shipped.cov) > 0).all()
    low, high = {"car": (4.0, 5.0), "truck": (9.0, 14.0)}[name.split("-")[1]]
    assert low < shipped.size[0] < high  # htg-map keeps depths metric as on a vehicle of this size
    if name.endswith("-cd25"):
        assert (np.exp(log_mass(shipped.p)) > 0.2).all()


def test_tables_of_every_rig_and_of_real_vehicles_are_shipped():
    wanted = {f"{rig}-{kind}" for rig in ("surround", "imaging", "astyx") for kind in ("car", "truck")}
    assert wanted <= set(TABLES)


@needs_data
@pytest.mark.parametrize("kind", ["car", "truck"])
def test_the_shipped_table_of_real_vehicles_has_the_likelihood_it_claims(kind):
    real, shipped = read(f"{DATA}:{kind}"), load(f"astyx-{kind}")
    facts = json.loads((SHIPPED / f"astyx-{kind}.json").read_text())["provenance"]
    assert facts["detections"] == len(real.u)
    index = shipped.bin_of(real.aspect)
    got = log_density(real.u, shipped.of(index)).mean()
    claimed = np.average(facts["log_likelihood"], weights=facts["counts"])
    assert got == pytest.approx(claimed, abs=0.03)  # claimed with mirror images, got without

"""Offline learning end to end: data sources, the table on disk, held-out comparison, shipped tables."""

import json

import numpy as np
import pytest

import sensors
from testbed.calibration import DATA
from testbed.learning import LearnConfig, learn, report
from testbed.learning_data import (
    GROWN,
    Detections,
    lone_vehicle,
    looks,
    read,
    sample,
    split_kind,
    unit_coordinates,
    unit_noise,
)
from testbed.log.detections import read_detections
from testbed.run import RunConfig
from testbed.run import run as run_once
from testbed.spatial_comparison import cross_validate, folds, inside_share, judge, table
from testbed.spatial_models import SpatialModel, fit_gaussian, fit_mixture, fit_uniform
from trackers.geometry import box_corners, rotation, to_frame
from trackers.htg.bins import SHIPPED, load
from trackers.htg.density import log_density, log_mass

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
    one = next(found for found in looks(sensors.find("front"), "truck", np.random.default_rng(2)) if len(found.u))
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


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"u": np.zeros((3, 2))}, "lacks aspect"),
        ({"xy": np.zeros((3, 2)), "pose": np.zeros((3, 3))}, "lacks size, sensor"),
        ({"u": np.zeros((3, 2)), "aspect": np.zeros(4)}, r"aspect of .* must be \(3,\), got \(4,\)"),
        ({"u": np.array([None, 1], object), "aspect": np.zeros(2)}, "without unpickling"),
    ],
)
def test_a_wrong_archive_is_refused_in_one_sentence(tmp_path, arrays, message):
    with pytest.raises(ValueError, match=message):
        read(str(write(tmp_path / "a.npz", **arrays)))


def test_what_is_not_there_is_said_so(tmp_path):
    with pytest.raises(ValueError, match=r"there is no nowhere\.npz"):
        read("nowhere.npz")
    with pytest.raises(ValueError, match=r"no objects\.npz"):
        read(str(tmp_path))
    with pytest.raises(LookupError, match="did you mean 'surround'"):
        read("sampler:suround")


def test_a_recording_gives_the_detections_of_its_radar(tmp_path):
    config = RunConfig("truck-convoy", ("rm-feldmann",), "surround", "idle", 0, 1.0, str(tmp_path), "full")
    log = run_once(config).rrd
    truck = read(f"{log}:truck")
    assert len(truck.u) > 30
    assert (np.abs(truck.u) < 1.5).all(-1).mean() > 0.9
    facing = np.where(np.abs(truck.aspect) < np.pi / 2, -1, 1)
    assert (np.sign(truck.u[:, 0]) == facing)[np.abs(np.cos(truck.aspect)) > 0.95].mean() > 0.7
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
    config = LearnConfig("sampler:surround:car", bins=2, count=1500)
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
    assert report(got).row_count == 2


def test_what_cannot_be_written_or_learned_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"out must be a \.json file"):
        learn(LearnConfig("sampler:surround"), tmp_path / "table.npz")
    file = write(tmp_path / "a.npz", u=np.zeros((3, 2)), aspect=np.zeros(3), kind=np.array(["car"] * 3))
    with pytest.raises(ValueError, match="has no detection of that class"):
        learn(LearnConfig(f"{file}:truck"), tmp_path / "a.json")
    with pytest.raises(ValueError, match="bins must be at least 1"):
        LearnConfig("sampler:surround", bins=0)


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


# -- comparison -------------------------------------------------------------------------------------------------------


def test_expectation_maximisation_finds_two_clusters_and_the_tied_form_needs_one_covariance():
    rng = np.random.default_rng(6)
    u = np.concatenate([rng.normal([-0.6, 0], 0.1, (300, 2)), rng.normal([0.6, 0], 0.1, (300, 2))])
    one, two = fit_gaussian(u), fit_mixture(u, 2, True, np.random.default_rng(0))
    true = np.log(0.5 / (2 * np.pi * 0.01)) - ((u - np.sign(u[:, :1]) * [0.6, 0]) ** 2).sum(1) / 0.02
    assert two(u).mean() == pytest.approx(true.mean(), abs=0.03)
    assert two(u).mean() > one(u).mean() + 0.5


def test_a_gaussian_has_the_density_of_the_textbook():
    u = np.random.default_rng(7).normal(size=(500, 2)) * [0.3, 0.5]
    d = u - u.mean(0)
    C = d.T @ d / len(u)
    textbook = -np.einsum("ni,ij,nj->n", d, np.linalg.inv(C), d) / 2 - np.log(2 * np.pi) - np.log(np.linalg.det(C)) / 2
    np.testing.assert_allclose(fit_gaussian(u)(u), textbook, rtol=1e-9)


def test_the_share_in_the_grown_box_is_one_for_the_uniform_and_known_for_a_gaussian():
    assert inside_share(fit_uniform(np.zeros((1, 2)))) == pytest.approx(1.0)
    u = np.random.default_rng(8).normal(size=(100_000, 2)) * 0.6
    assert inside_share(fit_gaussian(u)) == pytest.approx((np.abs(u) < GROWN).all(1).mean(), abs=3e-3)


def test_folds_are_blocks_of_consecutive_scans():
    look = np.array([5, 5, 6, 8, 9, 9, 9, 12])
    assert folds(look, 3).tolist() == [0, 0, 0, 1, 1, 1, 1, 2]
    with pytest.raises(ValueError, match="needs at least 9"):
        folds(look, 9)


def test_a_model_is_judged_on_what_it_has_not_seen():
    rng = np.random.default_rng(9)
    u = np.concatenate([rng.normal(0, 0.1, (400, 2)), rng.normal([0.9, 0], 0.02, (100, 2))])
    held = np.arange(500) >= 400
    model = SpatialModel("one Gaussian", 5, fit_gaussian, bins=1)
    plain, gated = judge(model, u, np.zeros(500), held)
    assert plain < -20  # a cluster that it never saw
    assert gated == pytest.approx(plain, abs=1e-6)


def test_the_comparison_has_a_row_for_every_model():
    rng = np.random.default_rng(10)
    n = 800
    data = Detections(rng.uniform(-1, 1, (n, 2)), rng.uniform(-3, 3, n), None, np.arange(n), "made up")
    models = [SpatialModel("uniform", 0, fit_uniform, bins=1), SpatialModel("Gaussian", 5, fit_gaussian, bins=1)]
    rows = cross_validate(data, models, 4)
    assert rows[0].plain == pytest.approx(np.full(4, -np.log(5.76)))
    assert rows[0].gated == pytest.approx(rows[0].plain)
    lines = table(rows)
    assert len(lines) == 4
    assert "| 5 |" in lines[3]

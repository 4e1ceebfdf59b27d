"""Laws and hand-worked cases of the radar."""

from dataclasses import replace

import numpy as np
import pytest

from sensors import RADARS, Radar, Sensor, find
from sensors.origin import CLUTTER, CONTOUR, STATIC, VOLUME
from sensors.scattering import draw_counts, draw_depth
from sensors.scene import Ego, boxes_scene
from trackers.geometry import box_corners, to_frame, unit
from trackers.validation import admit

IDEAL = RADARS["ideal"].sensors[0]


def rig(**parameters):
    return Radar("test", "for a test", (replace(IDEAL, **parameters),))


def scan(radar, scene, seed=0):
    return radar.scan(scene, np.random.default_rng(seed))


def moving_ego(pose=(0.0, 0.0, 0.0), velocity=(0.0, 0.0), yaw_rate=0.0):
    pose, size = np.array(pose, float), np.array([4.7, 1.9])
    return Ego(pose, np.array(velocity, float), yaw_rate, size, box_corners(pose, size))


def traffic(seed=3):
    rng = np.random.default_rng(seed)
    pose = np.stack([rng.uniform(-60, 120, 12), rng.choice([-7.2, -3.6, 3.6, 7.2], 12), np.zeros(12)], -1)
    walls = np.array([[[x, y], [x + 20.0, y]] for x in range(-200, 200, 20) for y in (-12.0, 12.0)])
    scene = boxes_scene(pose, np.tile([4.6, 1.8], (12, 1)), np.tile([25.0, 0.0], (12, 1)))
    return scene._replace(walls=walls)


@pytest.mark.parametrize("name", RADARS)
def test_every_rig_gives_a_scan_that_trackers_accept_and_a_source_for_each_detection(name):
    scene = traffic()
    got, origin = scan(find(name), scene)
    assert admit(got, ()).implausible == 0
    M = len(got.mask)
    assert M > 0
    assert got.mask.all()
    assert got.pose.shape == got.noise.shape == (M, 3)
    assert got.velocity.shape == (M, 2)
    for column in (origin.object, origin.body, origin.edge, origin.kind, got.sensor):
        assert column.shape == (M,)
    np.testing.assert_array_equal(origin.object >= 0, origin.kind <= VOLUME)
    assert origin.expected.shape == origin.visible.shape == (12,)
    assert ((origin.visible >= 0) & (origin.visible <= 1)).all()


def test_the_same_seed_gives_the_same_scan_and_another_seed_another():
    a, b, c = (scan(find("surround"), traffic(), seed) for seed in (5, 5, 6))
    for x, y in zip((*a[0], *a[1]), (*b[0], *b[1]), strict=True):
        np.testing.assert_array_equal(x, y)
    assert a[0].polar.shape != c[0].polar.shape or (a[0].polar != c[0].polar).any()


def test_an_empty_scene_gives_empty_arrays():
    got, origin = scan(rig(), boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))))
    assert (got.polar.shape, got.pose.shape, got.velocity.shape) == ((0, 3), (0, 3), (0, 2))
    assert got.platform.shape == (6,)
    assert origin.expected.shape == (0,)


def test_detections_without_noise_lie_on_the_faces_that_look_at_the_sensor():
    pose, size = np.array([20.0, 6.0, 0.4]), np.array([4.6, 1.8])
    got, origin = scan(rig(count_at_15m=400.0, count_max=1e4), boxes_scene(pose, size))
    e = to_frame(pose, got.xy)
    assert len(e) > 300
    np.testing.assert_allclose(np.max(np.abs(e) / (size / 2), -1), 1.0, atol=1e-9)
    assert set(origin.edge) == {0, 1}  # left and rear: the body itself hides its far front and right
    np.testing.assert_array_equal(np.isclose(e[:, 0], -2.3), origin.edge == 1)


def test_a_car_behind_a_truck_gets_nothing_and_is_not_expected():
    scene = boxes_scene([[20.0, 0.0, 0.0], [40.0, 0.0, 0.0]], [[12.0, 2.5], [4.6, 1.8]])
    got, origin = scan(rig(count_at_15m=200.0, count_max=1e4), scene)
    assert (origin.object == 0).all()
    assert origin.expected[1] == 0
    assert origin.visible.tolist() == [1.0, 0.0]
    alone = scan(rig(), boxes_scene([[40.0, 0.0, 0.0]], [[4.6, 1.8]]))[1]
    assert alone.expected[0] > 5


def test_volume_detections_lie_inside_the_body_and_behind_its_surface():
    pose, size = np.array([20.0, 6.0, 0.4]), np.array([4.6, 1.8])
    sensor = rig(count_at_15m=400.0, count_max=1e4, share_volume=0.5, depth_volume=np.inf)
    got, origin = scan(sensor, boxes_scene(pose, size))
    e = np.abs(to_frame(pose, got.xy)) / (size / 2)
    assert (e <= 1 + 1e-9).all()
    assert 0.4 < (origin.kind == VOLUME).mean() < 0.6
    assert (e[origin.kind == VOLUME].max(-1) < 0.999).mean() > 0.9
    np.testing.assert_allclose(e[origin.kind == CONTOUR].max(-1), 1.0, atol=1e-9)


def test_doppler_of_a_turning_target_seen_from_a_turning_ego_is_that_worked_out_by_hand():
    # Sensor at 2 m ahead of a turning ego; the target turns about its centre.
    ego = moving_ego((1.0, 2.0, np.pi / 2), velocity=(0.5, 10.0), yaw_rate=0.3)
    pose, size = np.array([3.0, 30.0, 1.2]), np.array([4.6, 1.8])
    scene = boxes_scene(pose, size, np.array([3.0, 12.0]), np.array([0.5]), ego)
    got, _ = scan(rig(mount=(2.0, 0.0, 0.0)), scene)
    sensor_xy = np.array([1.0, 4.0])  # 2 m along +y
    sensor_v = np.array([0.5 - 0.3 * 2.0, 10.0])  # omega x lever, lever (0, 2): (-omega * 2, 0)
    np.testing.assert_allclose(got.velocity, np.tile(sensor_v, (len(got.mask), 1)), atol=1e-12)
    assert len(got.mask) > 5
    for (r, azimuth, rate), z in zip(got.polar, got.xy, strict=True):
        u = (z - sensor_xy) / np.hypot(*(z - sensor_xy))
        v = np.array([3.0 - 0.5 * (z[1] - 30.0), 12.0 + 0.5 * (z[0] - 3.0)])
        assert rate == pytest.approx(u @ (v - sensor_v), abs=1e-9)
        np.testing.assert_allclose(sensor_xy + r * unit(azimuth + np.pi / 2), z, atol=1e-9)


def test_noise_has_the_spread_of_the_data_sheet():
    scene = boxes_scene([[20.0, 0.0, 0.0]], [[1e-3, 1e-3]])
    sensor = rig(sigma_range=0.3, sigma_azimuth_deg=2.0, sigma_rate=0.2, count_at_15m=3e5, count_max=1e5,
                 spacing_deg=0.0005, fov_deg=1.0)  # fmt: skip
    got, _ = scan(sensor, scene)
    M = len(got.mask)
    assert M > 1000
    error = got.polar - [20.0, 0.0, 0.0]
    np.testing.assert_allclose(error.std(0), got.noise[0], rtol=5 / np.sqrt(2 * M))
    np.testing.assert_allclose(got.noise[0], [0.3, np.radians(2.0), 0.2], rtol=1e-12)


def test_guard_rails_stand_still_over_ground_and_bodies_hide_them():
    ego = moving_ego(velocity=(25.0, 0.0), yaw_rate=0.2)
    walls = np.array([[[5.0, 6.0], [80.0, 6.0]]])
    radar = Radar("test", "", (replace(IDEAL, mount=(1.0, 0.5, 0.3), static_density=20.0),))
    bare = boxes_scene(np.zeros((0, 3)), np.zeros((0, 2)), ego=ego)._replace(walls=walls)
    got, origin = scan(radar, bare)
    assert len(got.mask) > 100
    assert (origin.kind == STATIC).all()
    np.testing.assert_allclose(got.ground_rate, 0.0, atol=1e-9)
    np.testing.assert_allclose(got.xy[:, 1], 6.0, atol=1e-9)
    hidden = boxes_scene([[40.0, 4.0, 0.0]], [[80.0, 1.0]], ego=ego)._replace(walls=walls)
    assert not (scan(radar, hidden)[1].kind == STATIC).any()


@pytest.mark.parametrize(("shape", "variance"), [(np.inf, 9.0), (2.0, 9.0 + 81 / 2), (0.0, 0.0)])
def test_counts_have_the_mean_and_variance_of_their_law(shape, variance):
    n = draw_counts(np.full(40_000, 9.0), np.array(shape), np.random.default_rng(1))
    assert n.mean() == pytest.approx(9.0, abs=5 * np.sqrt(max(variance, 1e-12) / len(n)))
    assert n.var() == pytest.approx(variance, rel=0.06, abs=1e-12)


def test_scans_hold_as_many_detections_as_expected():
    radar = rig(count_at_15m=10.0, count_falloff=0.8, count_shape=2.0, detection_probability=0.7)
    scene = boxes_scene([[25.0, 4.0, 0.3]], [[4.6, 1.8]])
    rng = np.random.default_rng(2)
    looks = [radar.scan(scene, rng) for _ in range(600)]
    n = np.array([len(got.mask) for got, _ in looks])
    assert n.mean() == pytest.approx(looks[0][1].expected[0], abs=4 * n.std() / np.sqrt(len(n)))
    assert (n == 0).mean() > 0.3


def test_farther_narrower_and_partly_hidden_objects_are_expected_to_return_less():
    def expected(pose, size, *more):
        boxes = [(pose, size), *more]
        return scan(rig(count_falloff=0.8), boxes_scene([b[0] for b in boxes], [b[1] for b in boxes]))[1].expected[0]

    car = ([25.0, 0.0, 0.0], [4.6, 1.8])
    side_on = ([25.0, 0.0, np.pi / 2], [4.6, 1.8])
    hider = ([15.0, 1.0, 0.0], [2.0, 1.8])
    assert expected(*side_on) > 1.3 * expected(*car)
    assert expected([60.0, 0.0, 0.0], [4.6, 1.8]) < 0.5 * expected(*car)
    assert 0 < expected(*car, hider) < 0.9 * expected(*car)
    assert expected([25.0, 0.0, 0.0], [2.2, 0.8]) < 0.8 * expected(*car)


def test_nothing_is_seen_outside_the_field_of_view_or_beyond_the_range():
    pose = [[30.0, 0.0, 0.0], [20.0, 20.0, 0.0], [-20.0, 0.0, 0.0], [80.0, 0.0, 0.0]]
    scene = boxes_scene(pose, [[4.6, 1.8]] * 4)
    scene = scene._replace(walls=np.array([[[-100.0, -9.0], [100.0, -9.0]]]))
    got, origin = scan(rig(fov_deg=40.0, max_range=60.0, static_density=20.0), scene)
    assert set(origin.object) == {0, -1}
    assert (np.abs(got.polar[:, 1]) <= np.radians(20) + 1e-9).all()
    assert (got.polar[:, 0] <= 60.5).all()  # a point within the sector of the last ray may lie a little beyond it


def test_clutter_is_uniform_over_area_azimuth_and_doppler_with_the_stated_mean():
    radar = rig(clutter=20_000.0, max_range=80.0, fov_deg=60.0, max_rate=40.0)
    got, origin = scan(radar, boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))))
    assert (origin.kind == CLUTTER).all()
    assert len(got.mask) == pytest.approx(20_000, abs=5 * np.sqrt(20_000))
    x = got.polar / [80.0, np.radians(60.0), 80.0] + [0.0, 0.5, 0.5]
    x[:, 0] **= 2  # the area within the range
    for column in x.T:
        histogram = np.histogram(column, 20, (0, 1))[0]
        assert histogram.sum() == len(column)
        assert ((histogram - len(column) / 20) ** 2 / (len(column) / 20)).sum() < 50  # chi2(19): 1e-4


def test_resolution_cells_merge_returns_and_range_rate_separates_them():
    scene = boxes_scene([[20.0, 0.0, 0.0]], [[4.6, 1.8]], np.array([10.0, 0.0]), np.array([1.0]))
    many = {"count_at_15m": 100.0, "count_max": 1e4}
    n = [len(scan(rig(**many, **cells), scene)[0].mask) for cells in (
        {}, {"cell_range": 50.0, "cell_azimuth_deg": 360.0}, {"cell_range": 50.0, "cell_rate": 0.1},
        {"cell_range": 0.5, "cell_azimuth_deg": 2.0})]  # fmt: skip
    assert n[1] <= 2  # azimuth zero is the border of two cells
    assert n[1] < n[2] < n[0]
    assert n[1] < n[3] < n[0]
    merged = scan(rig(**many, cell_range=50.0), scene)[0]
    assert merged.xy[0] == pytest.approx(scan(rig(**many), scene)[0].xy.mean(0), abs=0.05)


def test_depth_is_exponential_cut_at_the_body_and_uniform_in_the_limit():
    rng, room = np.random.default_rng(0), np.full(20_000, 2.0)
    assert draw_depth(np.full(20_000, 0.1), room, rng).mean() == pytest.approx(0.1, rel=0.04)
    uniform = draw_depth(np.full(20_000, np.inf), room, rng)
    assert (uniform.mean(), uniform.std()) == pytest.approx((1.0, 2 / np.sqrt(12)), rel=0.04)
    assert (draw_depth(np.zeros(5), room[:5], rng) == 0).all()
    assert draw_depth(np.full(20_000, 1.0), room, rng).max() <= 2.0


def test_a_sensor_on_a_vertex_or_inside_a_body_is_no_accident():
    for pose in ([2.0, 1.0, 0.0], [0.0, 0.0, 0.0]):
        got, _ = scan(find("imaging"), boxes_scene([pose], [[4.0, 2.0]]))
        assert admit(got, ()).implausible == 0
    got, _ = scan(rig(share_volume=0.5), boxes_scene([[2.0, 1.0, 0.0]], [[4.0, 2.0]]))
    assert admit(got, ()).implausible == 0
    assert len(got.mask) > 0


@pytest.mark.parametrize("field", ["pose", "velocity", "yaw_rate"])
def test_a_scene_with_nan_is_refused_in_one_sentence(field):
    scene = traffic()
    getattr(scene.bodies, field)[3] = np.nan
    with pytest.raises(ValueError, match=f"scene.bodies.{field} has .* not finite"):
        scan(find("surround"), scene)


@pytest.mark.parametrize(("parameters", "message"), [
    ({"max_range": 0.0}, "max_range must be positive"), ({"fov_deg": 400.0}, "at most 360"),
    ({"share_volume": 1.2}, "within 0 and 1"), ({"clutter": -1.0}, "at least 0"),
    ({"sigma_rate": np.nan}, "sigma_rate"),
])  # fmt: skip
def test_an_impossible_sensor_is_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        Sensor(**parameters)


def test_a_misspelt_rig_gets_the_nearest_name():
    with pytest.raises(LookupError, match="did you mean 'surround'"):
        find("suround")


def test_the_surround_rig_is_the_six_radar_car():
    models = find("surround").models
    assert [round(np.degrees(m.mount[2])) for m in models] == [0, 180, 60, -60, 120, -120]
    assert [m.max_range for m in models] == [174.0] * 2 + [30.0] * 4
    np.testing.assert_allclose(np.degrees([m.fov for m in models]), [20.0] * 2 + [90.0] * 4)


def test_sensors_of_other_rates_and_phases_take_part_in_turn():
    """At 12 scans a second: one sensor in every scan, one at 6 Hz, one at 6 Hz half a period later, one at 5 Hz."""
    turns = ((np.inf, 0.0), (6.0, 0.0), (6.0, 0.5), (5.0, 0.0))
    radar = Radar("turns", "for a test", tuple(replace(IDEAL, rate=r, phase=p) for r, p in turns))
    scans = [
        radar.scan(traffic()._replace(time=k / 12, dt=min(k, 1) / 12), np.random.default_rng(1)) for k in range(13)
    ]
    delivered = np.array([one.delivered for one, _ in scans])
    np.testing.assert_array_equal(delivered[:4], [[1, 1, 0, 1], [1, 0, 1, 0], [1, 1, 0, 0], [1, 0, 1, 1]])
    np.testing.assert_array_equal(delivered[1:].sum(0), [12, 6, 6, 5])
    all_of_them = scan(Radar("all", "for a test", (IDEAL,) * 4), traffic(), 1)
    for (one, origin), due in zip(scans, delivered, strict=True):
        keep = due[all_of_them[0].sensor]
        np.testing.assert_array_equal(np.unique(one.sensor), np.flatnonzero(due))
        np.testing.assert_array_equal(one.polar, all_of_them[0].polar[keep])
        np.testing.assert_allclose(origin.expected, all_of_them[1].expected * due.mean())


@pytest.mark.parametrize(
    ("parameters", "message"), [({"rate": 0.0}, "rate must be positive"), ({"phase": 1.0}, "below 1")]
)
def test_rates_and_phases_that_mean_nothing_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        replace(IDEAL, **parameters)


@pytest.mark.parametrize("sensors", [3, [1], (3,), "front"])
def test_a_rig_is_a_tuple_of_sensors(sensors):
    with pytest.raises(ValueError, match="sensors must be a tuple of Sensor, got"):
        replace(find("front"), sensors=sensors)


@pytest.mark.parametrize(
    ("mount", "words"),
    [
        ((2.35, 0.0, 180.0), r"has the heading 180 rad, more than a turn; it is in rad: for degrees write np\.radians"),
        ((2.35, 0.0, -60.0), "has the heading -60 rad, more than a turn"),
        ((2350.0, 0.0, 0.0), "is 2350 m, 0 m from the vehicle's centre, outside of any vehicle; give metres"),
        ((2.35, 850.0, 0.0), "is 2.35 m, 850 m from"),
        ((2.35, 4.0, 0.0), "is 2.35 m, 4 m from"),
        ((2.35, 0.0), r"must be x, y \[m\] and heading \[rad\]"),
    ],
)
def test_a_mount_off_the_vehicle_or_in_degrees_is_refused(mount, words):
    with pytest.raises(ValueError, match=rf"^sensor\.mount {words}"):
        Sensor(mount=mount)


def test_mounts_of_long_vehicles_and_headings_of_a_turn_are_taken():
    for mount in ((8.3, 1.3, np.pi), (-9.0, -1.3, -np.pi), (0.0, 0.0, 2 * np.pi)):
        assert Sensor(mount=mount).model.mount == mount

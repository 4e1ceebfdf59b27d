import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.log import layers, palette, paths, road_shape
from testbed.log.record import RoadGeometry
from testbed.log.styles import scene_styles
from tests.testbed.log import log_runs
from trackers.scan import SensorModel


@pytest.fixture
def frame():
    return next(log_runs.records(1)).frame


def test_closed_outlines_end_where_they_began():
    strips = layers.Strips.of((np.eye(2), np.arange(6.0).reshape(3, 2)), closed=True)
    assert strips.counts.tolist() == [3, 4]
    assert np.array_equal(strips.xy[[0, 3]], strips.xy[[2, 6]])


MILLIMETRES = st.integers(-50_000, 50_000).map(lambda n: n / 1000)


@given(st.lists(st.tuples(MILLIMETRES, MILLIMETRES), min_size=2, max_size=6))
def test_dashes_lie_on_their_line_and_are_no_longer_than_asked(points):
    line = np.array(points)
    cut = layers.dashes(line, dash=3.0, gap=6.0)
    length = np.hypot(*np.diff(line, axis=0).T).sum()
    assert len(cut) == np.ceil(length / 9.0)
    assert (np.hypot(*(cut[:, 1] - cut[:, 0]).T) <= 3.0 + 1e-9).all()


def test_dashes_of_a_straight_line():
    assert layers.dashes([[0, 0], [20, 0]]).tolist() == [[[0, 0], [3, 0]], [[9, 0], [12, 0]], [[18, 0], [20, 0]]]


def test_confidence_ellipse_holds_95_percent(frame):
    rng = np.random.default_rng(0)
    tracks, info = frame.outputs["htg-map"]
    rows = layers.tracker_rows("htg-map", tracks, info)
    ellipse = rows[paths.tracker("htg-map", "covariance")]["LineStrips2D:strips"]
    radius = np.hypot(*(ellipse.xy[: ellipse.counts[0]] - tracks.estimate.pose[0, :2]).T)
    draws = np.hypot(*rng.normal(0, 0.5, (2, 20_000)))  # the prior has 0.5 m in x and y
    assert np.ptp(radius) < 1e-4
    assert abs((draws < radius[0]).mean() - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 20_000)


def test_tentative_tracks_are_kept_apart(frame):
    tracks, info = frame.outputs["htg-map"]
    tracks = tracks._replace(existence=np.array([0.9, 0.2, 0.9, 0.5, 0.9]))
    rows = layers.tracker_rows("htg-map", tracks, info)
    assert rows[paths.tracker("htg-map", "extent")]["track:id"].tolist() == [100, 102, 104]
    assert len(rows[paths.tracker("htg-map", "tentative")]["LineStrips2D:strips"]) == 2


def test_a_track_without_a_covariance_has_no_ellipse(frame):
    tracks, info = frame.outputs["htg-map"]
    known = tracks._replace(estimate=tracks.estimate._replace(cov=tracks.estimate.cov.copy()))
    known.estimate.cov[0] = np.nan
    counts = [len(layers.tracker_rows("a", t, info)[paths.tracker("a", layer)]["LineStrips2D:strips"])
              for t, layer in ((tracks, "covariance"), (known, "covariance"), (known, "extent"))]  # fmt: skip
    assert counts == [counts[0], counts[0] - 1, counts[0]]


def test_a_contour_is_drawn_where_the_method_has_one(frame):
    tracks, info = frame.outputs["htg-map"]
    contour = np.random.default_rng(0).normal(size=(5, 9, 2))
    tracks = tracks._replace(estimate=tracks.estimate._replace(contour=contour))
    rows = layers.tracker_rows("htg-map", tracks, info)
    strips = rows[paths.tracker("htg-map", "extent")]["LineStrips2D:strips"]
    assert strips.counts.tolist() == [10] * 5
    assert np.array_equal(strips.xy[:9], contour[0].astype(np.float32))


def test_detections_know_object_ids_not_rows(frame):
    ids = np.array([40, 10, 30, 20, 50])
    scene = frame.scene._replace(objects=frame.scene.objects._replace(id=ids))
    rows = layers.detection_rows(frame._replace(scene=scene), frame.outputs)
    seen = np.concatenate([rows[paths.detections(kind)]["radar:object_id"] for kind in ("contour", "volume")])
    assert sorted(set(seen.tolist())) == sorted(ids.tolist())
    assert set(rows[paths.detections("clutter")]["radar:object_id"].tolist()) == {-1}


def test_the_view_keeps_to_the_middle_of_a_straight_road_and_follows_on_a_wide_one(frame):
    wide = RoadGeometry(edges=(np.array([[0.0, -40.0], [0.0, 40.0]]),))
    assert road_shape.strip_middle(log_runs.road(lanes=4)) == 6.0
    assert road_shape.strip_middle(wide) is None
    assert road_shape.strip_middle(RoadGeometry()) is None
    fixed = layers.scene_rows(frame.scene, 6.0)[paths.FOLLOW]["Transform3D:translation"][0]
    free = layers.scene_rows(frame.scene, None)[paths.FOLLOW]["Transform3D:translation"][0]
    assert fixed[1] == 6.0
    assert free[1] == np.float32(frame.scene.ego.pose[1])


def test_fields_of_view_stand_at_their_mounts():
    narrow, ring = layers.fields_of_view(
        (SensorModel(mount=(2.0, 0.5, np.pi / 2), max_range=10.0, fov=0.4), SensorModel(max_range=5.0, fov=2 * np.pi))
    )
    assert np.allclose(narrow[[0, -1]], [2.0, 0.5])
    assert np.allclose(narrow[1:-1].mean(0)[0], 2.0)
    assert narrow[:, 1].max() == pytest.approx(10.5, abs=0.01)
    assert np.allclose(np.hypot(*ring.T), 5.0)


def test_identities_have_stable_colours_and_unassigned_is_grey():
    colors = palette.identity([-1, 0, 1, 0])
    assert colors.dtype == np.uint32
    assert colors[0] == palette.UNASSIGNED
    assert colors[1] == colors[3] != colors[2]


def test_ghosts_have_colours_of_their_own_and_the_size_of_detections_of_vehicles():
    others = [palette.PLAN, palette.EGO, palette.TRUTH, palette.WALL, *(palette.tracker(k) for k in range(6))]
    colours = [*palette.DETECTION.values(), *others]
    assert len(set(colours)) == len(colours)
    radii = {path: style.radii.as_arrow_array()[0].as_py() for path, style in scene_styles() if "detections" in path}
    assert radii[paths.detections("mirror")] == radii[paths.detections("double")] == radii[paths.detections("contour")]
    assert radii[paths.detections("clutter")] < radii[paths.detections("mirror")]


def test_names_that_would_need_escapes_are_refused():
    assert paths.tracker("rm-feldmann", "extent") == "world/trackers/rm-feldmann/extent"
    for name in ("", "a b", "a/b", "__reserved"):
        with pytest.raises(ValueError, match="cannot be part of a log path"):
            paths.part(name)


def test_outlines_and_names_are_dimmed_by_what_is_visible(frame):
    N = len(frame.scene.objects.id)
    visible = np.linspace(0.0, 1.0, N)
    rows = layers.scene_rows(frame.scene, visible=visible)
    for path, component in (
        (paths.TRUTH_CONTOUR, "LineStrips2D:colors"),
        (paths.TRUTH_HEADING, "Arrows2D:colors"),
        (paths.TRUTH_NAMES, "Points2D:colors"),
    ):
        red = rows[path][component] >> np.uint32(24)
        assert (np.diff(red.astype(int)) > 0).all()
        assert rows[path][component][-1] == palette.TRUTH
        assert palette.GROUND >> 24 < red[0] < 100


def test_names_stand_above_the_box_and_ids_of_later_trackers_below_those_of_earlier_ones(frame):
    objects = frame.scene.objects
    name, (tracks, info) = next(iter(frame.outputs.items()))
    names = layers.scene_rows(frame.scene)[paths.TRUTH_NAMES]
    assert names["Points2D:labels"][1] == "veh_01 car"
    assert (names["Points2D:positions"][:, 1] < objects.pose[:, 1] - objects.size[:, 1] / 2).all()
    first, second = (layers.tracker_rows(name, tracks, info, index=i)[paths.tracker(name, "label")] for i in (0, 1))
    assert first["Points2D:labels"] == second["Points2D:labels"]
    bottom = (tracks.reported.estimate.pose[:, 1] + tracks.reported.estimate.size[:, 1] / 2).astype(np.float32)
    assert (first["Points2D:positions"][:, 1] > bottom).all()
    assert (second["Points2D:positions"][:, 1] > first["Points2D:positions"][:, 1] + 1).all()


def test_the_overview_stays_in_the_middle_of_a_small_map_and_before_its_ends():
    line = lambda x, y: RoadGeometry(edges=(np.array([[0.0, 0.0], [x, y]]),))  # noqa: E731
    assert road_shape.fixed_middle(line(400.0, 47.0)) == (None, 23.5)
    assert road_shape.fixed_middle(line(60.0, 60.0)) == (30.0, 30.0)
    assert road_shape.fixed_middle(line(400.0, 200.0)) == (None, None)
    assert road_shape.overview_at(line(400.0, 47.0), np.array([150.0, 3.0])) == (150.0, 23.5)
    assert road_shape.overview_at(line(400.0, 47.0), np.array([390.0, 3.0])) == (247.5, 23.5)  # nothing beyond the end
    assert road_shape.overview_at(line(400.0, 200.0), np.array([390.0, 3.0])) == (390.0, 3.0)
    at = layers.overview_row((150.0, 23.5))[paths.OVERVIEW]["Transform3D:translation"][0]
    assert at == pytest.approx([150.0, 23.5, 0.0])

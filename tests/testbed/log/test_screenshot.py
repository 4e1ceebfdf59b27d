import io
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from testbed.command_line.terminal import LONGEST
from testbed.evaluation.metric import PAIR, SCAN, keys
from testbed.log import blueprint, paths, reader, screenshot
from testbed.log.record import RoadGeometry
from testbed.log.review import check, middle, review, unfinished_hint
from tests.testbed.log import log_runs

META = log_runs.META
METRICS = {name: tuple(score.mean) for name, score in next(log_runs.records(1)).scores.items()}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return log_runs.write(tmp_path_factory.mktemp("log") / "run.rrd", steps=40)


def views(part):
    """All views below a container."""
    if hasattr(part, "class_identifier"):
        return [part]
    return [view for child in part.contents for view in views(child)]


def all_views(full=True):
    layout = blueprint.layout(META, METRICS, (2,), log_runs.road(), full=full)
    return views(layout.root_container)


def paths_of(view):
    queries = view.contents if isinstance(view.contents, list | tuple) else [view.contents]
    named = [q[2:] for q in queries if q.startswith(("+", "-"))]
    return {p.strip("/") for p in [view.origin, *named, *view.visualizer_overrides] if p.strip("/")}


@pytest.mark.parametrize("full", [True, False])
def test_every_path_of_the_layout_is_in_the_log(log, full):
    known = reader.entity_paths(log)
    prefixes = {p.rsplit("/", n)[0] for p in known for n in range(4)}
    once = {paths.tracker(name, layer) for name in META.trackers for layer in paths.CHANGE_LAYERS}  # contours change
    for view in all_views(full):
        for path in paths_of(view):
            assert path.removesuffix("/**") in known | prefixes | once, f"{view.name}: {path}"


def test_every_tracker_and_metric_has_its_view():
    names = [str(view.name) for view in all_views()]
    for tracker in META.trackers:
        assert f"Only {tracker}: association" in names
    for metric in ("gwd", "gospa", "box_iou"):
        assert blueprint.title(metric) in names


def test_level_metrics_has_no_scene():
    assert not [view for view in all_views(full=False) if view.origin == f"/{paths.FOLLOW}"]


@pytest.mark.parametrize(
    ("length", "width", "overview"),
    [
        (400.0, 12.0, (-97.5, 162.5, -14, 14)),
        (400.0, 45.0, (-97.5, 162.5, -30.5, 30.5)),
        (900.0, 95.0, (-97.5, 162.5, -22, 22)),
        (200.0, 200.0, (-65, 65, -65, 65)),
    ],
)
def test_the_overview_fits_the_shape_of_the_road(length, width, overview):
    road = RoadGeometry(edges=(np.array([[0.0, 0.0], [length, width]]),))
    first = views(blueprint.layout(META, METRICS, (), road, full=True).root_container)[0]
    bounds = first.properties["VisualBounds2D"].range.as_arrow_array().to_pylist()[0]
    assert [*bounds["x_range"], *bounds["y_range"]] == pytest.approx(overview)


@pytest.mark.skipif(bool(screenshot.renderer_missing()), reason=screenshot.renderer_missing() or "drawn here")
def test_the_viewer_draws_the_log_without_a_complaint(log, tmp_path, capfd):
    assert screenshot.render(log, tmp_path / "deep" / "run.png", at=2.0, settle=4.0) == []
    assert capfd.readouterr() == ("", "")  # the viewer's own lines stay with it
    image = Image.open(io.BytesIO((tmp_path / "deep" / "run.png").read_bytes())).convert("RGB")
    colors = {color for _, color in image.getcolors(maxcolors=2**24)}
    assert image.width >= 1280
    for wanted in ((0xFF, 0xA6, 0x29), (0x38, 0xCF, 0xFF), (0xFF, 0xFF, 0xFF)):  # both trackers and the ego
        assert min(sum(abs(a - b) for a, b in zip(c, wanted, strict=True)) for c in colors) < 12


def test_a_view_is_found_by_its_name_or_by_how_it_begins():
    views = {"Overview (follows the ego)": "a", "GWD [m]": "b", "Events": "c", "Ego action": "d", "Ego speed": "e"}
    assert screenshot.find_view(views, "overview") == "a"
    assert screenshot.find_view(views, "gwd [m]") == "b"
    with pytest.raises(ValueError, match="no view 'close'; there are Ego action, Ego speed, Events"):
        screenshot.find_view(views, "close")
    with pytest.raises(ValueError, match=r"more than one view 'ego'; there are Ego action; Ego speed$"):
        screenshot.find_view(views, "ego")


def test_the_names_of_many_views_are_told_within_a_sentence():
    metrics = [blueprint.title(name) for name in (*keys(PAIR), *keys(SCAN))]
    objects = [f"veh_{i:02d}: {name}" for i in range(3) for name in metrics]
    views = dict.fromkeys(
        ["Overview (follows the ego, 2 s trails)", *metrics, *objects, "Only imm-spline: association"], ""
    )
    with pytest.raises(ValueError, match=r"Only imm-spline, Overview, box IoU.*, veh_00, veh_01, veh_02") as told:
        screenshot.find_view(views, "nothing")
    assert len(str(told.value)) < LONGEST


def test_missing_renderer_is_one_sentence(log, tmp_path, monkeypatch):
    monkeypatch.setattr(screenshot, "_DRIVERS", (str(tmp_path),))
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(screenshot.NoRenderer, match="no Vulkan driver is installed"):
        review([log], png=tmp_path / "run.png")


def test_pictures_are_taken_in_the_middle_of_a_run(log):
    assert middle(log) == pytest.approx(39 * log_runs.DT / 2)


def test_the_command_opens_all_logs_and_serves_this_machine_only(log):
    command = screenshot.viewer_command([log, log], web=True)
    assert command[-2:] == [str(log)] * 2
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    version = subprocess.run([command[0], "--version"], capture_output=True, text=True, timeout=30, check=True)
    assert re.search(r"0\.41", version.stdout)


def test_review_says_what_is_missing(log, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="at least one log"):
        review([])
    with pytest.raises(FileNotFoundError, match=r"there is no log .*none\.rrd"):
        review([tmp_path / "none.rrd"])
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(OSError, match="there is no display; use --web"):
        review([log])


@pytest.mark.parametrize(
    ("png", "at", "message"),
    [
        (None, 1.0, "--at 1, goes with --screenshot only"),
        ("a.jpg", 1.0, "is a .png file, got a.jpg"),
        ("a.png", 99.0, "must lie within the run, 0 to 2.6 s, got 99 s"),
    ],
)
def test_impossible_pictures_are_refused(log, png, at, message):
    with pytest.raises(ValueError, match=message):
        check([log], png, at)


def test_a_view_goes_with_a_picture_only(log):
    with pytest.raises(ValueError, match="--view 'overview' goes with --screenshot only"):
        check([log], view="overview")


def test_the_hint_for_a_killed_run_repairs_it(tmp_path):
    from testbed.log import RunLog

    log = RunLog(tmp_path / "a.rrd", META, every=1)
    for record in log_runs.records(3):
        log.step(*record)
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(log.file.read_bytes())
    log.close()
    assert not reader.complete(cut)
    command = re.search(r"`rerun (.*?)`", unfinished_hint(cut))[1].split()
    subprocess.run([screenshot.viewer_command([])[0], *command], check=True, capture_output=True, timeout=60)
    assert reader.complete(tmp_path / "cut-repaired.rrd")
    assert len(reader.steps(tmp_path / "cut-repaired.rrd")) == 3

"""A copy of a log with another vehicle in focus."""

import pytest

from testbed.log import RunLog, paths, reader, review
from testbed.log.review import check
from tests.testbed.log import log_content, log_runs
from tests.testbed.log.test_screenshot import views


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return log_runs.write(tmp_path_factory.mktemp("log") / "run.rrd", steps=8)


def plots(path, key):
    """The pages of plots in the layout, and the number of the open one."""
    *_, closer, _ = review.focused(path, key).root_container.contents
    return closer.contents[1]


def test_the_copy_holds_the_same_and_its_only_layout_shows_the_vehicle_first(log, tmp_path):
    from rerun.chunk import RrdReader

    copy = review.write_focused(log, 3, tmp_path / "copy.rrd")
    assert log_content.digest(copy) == log_content.digest(log)
    assert reader.properties(copy) == reader.properties(log)
    assert reader.complete(copy)
    (layout,) = RrdReader(copy).blueprints()
    batches = [chunk.to_record_batch() for chunk in RrdReader(copy).stream(store=layout).to_chunks()]
    names = [name for b in batches if "ViewBlueprint:display_name" in b.schema.names
             for name in b["ViewBlueprint:display_name"].to_pylist()]  # fmt: skip
    assert ["veh_03: GWD [m]"] in names
    assert not [name for name in names if name and name[0].startswith("veh_02")]


def test_the_page_of_the_vehicle_is_open_and_the_rest_of_the_layout_is_that_of_the_log(log):
    tabs = plots(log, 3)
    assert [page.name for page in tabs.contents][2:] == ["More", "Focus", "Objects"]
    assert tabs.active_tab == 3
    names = {str(view.name) for view in views(review.focused(log, 3).root_container)}
    assert {"Overview (follows the ego, 2 s trails)", "GWD [m]", "GOSPA [m]"} <= names
    known = reader.entity_paths(log)
    for view in views(tabs):
        for path in view.visualizer_overrides:
            assert path.strip("/") in known


def test_the_vehicles_of_the_worst_moments_follow(tmp_path):
    path = tmp_path / "run.rrd"
    with RunLog(path, log_runs.META) as run:
        for record in log_runs.records(2):
            run.step(*record)
        moment = {"time": 1.0, "kind": "car", "what": "lost", "text": "", "why": "", "tracker": "a", "severity": 1.0}
        run.tables([moment | {"object": 4}], [])
    assert [page.name for page in plots(path, 1).contents[3].contents] == ["veh_01", "veh_04"]


def test_a_vehicle_that_is_not_there_is_refused_with_those_that_are(log, tmp_path):
    with pytest.raises(ValueError, match=r"--focus: the log .*run.rrd has no vehicle 77; it has 0, 1, 2, 3, 4$"):
        review.write_focused(log, 77, tmp_path / "copy.rrd")
    assert not list(tmp_path.iterdir())


def test_a_focus_is_of_one_log(log):
    with pytest.raises(ValueError, match="--focus shows one log, got 2"):
        check([log, log], focus=3)


def test_a_log_of_level_metrics_has_a_focus_too(tmp_path):
    path = log_runs.write(tmp_path / "run.rrd", steps=8, level="metrics")
    shown = views(review.focused(path, 3).root_container)
    assert "veh_03: GWD [m]" in [str(view.name) for view in shown]
    assert not [view for view in shown if view.origin == f"/{paths.FOLLOW}"]

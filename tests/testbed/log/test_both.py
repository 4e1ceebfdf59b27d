"""Two logs in one page and in one log of the viewer."""

import json
import re

import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.log import both, paths
from testbed.log.reader import entity_paths, scalars
from testbed.log.review_page.both import together
from testbed.log.review_page.contents import contents
from testbed.log.review_page.page import write

HOME = ["run", "passed", "--duration", "0.6", "--out"]


def made(folder, *options):
    done = CliRunner().invoke(app, [*HOME, str(folder), *options])
    assert done.exit_code == 0, done.output
    return next(folder.glob("*.rrd"))


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Of one drive by two trackers, as the planner that knows the truth drives it, and of another planner."""
    folder = tmp_path_factory.mktemp("both")
    truth = ["--planner", "truth"]
    return {
        "koch": made(folder / "koch", "--tracker", "rm-koch", *truth),
        "feldmann": made(folder / "feldmann", "--tracker", "rm-feldmann", *truth),
        "other": made(folder / "other", "--tracker", "rm-koch", "--planner", "idle", "--seed", "1"),
    }


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="run">(.*?)</script>', page.read_text(), re.S)[1])


def test_of_one_drive_all_trackers_stand_in_one_scene(logs, tmp_path):
    page = write([logs["koch"], logs["feldmann"]], tmp_path / "page.html")
    data, alone = data_of(page), contents(logs["feldmann"])
    names = [tracker["name"] for tracker in data["trackers"]]
    assert names[:1] + names[2:3] == ["truth of " + logs["koch"].stem, "truth of " + logs["feldmann"].stem]
    assert {"rm-koch", "rm-feldmann"} <= {*names}
    assert len({tracker["color"] for tracker in data["trackers"]}) == len(names)
    where = names.index("rm-feldmann"), [t["name"] for t in alone["trackers"]].index("rm-feldmann")
    for now, before in zip(data["trackers"][where[0]]["tracks"], alone["trackers"][where[1]]["tracks"], strict=True):
        for (id_, shape, *place), (id_alone, shape_alone, *place_alone) in zip(now, before, strict=True):
            assert (id_, place) == (id_alone, place_alone)
            assert data["shapes"][shape] == alone["shapes"][shape_alone]


def test_other_drives_stand_side_by_side(logs, tmp_path):
    assert len(together([logs["koch"], logs["other"]])) == 2
    page = write([logs["koch"], logs["other"]], tmp_path / "page.html").read_text()
    assert page.count("<iframe") == page.count("</iframe>") == 2
    assert "passed, seed 0 and passed, seed 1" in page
    with pytest.raises(ValueError, match="one or two logs, got 3"):
        write([*logs.values()], tmp_path / "page.html")


def test_the_legend_comes_before_the_moments_and_values_name_their_tracker(logs, tmp_path):
    page = write(logs["koch"], tmp_path / "page.html").read_text()
    assert page.index("<h2>Legend</h2>") < page.index("<h2>Worst moments</h2>")
    assert "run.trackers[i].name" in page


def test_the_viewer_gets_both_on_one_time_line(logs, tmp_path):
    path = both.write([logs["koch"], logs["other"]], tmp_path / "both.rrd")
    there = entity_paths(path)
    for side, log in zip(both.SIDES, (logs["koch"], logs["other"]), strict=True):
        assert {f"{side}/{entity}" for entity in entity_paths(log)} <= there
        steps, values = scalars(path, f"{side}/{paths.EGO_SPEED}")[f"{side}/{paths.EGO_SPEED}"]
        alone = scalars(log, paths.EGO_SPEED)[paths.EGO_SPEED]
        assert (steps.tolist(), values.tolist()) == (alone[0].tolist(), alone[1].tolist())


def test_the_command_takes_two(logs, tmp_path):
    two = [str(logs["koch"]), str(logs["feldmann"])]
    done = CliRunner().invoke(app, ["review", *two, "--html", str(tmp_path / "p.html")])
    assert done.exit_code == 0, done.output


def test_diff_of_two_trackers_puts_measures_side_by_side_and_then_the_first_difference(logs):
    done = CliRunner().invoke(app, ["diff", str(logs["koch"]), str(logs["feldmann"])])
    assert done.exit_code == 1
    assert "GOSPA [m]" in done.output
    assert "the runs part at step" in done.output
    assert "nothing" not in done.output
    done = CliRunner().invoke(app, ["diff", *(str(logs[k].with_suffix(".json")) for k in ("koch", "feldmann"))])
    assert "GOSPA [m]" in done.output
    assert "nothing" not in done.output

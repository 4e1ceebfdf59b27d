"""`testbed regret` as a user meets it."""

import re
from xml.etree.ElementTree import parse

import pandas as pd
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.log import reader
from tests.testbed.command_line.refused import refused

ASKED = ["regret", "probe-brake", "--planner", "idle", "--tracker", "rm-koch", "--seeds", "0:3", "--duration", "0.4"]

WHOLE = [*ASKED, "--attribute", "--inject", "velocity_lag=0.5"]


def refused_here(out, *args):
    """The sentence with which `testbed regret` is refused that writes to a folder."""
    return refused("regret", "probe-brake", "--out", out, *args)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["probe-brak"], "did you mean 'probe-brake'?"),
        (["probe-brake:gab=3"], "probe-brake has no parameter gab; it has gap"),
        (["probe-brake:gap=300"], "gap must be a number from"),
        (["probe-brake:gap"], "has 'gap' where a parameter is due; write NAME:key=value"),
        (["--planner", "imd"], "did you mean 'idm'?"),
        (["--planner", "truth"], "planner truth has no regret"),
        (["--tracker", "htg-mapp"], "did you mean 'htg-map'?"),
        (["--tracker", "in-view"], "in-view is no tracker"),
        (["--inject", "lag=1"], "names are velocity_lag"),
        (["--inject", "latency=1", "--inject", "latency=1"], "inject must differ"),
        (["--radar", "frnt"], "did you mean 'front'?"),
        (["--jobs", "0"], "jobs must be 1 or more"),
        (["probe-brake"], "scenarios must differ"),
    ],
)
def test_wrong_input_is_one_sentence(tmp_path, args, sentence):
    assert sentence in refused_here(tmp_path, *args)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A small study: its folder and what the command said."""
    out = tmp_path_factory.mktemp("regret")
    done = CliRunner().invoke(app, [*WHOLE, "--junit", str(out / "regret.xml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out, done


def test_the_drives_are_in_one_table_and_the_same_command_finds_them(first):
    out, done = first
    assert "31 runs made, 0 found, 0 failed" in done.output  # 3 x (truth, in-view, tracker, 6 subsets, 1 dose) + 1
    table = pd.read_parquet(out / "drives.parquet")
    assert len(table) == 31
    assert table["drive_score"].notna().all()
    again = CliRunner().invoke(app, [*WHOLE, "--out", str(out)])
    assert "0 runs made, 31 found, 0 failed" in again.output


def test_drives_of_other_settings_are_refused(first):
    assert "holds runs with duration 0.4, wanted is None" in refused_here(first[0])


def test_the_page_has_all_its_parts_and_its_links_lead_somewhere(first):
    out, done = first
    page = (out / "report.html").read_text()
    ids = set(re.findall(r'id="([^"]+)"', page))
    links = re.findall(r'(?:href|src)="([^"]+)"', page)
    assert {"overview", "total", "tracking", "sensing", "attribution", "doses", "worst"} <= ids
    assert [link for link in links if link.startswith("#") and link[1:] not in ids] == []
    assert [link for link in links if not link.startswith("#") and not (out / link).exists()] == []
    assert "existence" in page
    assert "velocity_lag=0.5" in page


def test_junit_has_a_case_a_scenario_and_the_self_test(first):
    out, _ = first
    root = parse(out / "regret.xml").getroot()
    assert [suite.get("name") for suite in root] == ["idle rm-koch", "idle in-view+velocity_lag=0.5", "drives"]
    assert [case.get("name") for case in root[0]] == ["probe-brake"]
    assert [case.get("classname") for case in root[2]] == ["regret.self-test"]
    assert root[2].get("failures") == "0"


def test_the_worst_pair_is_one_log_with_both_drives_on_one_timeline(first):
    (log,) = (first[0] / "logs").glob("*rm-koch*.rrd")
    assert reader.complete(log)
    drawn = {path.strip("/") for path in reader.entity_paths(log)}
    assert {"truth/world/truth/contour", "tracks/world/trackers/tracks/extent"} <= drawn
    curves = reader.scalars(log, "drive/speed/**")
    assert [len(steps) for steps, _ in curves.values()] == [22, 22]  # 1.4 s at 15 Hz, with the first
    assert reader.span(log) == (0.0, pytest.approx(1.4))

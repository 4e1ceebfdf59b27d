"""The page of a run: what it holds is what was logged, it needs nothing from elsewhere, and it works in a browser."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from sensors.origin import KINDS
from testbed.frame import FrameScore
from testbed.log import RunLog
from testbed.log.review_page.contents import Shapes, contents, ring_at
from testbed.log.review_page.page import write
from tests.testbed.log import log_runs

STEPS = 25
MOMENT = {
    "time": 1.0, "start": 0.8, "end": 1.3, "tracker": "htg-map", "object": 2, "kind": "car", "track": 102,
    "what": "lost", "text": "without a track", "cause": "hidden", "why": "hidden by veh_01", "severity": 12.5,
}  # fmt: skip
FALSE = MOMENT | {"object": None, "track": 7, "what": "ghost", "time": 0.2, "severity": 1.5}
OBJECT = dict.fromkeys(
    ("birth_delay", "gwd", "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width"), 0.5
)
OBJECTS = [
    OBJECT | {"object": i, "tracker": "htg-map", "kind": "car", "severity": h, "scans_counted": n, "scans_missed": 3,
              "lost": 1, "switches": i, "gwd": None if i == 3 else 0.1 * i}
    for i, h, n in ((1, 0.5, 20), (2, 12.5, 20), (3, 0.0, 20), (4, 0.0, 0))
]  # fmt: skip
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
META = log_runs.META._replace(scenario="</script><b>made")


def written(path, level="full"):
    with RunLog(path, META, level=level) as log:
        log.static(log_runs.road(), log_runs.SENSORS)
        for record in log_runs.records(STEPS):
            log.step(*record)
        log.tables([MOMENT, FALSE], OBJECTS)
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return written(tmp_path_factory.mktemp("page") / "run.rrd")


@pytest.fixture(scope="module")
def page(log):
    return write(log, log.with_suffix(".html"))


@pytest.fixture(scope="module")
def data(page):
    return json.loads(re.search(r'<script type="application/json" id="run">(.*?)</script>', page.read_text(), re.S)[1])


def test_a_shape_that_moves_and_turns_is_kept_once_and_one_that_grows_anew():
    shapes, box = Shapes(), np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0], [2.0, 1.0]])
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    rings = [box + np.array([100.0, 5.0]), box @ turn.T + [123.456, -7.0], 1.1 * box, box[:4]]
    placed = [shapes.place("a", ring) for ring in rings]
    assert [p[0] for p in placed] == [0, 0, 1, 2]
    for ring, (number, *where) in zip(rings, placed, strict=True):
        assert ring_at(shapes.found[number], *where) == pytest.approx(ring, abs=0.02)
    assert shapes.place("b", box)[0] == 3  # another's is not used


def test_the_page_holds_the_truth_the_tracks_and_the_detections_of_every_scan(data):
    assert len(data["time"]) == STEPS
    for k, record in enumerate(log_runs.records(STEPS)):
        frame = record.frame
        assert data["time"][k] == pytest.approx(frame.time, abs=1e-3)
        outlines = dict(zip(frame.scene.objects.id.tolist(), frame.scene.bodies.outline, strict=True))
        assert [body[0] for body in data["truth"][k]] == list(outlines)
        for key, visible, shape, *where in data["truth"][k]:
            assert visible == 70
            assert ring_at(data["shapes"][shape], *where)[:-1] == pytest.approx(outlines[key], abs=0.025)
        for tracker in data["trackers"]:
            tracks = frame.outputs[tracker["name"]][0].reported
            assert [row[0] for row in tracker["tracks"][k]] == tracks.id.tolist()
        keep = frame.scan.mask
        counts = np.bincount(frame.origin.kind[keep], minlength=len(KINDS))
        assert [len(flat) // 2 for flat in data["detections"][k]] == counts.tolist()
        shape, *where = data["ego"][k]
        assert ring_at(data["shapes"][shape], *where)[:-1] == pytest.approx(frame.scene.ego.outline, abs=0.025)


def test_errors_names_events_and_lists_are_there(data):
    records = list(log_runs.records(STEPS))
    first, second = data["trackers"]
    for k, record in enumerate(records):
        score = record.scores["htg-map"]
        assert second["means"]["gwd"][k] == pytest.approx(score.mean["gwd"], abs=0.0051)
        for i in (0, 2):
            expected = score.errors[i]["gwd"] if i in score.errors else None
            assert second["of"][str(i)]["gwd"][k] == (None if expected is None else pytest.approx(expected, abs=0.0051))
    assert any(v is None for v in second["of"]["2"]["gwd"])  # lost for a while
    assert data["names"]["3"] == "veh_03 car"
    assert first["color"] != second["color"]
    assert [m["what"] for m in data["moments"]] == ["lost", "ghost"]
    assert [row["object"] for row in data["objects"]] == [1, 2, 3]  # the one that never counted is left out
    assert "DEBUG" not in {level for _, level, _ in data["events"]}
    assert len({kind["color"] for kind in data["kinds"]}) == len(KINDS)


def test_nothing_is_loaded_from_elsewhere_and_texts_cannot_end_the_script(page):
    text = page.read_text()
    assert not re.search(r"https?:|<link|\bsrc=|@import|url\(|fetch\(|XMLHttp|import\(", text)
    assert text.count("</script>") == 2
    assert "<title>&lt;/script&gt;&lt;b&gt;made, seed 0</title>" in text
    assert "{{" not in text


def test_twenty_seconds_would_be_less_than_three_megabytes(page):
    assert page.stat().st_size / STEPS * 300 < 3e6


def test_a_log_of_numbers_makes_a_page_without_a_scene(tmp_path):
    found = contents(written(tmp_path / "numbers.rrd", "metrics"))
    assert found["ego"] == []
    assert found["names"]["2"] == "veh_02 car"
    assert len(found["trackers"][0]["means"]["gwd"]) == STEPS
    assert found["moments"]


def test_a_log_without_moments_says_why(tmp_path):
    def reason(records, *tables):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.rrd"
        with RunLog(path, META) as log:
            log.static(log_runs.road(), log_runs.SENSORS)
            for record in records:
                log.step(*record)
            if tables:
                log.tables(*tables)
        return contents(path)["no_moments"]

    records = list(log_runs.records(2))
    blind = [record._replace(scores=dict.fromkeys(record.scores, FrameScore({}, {}, {}))) for record in records]
    assert reason(records, [], []).startswith("Nothing went wrong")
    assert reason(records).startswith("The run was interrupted")
    assert reason(blind).startswith("This log has no truth")


def test_other_files_are_refused(log, tmp_path):
    with pytest.raises(ValueError, match=r"a page is an \.html file, got .*\.png"):
        write(log, tmp_path / "a.png")
    (tmp_path / "a.rrd").write_text("no log")
    with pytest.raises(ValueError, match="is not a review log"):
        write(tmp_path / "a.rrd", tmp_path / "a.html")


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.parametrize("name", ["scene.js", "page.js"])
def test_the_program_has_no_fault_of_syntax(name):
    file = Path(__file__).parents[4] / "testbed" / "log" / "review_page" / name
    subprocess.run(["node", "--check", file], check=True, capture_output=True, timeout=60)


PROBE = """
<script>
const seen = {};
const press = (key) => document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
const drawn = () => [...el("scene").getContext("2d").getImageData(0, 0, el("scene").width, el("scene").height).data]
  .reduce((sum, v, i) => sum + (i % 4 === 3 && v > 0), 0);
seen.ready = document.body.dataset.ready; seen.first = view.frame; seen.drawn = drawn();
press("ArrowRight"); press("ArrowRight"); press("ArrowLeft"); seen.stepped = view.frame;
press("End"); seen.end = view.frame; press("ArrowRight"); seen.beyond = view.frame;
el("moments").querySelector("button").click();
seen.time = run.time[view.frame]; seen.follow = el("follow").value; seen.whose = el("whose").value;
const order = () => [...el("objects").tBodies[0].rows].map((r) => r.cells[0].textContent.slice(0, 6));
seen.sorted = order(); el("objects").querySelectorAll("th button")[7].click(); seen.switches = order();
el("objects").querySelectorAll("th button")[7].click(); seen.up = order();
el("objects").querySelectorAll("th button")[8].click(); seen.gwd = order();
seen.charts = [...document.querySelectorAll("figure")].filter((f) => !f.hidden).length;
document.querySelector("#layers input").click(); seen.hidden = drawn();
seen.wide = document.documentElement.scrollWidth <= window.innerWidth; seen.width = window.innerWidth;
document.title = JSON.stringify(seen);
</script>
"""


def probed(page, probe, width, tmp_path):
    """What a program finds on the page in the browser."""
    target = tmp_path / "probe.html"
    target.write_text(page.read_text().replace("</body>", probe + "</body>"))
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    command += [f"--window-size={width},900", "--dump-dom", target.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    return json.loads(re.search(r"<title>(.*?)</title>", dom, re.S)[1])


NUMBERS_PROBE = """
<script>
const there = (node) => node.getClientRects().length > 0;
const ticks = [];
const write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
  ticks.push(text);
  write.call(this, text, ...rest);
};
el("moments").querySelector("button").click();
document.title = JSON.stringify({
  controls: [...document.querySelectorAll("button[id], select, input, canvas[id]")].filter(there).map((n) => n.id),
  whose: el("whose").selectedOptions[0].textContent, boxes: document.querySelectorAll("#layers input").length,
  long: ticks.filter((t) => t.length > 5),
});
</script>
"""


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed; on Debian the package chromium")
def test_in_a_browser_a_page_of_numbers_has_no_control_of_a_scene(tmp_path):
    page = write(written(tmp_path / "numbers.rrd", "metrics"), tmp_path / "numbers.html")
    seen = probed(page, NUMBERS_PROBE, 1400, tmp_path)
    assert seen["controls"] == ["back", "play", "next", "time", "speed", "whose"]
    assert seen["whose"] == "veh_02 car"
    assert seen["boxes"] == 0
    assert seen["long"] == []  # ticks of 1e-9 would be cut off


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed; on Debian the package chromium")
@pytest.mark.parametrize("width", [1400, 400])
def test_in_a_browser_keys_moments_and_columns_work_and_the_page_fits(page, tmp_path, width):
    seen = probed(page, PROBE, width, tmp_path)
    assert (seen["ready"], seen["first"], seen["stepped"]) == ("yes", 0, 1)
    assert seen["end"] == seen["beyond"] == STEPS - 1
    assert seen["time"] == pytest.approx(1.0, abs=0.07)
    assert (seen["follow"], seen["whose"]) == ("veh2", "2")
    assert seen["sorted"] == ["veh_02", "veh_01", "veh_03"]
    assert seen["switches"] == ["veh_03", "veh_02", "veh_01"] == seen["up"][::-1]
    assert seen["gwd"] == ["veh_02", "veh_01", "veh_03"]  # what was not measured comes last
    assert seen["charts"] > 3
    assert 0 < seen["hidden"] < seen["drawn"]
    assert seen["wide"], f"the page is wider than {seen['width']} px"

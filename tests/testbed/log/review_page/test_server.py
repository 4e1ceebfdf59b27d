"""The server of a folder of results: what it shows, and what it does not."""

import os
from http.client import HTTPConnection
from threading import Thread

import pytest

from testbed.log import RunLog
from testbed.log.review_page.server import LOOPBACK, linked, server
from tests.testbed.log import log_runs

REPORT = '<p>verdict</p><a href="logs/a%20b.rrd">rrd</a>'


@pytest.fixture
def folder(tmp_path):
    logs = tmp_path / "out" / "logs"
    logs.mkdir(parents=True)
    with RunLog(logs / "a b.rrd", log_runs.META, level="full") as log:
        log.static(log_runs.road(), log_runs.SENSORS)
        for record in log_runs.records(3):
            log.step(*record)
    (logs / "bad.rrd").write_bytes(b"no log")
    (tmp_path / "out" / "report.html").write_text(REPORT)
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "out" / "link").symlink_to(tmp_path / "secret")
    return tmp_path / "out"


@pytest.fixture
def get(folder, tmp_path):
    """get(path) -> status, text."""
    (tmp_path / "made").mkdir()
    with server(folder, tmp_path / "made") as listening:
        thread = Thread(target=listening.serve_forever)
        thread.start()

        def ask(path, host=None, method="GET"):
            connection = HTTPConnection(*listening.server_address[:2], timeout=30)
            connection.request(method, path, headers={"Host": host} if host else {})
            answer = connection.getresponse()
            return answer.status, answer.read().decode(errors="replace")

        ask.address = listening.server_address
        yield ask
        listening.shutdown()
        thread.join()


def test_it_listens_on_the_loopback_address_alone(get):
    assert get.address[0] == LOOPBACK
    assert get.address[1] > 0


@pytest.mark.parametrize("path", ["/", "/report.html"])
def test_the_report_leads_to_the_page_of_every_log(get, path):
    status, text = get(path)
    assert status == 200
    assert '<a href="logs/a%20b.html">page</a> <a href="logs/a%20b.rrd">rrd</a>' in text


def test_the_page_of_a_log_is_made_once_when_it_is_asked_for_and_not_in_the_folder(get, folder, tmp_path):
    before = sorted(folder.rglob("*"))
    assert not list((tmp_path / "made").iterdir())
    status, text = get("/logs/a%20b.html#t=1")
    assert status == 200
    assert 'id="run"' in text
    assert get("/logs/a%20b.html?again") == (200, text)
    assert len(list((tmp_path / "made").iterdir())) == 1
    assert sorted(folder.rglob("*")) == before


def test_a_page_that_is_there_is_shown_unless_the_log_is_newer(get, folder):
    page, log = folder / "logs" / "bad.html", folder / "logs" / "bad.rrd"
    page.write_text("mine")
    assert get("/logs/bad.html") == (200, "mine")
    changed = page.stat().st_mtime_ns + 1_000_000
    os.utime(log, ns=(changed, changed))
    status, text = get("/logs/bad.html")
    assert status == 422
    assert "there is no page of bad.rrd" in text


@pytest.mark.parametrize("path", ["/../secret", "/%2e%2e/secret", "//etc/passwd", "/link", "/logs", "/none", "/%00"])
def test_nothing_but_files_of_the_folder_is_shown(get, path):
    status, text = get(path)
    assert status in (400, 403, 404)
    assert "secret\n" not in text
    assert text.startswith("<!DOCTYPE html>")


def test_a_name_that_leads_to_this_machine_is_no_way_in(get):
    assert get("/", host="elsewhere.example:80")[0] == 403


def test_a_log_can_be_asked_for_without_being_sent(get, folder):
    assert get("/logs/a%20b.rrd", method="HEAD") == (200, "")
    status, _ = get("/logs/a%20b.rrd")
    assert status == 200


def test_a_folder_without_a_report_lists_its_logs(get, folder):
    (folder / "report.html").unlink()
    status, text = get("/")
    assert status == 200
    assert '<a href="logs/a%20b.html">page</a>' in text


def test_a_log_of_a_pair_of_drives_has_no_link_to_a_page():
    link = '<a href="logs/x_beside_truth.rrd">rrd</a>'
    assert linked(link) == link

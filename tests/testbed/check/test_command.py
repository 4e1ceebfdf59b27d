"""`testbed check` and what installed packages register, as a user meets them."""

import shutil
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbed.cli import app
from tests.testbed.check import broken
from tests.trackers.test_own_entries import register


@pytest.fixture
def user(tmp_path, monkeypatch):
    shutil.copy(Path(broken.__file__), tmp_path / "my_filters.py")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    sys.modules.pop("my_filters", None)


def call(*arguments):
    return CliRunner().invoke(app, arguments, env={"COLUMNS": "400"})


def test_a_filter_that_keeps_all_laws_is_exit_status_0(user):
    done = call("check", "tracker", "my_filters:Centroid:accel_std=3")
    assert done.exit_code == 0
    *laws, last = done.output.splitlines()
    assert len(laws) == 25
    assert all(line.startswith("holds   ") for line in laws)
    assert last == "my_filters:Centroid:accel_std=3 keeps all laws"


def test_a_broken_filter_is_told_why_and_exit_status_1(user):
    done = call("check", "tracker", "my_filters:Unsymmetric")
    assert done.exit_code == 1
    assert (
        "broken  covariances stay symmetric and positive\n        cov of the estimate is not symmetric" in done.output
    )
    assert done.output.endswith("my_filters:Unsymmetric breaks 1 of 25 laws\n")


def test_one_fault_does_not_hide_the_others(user):
    done = call("check", "tracker", "my_filters:Faint")
    assert done.output.count("broken  ") == 1
    assert "ZeroDivisionError: division by zero (my_filters.py:" in done.output


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("tracker", "my_filter:Centroid"), "there is no module 'my_filter' here or on PYTHONPATH"),
        (("tracker", "my_filters:Centroid:std=1"), "has no parameter std; it has accel_std, detection_std"),
        (("traker", "rm-koch"), "no kind of entry 'traker'; did you mean 'tracker'?"),
        (("scenario", "highway-v0"), "no scenario 'highway-v0'"),
    ],
)
def test_what_cannot_be_checked_is_one_sentence_and_exit_status_2(user, arguments, sentence):
    done = call("check", *arguments)
    assert done.exit_code == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_list_shows_what_packages_register_and_where_it_comes_from(user, monkeypatch):
    register(user, "my-package", {"trackers": "centroid = my_filters:Centroid\nrm-koch = my_filters:Centroid"})
    monkeypatch.syspath_prepend(str(user))
    done = call("list", "trackers")
    assert "the name is ours, write my_filters:Centroid" in " ".join(done.output.split())
    assert done.exit_code == 0
    assert "centroid" in done.output
    assert "from my-package 1.2: my_filters:Centroid" in done.output
    assert call("check", "tracker", "centroid").exit_code == 0

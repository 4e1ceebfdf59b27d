"""Radars as files: every entry of the catalogue comes back, and what no radar has is refused in a sentence."""

import numpy as np
import pytest
from typer.testing import CliRunner

from sensors import RADARS, find
from sensors.radar_file import text_of
from testbed.cli import app
from testbed.experiments.identity import own_code, own_names

ONE = "[[sensors]]\nmax_range = 50\n"
WRONG = {
    "x = 1": r"radar\.toml has no key x; it has the keys name, note, sensors, rate, ghosts",
    "rate = 10": r"radar\.toml has no key sensors, which it needs",
    "sensors = 3": r"sensors must be tables \[\[sensors\]\], got 3",
    "[[sensors]]\nfov_dg = 3": r"sensors 1 has no key fov_dg; did you mean fov_deg\?",
    "[[sensors]]\n[[sensors]]\nfov_deg = 'a'": r"sensors 2, fov_deg must be a number, got 'a'",
    "[[sensors]]\nrate = true": r"sensors 1, rate must be a number, got True",
    "[[sensors]]\nfov_deg = 400": r"sensors 1: sensor\.fov_deg must be at most 360, got 400",
    "[[sensors]]\nmount = [1, 2]": r"mount must be a list of 3 numbers, got \[1, 2\]",
    "[[sensors]]\nmount = [2.3, 0.0, 90.0]": r"more than a turn; it is in rad",
    "[[sensors]]\nprofile = 3": r"sensors 1, profile must be a table, got 3",
    "[[sensors]]\nprofile = {patchy = 1}": r"profile, patchy must be true or false, got 1",
    "[[sensors]]\nroadside = {seed = 1.5}": r"roadside, seed must be a whole number, got 1\.5",
    "[[sensors]]\npersistence = {}": r"persistence has no key lifetime, which it needs",
    "rate = 'fast'\n" + ONE: r"rate must be a number, got 'fast'",
    "note = 3\n" + ONE: r"note must be a text, got 3",
    "compiled = false\n" + ONE: r"no key compiled",
    "ghosts = {mirror = 2}\n" + ONE: r"ghosts: ghosts\.mirror must be within 0 and 1",
    "[": r"is no TOML",
}


@pytest.mark.parametrize("name", RADARS)
def test_every_radar_of_the_catalogue_comes_back(name, tmp_path):
    file = tmp_path / "radar.toml"
    file.write_text(text_of(RADARS[name]))
    assert find(str(file)) == RADARS[name]


def test_what_is_not_given_has_its_default(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("rate = 13\n" + ONE + "persistence = {lifetime = 2.0}\n")
    radar = find(str(file))
    assert (radar.name, radar.rate, radar.sensors[0].persistence.lifetime) == ("mine", 13, 2.0)
    assert radar.models[0].max_range == 50
    assert radar.models[0].fov == pytest.approx(np.pi / 2)


@pytest.mark.parametrize("text", WRONG)
def test_what_no_radar_has_is_refused(text, tmp_path):
    file = tmp_path / "radar.toml"
    file.write_text(text)
    with pytest.raises(ValueError, match=WRONG[text]) as raised:
        find(str(file))
    assert "\n" not in str(raised.value)


def test_no_file_is_refused_in_a_sentence(tmp_path):
    with pytest.raises(LookupError, match=r"nowhere\.toml' cannot be read: No such file"):
        find(str(tmp_path / "nowhere.toml"))
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(LookupError, match="Is a directory"):
        find(str(tmp_path / "folder.toml"))


def test_the_command_writes_a_file_that_a_run_takes_and_a_study_knows_its_content(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = CliRunner().invoke(app, ["radar", "show", "front"])
    assert shown.exit_code == 0
    (tmp_path / "my.toml").write_text(shown.stdout)
    call = ["run", "cut-in", "--radar", "my.toml", "--tracker", "rm-koch", "--duration", "0.2", "--log", "off"]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
    names = own_names(radars=["my.toml", "front"])
    assert names == [("radar", "my.toml")]
    before = own_code(names)
    (tmp_path / "my.toml").write_text(shown.stdout.replace("max_range = 174.0", "max_range = 150.0"))
    assert own_code(names) != before
    assert CliRunner().invoke(app, ["radar", "hide", "front"]).exit_code == 2


def test_a_number_of_the_sensors_holds_for_all_of_a_rig():
    rig = find("surround:sigma_range=0.5,rate=10")
    assert {s.sigma_range for s in rig.sensors} == {0.5}
    assert rig.rate == 10
    assert rig.name == "surround:sigma_range=0.5,rate=10"
    assert [s.mount for s in rig.sensors] == [s.mount for s in RADARS["surround"].sensors]
    assert find("surround").sensors == RADARS["surround"].sensors


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("surround:sigma=0.5", "surround has no parameter sigma; it has rate, "),
        ("surround:mount=3", "surround has no parameter mount"),
        ("surround:sigma_range=far", "surround: sigma_range must be a number, such as 0.5, got 'far'"),
        ("surround:fov_deg=400", "sensor.fov_deg must be at most 360, got 400"),
        ("surround:rate=0", "rate must be positive, got 0"),
    ],
)
def test_a_number_that_no_sensor_has_is_refused(text, sentence):
    with pytest.raises(ValueError, match=r"parameter|must") as raised:
        find(text)
    assert sentence in str(raised.value)

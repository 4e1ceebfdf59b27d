"""Scenarios as files, and density and speed of their traffic."""

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios import PROBES, SCENARIOS, find
from scenarios.scenario_file import text_of
from testbed.cli import app
from testbed.experiments.identity import own_code, own_module, own_names

HEAD = 'builder = "scenarios.maneuvers:cut_in"\nvehicles = 9\n'
PARAMETER = '[[parameters]]\nname = "gap"\ndefault = 1.0\neasy = 2.0\nhard = 0.5\nunit = "m"\nnote = "a gap"\n'
WRONG = {
    "x = 1": r"scene\.toml has no key x; it has the keys name, purpose, builder",
    "vehicles = 9": r"has no key builder, which it needs",
    f"{HEAD}duratoin = 3": r"no key duratoin; did you mean duration\?",
    f"{HEAD}duration = 0": r"duration must be positive and finite, got 0",
    f"{HEAD}duration = true": r"duration must be a number, got True",
    f"{HEAD}parameters = 3": r"must be tables \[\[parameters\]\], got 3",
    f"{HEAD}{PARAMETER.replace('note', 'nota')}": r"parameters 1 has no key nota; did you mean note\?",
    f"{HEAD}{PARAMETER.replace('1.0', '9.0')}": r"gap must be a number from 0\.5 to 2 m, got 9\.0",
}


def state(world):
    return np.array([(*v.position, v.heading, v.speed) for v in world.road.vehicles])


def built(name, seed=1):
    return find(name).build(np.random.default_rng(seed))


@pytest.mark.parametrize("name", [*SCENARIOS, *PROBES])
def test_every_scenario_comes_back_with_density_and_speed_as_parameters(name, tmp_path):
    file = tmp_path / "scene.toml"
    entry = {**SCENARIOS, **PROBES}[name]
    file.write_text(text_of(entry))
    found = find(str(file))
    own = len(entry.parameters)
    assert replace(found, name=name, parameters=found.parameters[:own]) == entry
    assert [(p.name, p.default) for p in found.parameters[own:]] == [("density", 1.0), ("speed", 1.0)]


@pytest.mark.parametrize("text", WRONG)
def test_what_no_scenario_has_is_refused(text, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(text)
    with pytest.raises(ValueError, match=WRONG[text]) as raised:
        find(str(file))
    assert "\n" not in str(raised.value)


def test_parameters_of_one_change_nothing():
    np.testing.assert_array_equal(state(built("dense-traffic")), state(built("dense-traffic:density=1,speed=1")))


@pytest.mark.parametrize(("density", "more"), [(0.5, -10), (1.5, 8)])
def test_density_is_the_number_of_vehicles_in_the_platoons(density, more):
    plain, other = built("dense-traffic"), built(f"dense-traffic:density={density}")
    difference = len(other.road.vehicles) - len(plain.road.vehicles)
    assert difference <= more if more < 0 else difference >= more


def test_speed_passes_the_same_ways_in_another_time():
    plain, fast = built("cut-in"), built("cut-in:speed=1.2")
    np.testing.assert_allclose(state(fast)[:, :3], state(plain)[:, :3], atol=1e-9)
    np.testing.assert_allclose(state(fast)[:, 3], 1.2 * state(plain)[:, 3])
    assert fast.phases[1].start == pytest.approx(plain.phases[1].start / 1.2)
    courses = [next(v for v in w.road.vehicles if hasattr(v, "table")).table for w in (plain, fast)]
    pose, rate = courses[0].at(6.0)
    pose_fast, rate_fast = courses[1].at(5.0)
    np.testing.assert_allclose(pose_fast, pose, atol=1e-6)
    np.testing.assert_allclose(rate_fast, 1.2 * rate, atol=1e-4)
    headway, other = (w.road.vehicles[-1].TIME_WANTED for w in (plain, fast))
    assert other == pytest.approx(headway / 1.2)


def test_the_command_writes_a_file_that_a_run_takes_and_a_study_knows_its_content(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = CliRunner().invoke(app, ["scenario", "show", "cut-in"])
    assert shown.exit_code == 0
    (tmp_path / "my.toml").write_text(shown.stdout)
    call = ["run", "my.toml:density=0.5", "--tracker", "rm-koch", "--duration", "0.2", "--log", "off"]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
    assert [file.name for file in tmp_path.glob("runs/my.toml*.json")]
    names = own_names(scenarios=["my.toml", "cut-in"])
    assert names == [("scenario", "my.toml")]
    before = own_code(names)
    (tmp_path / "my.toml").write_text(shown.stdout.replace("duration = 20.0", "duration = 15.0"))
    assert own_code(names) != before
    (tmp_path / "my.toml").write_text(shown.stdout.replace("scenarios.maneuvers:cut_in", "my_scenes:mine"))
    assert own_module("my.toml", "scenario") == "my_scenes"
    assert CliRunner().invoke(app, ["scenario", "show", "my_scenes:mine"]).exit_code == 2

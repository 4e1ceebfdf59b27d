"""The gymnasium ids of the scenarios."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import testbed
from scenarios import PROBES, SCENARIOS
from testbed.environment.registration import env_id, make, register_scenarios, scenario_of
from testbed.environment.wrapper import TrackedEnv
from tests.parameters import PROBE, rest_slow


def python(code: str, path: Path | None = None) -> subprocess.CompletedProcess:
    """Run code in a fresh interpreter; a directory given is the first on its path."""
    root = Path(testbed.__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=path or root, check=False)


def test_every_scenario_has_an_id_and_registering_again_changes_nothing():
    before = {key: spec for key, spec in gym.registry.items() if key.startswith("testbed/")}
    assert before.keys() == {env_id(name) for name in (*SCENARIOS, *PROBES)}
    register_scenarios()
    assert all(gym.registry[key] is spec for key, spec in before.items())


def test_the_import_is_light():
    heavy = ("highway_env", "pandas", "pygame", "matplotlib", "rerun", "shapely")
    done = python(f"import sys, testbed; print([m for m in {heavy} if m in sys.modules])")
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_a_foreign_package_of_the_same_name_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "trackers").mkdir()
    (tmp_path / "trackers" / "__init__.py").touch()
    done = python("import testbed", tmp_path)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: testbed needs its own package 'trackers'")
    assert str(tmp_path) in last


@pytest.fixture
def installed(tmp_path):
    """The four packages as an installation has them, in a directory of their own."""
    root = Path(testbed.__file__).parents[1]
    for name in ("trackers", "sensors", "scenarios", "testbed"):
        shutil.copytree(root / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def distribution(site: Path, name: str, package: str) -> None:
    """The record of an installed distribution that brings a package."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "RECORD").write_text(f"{package}/__init__.py,,\n")


def refusal(site: Path) -> str:
    """The last line of the error with which the import of testbed ends, where nothing else is installed."""
    command = [sys.executable, "-S", "-c", "import testbed"]
    done = subprocess.run(command, capture_output=True, text=True, env={}, cwd=site, check=False)
    assert done.returncode == 1
    return done.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize("name", ["trackers", "sensors", "scenarios"])
def test_a_package_that_another_distribution_overwrote_is_named_with_its_repair(installed, name):
    (installed / name / "__init__.py").write_text("from collections import OrderedDict\n")
    distribution(installed, "foreign", name)
    distribution(installed, "eot-testbed", name)
    assert refusal(installed) == (
        f"ImportError: {installed / name / '__init__.py'} was overwritten by 'foreign'; repair it with: "
        "python -m pip uninstall foreign && python -m pip install --force-reinstall --no-deps eot-testbed"
    )


def test_a_package_that_went_with_the_other_distribution_is_named_with_its_repair(installed):
    (installed / "trackers" / "__init__.py").unlink()
    distribution(installed, "eot-testbed", "trackers")
    assert refusal(installed) == (
        f"ImportError: {installed / 'trackers' / '__init__.py'} is missing, as after uninstalling another "
        "distribution that brings a package 'trackers'; repair it with: "
        "python -m pip install --force-reinstall --no-deps eot-testbed"
    )


def test_an_installation_beside_nothing_foreign_imports(installed):
    assert python("import testbed", installed).returncode == 0


def test_public_names_are_there_and_others_are_not():
    assert testbed.TrackedEnv is TrackedEnv
    assert {"TrackedEnv", "PLANNERS", "Planner"} <= set(dir(testbed))
    with pytest.raises(AttributeError, match="no_such_name"):
        testbed.no_such_name  # noqa: B018


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version", "ignore:.*infinity")
@pytest.mark.parametrize("name", rest_slow([*SCENARIOS, *PROBES], "cut-in", "roundabout", "articulated-turn", PROBE))
def test_gymnasium_finds_nothing_wrong_with(name):
    env = gym.make(env_id(name), config={"duration": 5.0})
    check_env(env, skip_render_check=name != "cut-in")
    env.close()
    env.close()


def test_the_made_environment_is_the_wrapper_itself():
    env = gym.make("testbed/cut-in-v0", tracker="truth", radar="front", out="somewhere", log="metrics")
    assert isinstance(env, TrackedEnv)
    assert (env.out, env.log) == ("somewhere", "metrics")
    assert not Path("somewhere").exists()


@pytest.mark.parametrize("as_json", [False, True])
def test_a_spec_rebuilds_its_environment(as_json):
    tracker = {"name": "rm-feldmann", "sigma": 0.4}
    env = gym.make("testbed/cut-in-v0", tracker=tracker, radar="front", also=["truth"], config={"duration": 3.0})
    spec = EnvSpec.from_json(env.spec.to_json()) if as_json else env.spec
    again = gym.make(spec)
    assert isinstance(again, TrackedEnv)
    assert not isinstance(again.env, TrackedEnv)
    a, b = (e.reset(seed=4)[0] for e in (env, again))
    np.testing.assert_array_equal(a, b)
    assert list(again.all_tracks) == ["rm-feldmann(sigma=0.4)", "truth"]
    assert again.unwrapped.config["duration"] == 3.0


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors_of_environments_run(mode):
    single = gym.make("testbed/following-v0", tracker="truth")
    expected, _ = single.reset(seed=8)
    envs = gym.make_vec("testbed/following-v0", num_envs=2, vectorization_mode=mode, tracker="truth")
    try:
        observation, _ = envs.reset(seed=7)
        np.testing.assert_array_equal(observation[1], expected)
        observation, reward, _, _, info = envs.step(np.array([1, 4]))
        assert observation.shape == (2, *expected.shape)
        assert reward.shape == (2,)
        assert info["tracks"].shape == (2,)
    finally:
        envs.close()


def first_scene(env):
    """Poses of all vehicles after a reset and two steps."""
    env.reset(seed=3)
    for _ in range(2):
        env.step(1)
    return env.truth.objects.pose


def test_a_scenario_with_parameters_is_the_same_as_one_with_a_config():
    text = "probe-brake:gap=26"
    assert scenario_of(text).name == text
    one = first_scene(make(text, {"duration": 5.0}, tracker="truth"))
    two = first_scene(make("probe-brake", {"duration": 5.0, "gap": 26.0}, tracker="truth"))
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, first_scene(make("probe-brake", tracker="truth")))


def test_an_environment_of_highway_env_stands_in_for_a_scenario(tmp_path):
    text = "highway-v0:vehicles_count=8,duration=2"
    found = scenario_of(text)
    assert (found.id, found.duration, found.values) == ("highway-v0", 2.0, {"vehicles_count": 8, "duration": 2})
    env = make(text, {"lanes_count": 3}, tracker="truth", out=str(tmp_path), log="off")
    plain = TrackedEnv(gym.make("highway-v0", config={"lanes_count": 3, "vehicles_count": 8}), tracker="truth")
    np.testing.assert_array_equal(first_scene(env), first_scene(plain))
    env.close()
    assert [f.name for f in tmp_path.iterdir()] == [f"{text.replace(':', '~')}_truth_surround_idm_seed3_2s.json"]
    assert scenario_of("merge-v0").duration == np.inf


@pytest.mark.parametrize(
    ("text", "fault", "sentence"),
    [
        (
            "highway-v7",
            LookupError,
            "'highway-v7' of the testbed or of highway-env; did you mean 'highway-v",
        ),
        ("highway-v0:lane_count=3", ValueError, "highway-v0 has no config lane_count; it has action, "),
        ("probe-brake:gab=26", ValueError, "probe-brake has no parameter gab; it has gap, density, speed, drivers"),
        ("probe-brake:gap=2", ValueError, "gap must be a number from 6 to 60 m, got 2"),
        ("cut-in:gap=2", ValueError, "cut-in has no parameter gap; it has density, speed, drivers"),
        ("json:loads", ValueError, "it must be a `scenarios.Scenario`"),
    ],
)
def test_what_is_no_scenario_is_said_in_a_sentence(text, fault, sentence):
    with pytest.raises(fault) as caught:
        scenario_of(text)
    assert sentence in str(caught.value)


def test_a_key_that_an_environment_of_highway_env_does_not_have_is_refused():
    with pytest.raises(ValueError, match="highway-v0 has no config lane_count"):
        make("highway-v0", {"lane_count": 3})

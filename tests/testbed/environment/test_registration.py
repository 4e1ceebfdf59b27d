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
from testbed.environment.registration import env_id, register_scenarios
from testbed.environment.wrapper import TrackedEnv


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
@pytest.mark.parametrize("name", [*SCENARIOS, *PROBES])
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

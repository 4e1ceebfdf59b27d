"""One run from start to files: what is written, what repeats, what does not depend on what."""

import json
import shlex
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from testbed.environment.perception import Cost
from testbed.environment.wrapper import TrackedEnv
from testbed.experiments.single import RunConfig, Unusable, check, make_env, run
from testbed.files import LostFileWarning
from testbed.log import reader
from testbed.log.record import run_id
from tests.testbed.log import log_content
from trackers import DEFAULT
from trackers.multi.tracks import StepInfo


def short(out, trackers=("rm-feldmann",), **settings):
    return RunConfig("cut-in", trackers, duration=2.0, out=str(out), **settings)


def test_runs_and_environments_use_the_default_tracker_where_none_is_named():
    assert RunConfig("cut-in").trackers == (DEFAULT,)
    assert list(gym.make("testbed/cut-in-v0").costs) == [DEFAULT]
    assert list(TrackedEnv(gym.make("highway-v0")).costs) == [DEFAULT]


def record(config, seconds=1.0):
    """Poses of all objects and the scans of a run in which the ego idles."""
    env = make_env(config)
    poses, scans = [], []
    env.attach(lambda frame: (poses.append(frame.scene.objects.pose), scans.append(frame.scan)))
    env.reset(seed=config.seed)
    while env.truth.time < seconds:
        env.step(1)
    env.close()
    return poses, scans


def equal(a, b):
    return len(a) == len(b) and all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    return [run(short(tmp_path_factory.mktemp("run"), radar="front")) for _ in range(2)]


def test_a_run_leaves_a_log_and_results_that_read_back(twice):
    done = twice[0]
    assert json.loads(done.json.read_text()) == done.result
    assert reader.complete(done.rrd)
    assert reader.span(done.rrd) == (0.0, 2.0)
    assert len(reader.steps(done.rrd)) == 31 == done.result["trackers"]["rm-feldmann"]["scans"]
    assert reader.properties(done.rrd)["run"]["scenario"] == "cut-in"
    assert not done.interrupted
    assert done.exit_status == 0
    assert set(done.result["timing"]) == {"sense", "track", "metrics", "log", "wall", "cpu", "trackers"}


def test_the_log_has_the_errors_of_the_results(twice):
    (gospa,) = (v for _, v in reader.scalars(twice[0].rrd, "metrics/gospa/rm-feldmann").values())
    assert gospa.mean() == pytest.approx(twice[0].result["trackers"]["rm-feldmann"]["gospa"], rel=1e-12)


def test_one_seed_gives_one_result(twice):
    a, b = twice
    assert log_content.digests(a.rrd) == log_content.digests(b.rrd)
    assert {**a.result, "timing": 0, "made": 0} == {**b.result, "timing": 0, "made": 0}


def test_results_say_where_they_come_from(twice):
    done = twice[0]
    made = json.loads(done.json.read_text())["made"]
    assert made == done.result["made"]
    assert datetime.strptime(made["date"], "%Y-%m-%dT%H:%M:%S%z") <= datetime.now(UTC)
    assert made["command"].endswith(shlex.join(sys.argv[1:]))
    assert len(made["code"]) == 12
    root = Path(__file__).parents[3]
    if (root / ".git").exists():
        assert len(made["commit"]) == 40
        assert isinstance(made["changed"], bool)
    else:
        assert made["commit"] is None is made["changed"]
    assert str(root) not in json.dumps(made)
    assert done.result["run"]["config"] == {"simulation_frequency": 15, "policy_frequency": 5, "duration": 2.0}


def test_another_seed_gives_another(twice, tmp_path):
    other = run(short(tmp_path, radar="front", seed=1))
    assert other.result["drive"] != twice[0].result["drive"]
    assert log_content.digest(other.rrd) != log_content.digest(twice[0].rrd)


def test_neither_radar_nor_tracker_changes_the_traffic(tmp_path):
    poses, scans = record(short(tmp_path, log="off"))
    others, other_scans = record(short(tmp_path, log="off", radar="imaging", trackers=("rm-surface",)))
    assert equal(poses, others)
    assert not equal([s.polar for s in scans], [s.polar for s in other_scans])


def test_the_cost_of_a_tracker_counts_tracks_that_got_a_detection():
    step = StepInfo(*[np.zeros(0)] * 7, events=())
    cost = Cost().after(0.002, step._replace(detections=np.array([0, 3, 1])))
    assert np.isnan(Cost().after(0.002, step).row()["us_per_update"])
    cost = cost.after(0.004, step._replace(detections=np.array([2])))
    assert cost.row() == pytest.approx({"ms_per_scan": 3.0, "us_per_update": 2000.0})


def test_the_costs_of_the_trackers_are_the_time_spent_on_tracking(tmp_path):
    done = run(short(tmp_path, log="off", trackers=("rm-feldmann", "rm-surface"))).result
    timing, scans = done["timing"], done["trackers"]["rm-feldmann"]["scans"]
    spent = sum(cost["ms_per_scan"] for cost in timing["trackers"].values()) * scans / 1e3
    assert spent == pytest.approx(timing["track"], rel=1e-9)


def test_observers_are_called_with_every_frame(tmp_path):
    times = []
    done = run(short(tmp_path, log="off"), observers=[lambda frame: times.append(frame.time)])
    assert len(times) == done.result["trackers"]["rm-feldmann"]["scans"]
    assert times[0] == 0.0


def test_a_further_tracker_changes_neither_detections_nor_the_first(tmp_path):
    alone = run(short(tmp_path, log="off"))
    both = run(short(tmp_path, log="off", trackers=("rm-feldmann", "rm-surface")))
    first, second = both.result["trackers"].values()
    assert first == alone.result["trackers"]["rm-feldmann"]
    assert both.result["drive"] == alone.result["drive"]
    assert (second["scans"], second["objects_visible"]) == (first["scans"], first["objects_visible"])
    assert second["gospa"] != first["gospa"]


def test_the_first_tracker_is_what_the_planner_sees(tmp_path):
    env = make_env(short(tmp_path, log="off", trackers=("rm-surface", "rm-feldmann")))
    env.reset(seed=0)
    for _ in range(5):
        env.step(1)
    believed = np.array([v.position for v in env.unwrapped.road.vehicles[1:]])
    first, second = (tracks.reported.estimate.pose[:, :2] for tracks in env.all_tracks.values())
    env.close()
    assert len(believed) > 3
    distance = [np.abs(believed[:, None] - xy).sum(-1).min(-1) for xy in (first, second)]
    assert distance[0].max() < 1e-6
    assert distance[1].min() > 1e-6


def test_the_planner_that_knows_the_truth_is_scored_with_trackers_beside_it(tmp_path):
    done = run(short(tmp_path, log="off", planner="truth"))
    assert list(done.result["trackers"]) == ["truth", "rm-feldmann"]
    assert done.result["trackers"]["truth"]["rmse_position"] == pytest.approx(0.0, abs=1e-9)


def test_progress_ends_at_the_duration(tmp_path):
    reported = []
    run(short(tmp_path, log="off"), lambda done, total: reported.append((done, total)))
    assert reported[-1] == (pytest.approx(2.0), 2.0)
    assert [done for done, _ in reported] == pytest.approx(0.2 * np.arange(1, 11))


def test_an_error_on_the_way_leaves_partial_results_and_is_raised(tmp_path):
    def fail(done, total):
        if done > 0.5:
            raise ZeroDivisionError("halfway")

    with pytest.raises(ZeroDivisionError, match="halfway"):
        run(short(tmp_path), fail)
    (results,), (log,) = tmp_path.glob("*.json"), tmp_path.glob("*.rrd")
    found = json.loads(results.read_text())
    assert found["interrupted"]
    assert found["drive"]["elapsed"] == pytest.approx(0.6)
    assert reader.complete(log)


def test_results_that_cannot_be_written_are_returned_and_told(tmp_path):
    config = short(tmp_path, log="off")
    name = f"{run_id('cut-in', config.trackers, config.radar, config.planner, 0, config.duration)}.json"
    with pytest.warns(
        LostFileWarning, match=rf"^cannot write .*{name}: it is a directory; choose another file$"
    ) as told:
        done = run(config, lambda done, total: (tmp_path / name).mkdir(exist_ok=True))
    assert done.lost == (str(told[0].message),)
    assert (done.json, done.rrd, done.exit_status, done.interrupted) == (None, None, 2, False)
    assert done.result["drive"]["elapsed"] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"scenario": "cut-inn"}, LookupError, "did you mean 'cut-in'"),
        ({"trackers": ("rm-feldman",)}, LookupError, "did you mean 'rm-feldmann'"),
        ({"radar": "surrond"}, LookupError, "did you mean 'surround'"),
        ({"planner": "idn"}, LookupError, "did you mean 'id"),
        ({"log": "loud"}, ValueError, "log must be one of off, metrics, full, got 'loud'"),
        ({"seed": -1}, ValueError, "seed must not be negative, got -1"),
        ({"duration": 0.0}, ValueError, "duration must be positive and finite, got 0.0 s"),
        ({"duration": float("inf")}, ValueError, "duration must be positive and finite, got inf s"),
        ({"duration": float("nan")}, ValueError, "duration must be positive and finite, got nan s"),
        ({"duration": "x"}, ValueError, "duration must be positive and finite, got 'x' s"),
        ({"seed": 1.5}, ValueError, "seed must be a whole number, got 1.5"),
        ({"trackers": "rm-koch"}, ValueError, "trackers must be a tuple of names, got 'rm-koch'"),
        ({"trackers": ()}, ValueError, "trackers must name at least one"),
        ({"trackers": ("rm-surface", "rm-surface")}, ValueError, "trackers must differ, got rm-surface, rm-surface"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_is_written(tmp_path, settings, error, message):
    out = tmp_path / "runs"
    with pytest.raises(error, match=message):
        check(RunConfig(**{"scenario": "cut-in", "out": str(out), **settings}))
    assert not out.exists()


def test_a_run_without_metrics_drives_the_same_and_measures_nothing(tmp_path):
    truth: dict[bool, list] = {True: [], False: []}
    done = {
        on: run(
            short(tmp_path / str(on), log="off", metrics=on),
            observers=[lambda frame, on=on: truth[on].append(frame.scene.ego.pose)],
        )
        for on in truth
    }
    assert equal(truth[True], truth[False])
    assert set(done[False].result) == {"run", "interrupted", "timing", "made"}
    assert done[False].result["run"] == done[True].result["run"]
    assert "metrics" not in done[False].result["timing"]
    assert json.loads(done[False].json.read_text()) == done[False].result


def test_a_config_in_a_file_is_in_the_name_and_in_the_results(tmp_path):
    file = tmp_path / "cfg.json"
    file.write_text('{"vehicles_count": 6, "duration": 1}')
    config = RunConfig("highway-v0", ("rm-feldmann:sigma=0.3",), out=str(tmp_path / "out"), config=str(file))
    check(config)
    held = file.read_text()
    file.unlink()  # it is read once
    done = run(config)
    assert not done.interrupted
    assert done.result["run"]["scenario"].startswith("highway-v0+cfg-")
    assert config.settings == json.loads(held)
    assert done.result["run"]["config"]["duration"] == 1
    assert reader.complete(done.rrd)
    file.write_text('{"vehicles_count": 7, "duration": 1}')
    assert run(replace(config)).json != done.json
    own = RunConfig("cut-in", ("rm-feldmann",), out=str(tmp_path / "out"), log="off", config=str(file))
    with pytest.raises(ValueError, match="config has no key 'vehicles_count'"):
        run(own)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", "config: .*cannot read"),
        ("[1]", "config: .*must hold one JSON object"),
        (None, "config: .*no"),
        ('{"duration": "long"}', "duration must be positive and finite, got 'long' s"),
    ],
)
def test_a_config_that_is_none_is_refused_in_a_sentence(tmp_path, text, sentence):
    file = tmp_path / "cfg.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ValueError, match=sentence):
        check(RunConfig("cut-in", out=str(tmp_path), config=str(file)))


@pytest.mark.parametrize(
    ("scenario", "text", "sentence"),
    [
        (
            "highway-v0",
            '{"vehicle_count": 3}',
            "highway-v0 with .*cannot be run: highway-v0 has no config veh.*;",
        ),
        (
            "highway-v0",
            '{"vehicles_count": "many"}',
            "cannot be run: TypeError: .*; change the config",
        ),
        ("highway-v0", '{"policy_frequency": 0}', r"config\['policy_frequency'\] must be positive and finite, got 0;"),
        ("highway-v0", '{"action": {"type": "Fly"}}', "cannot be run: Unknown action type; change the config"),
        ("cut-in", '{"vehicles_count": 3}', "cut-in with .*cfg.json cannot be run: config has no key 'vehicles_count'"),
        (
            "parking-v0",
            "{}",
            "parking-v0 cannot be run: TypeError: the planner needs .*; change",
        ),
    ],
)
def test_a_config_that_the_environment_does_not_take_is_told_in_a_sentence(tmp_path, scenario, text, sentence):
    file = tmp_path / "cfg.json"
    file.write_text(text)
    config = RunConfig(scenario, ("rm-feldmann",), duration=1.0, out=str(tmp_path), log="off", config=str(file))
    check(config)
    with pytest.raises(Unusable, match=sentence):
        run(config)


def test_what_nobody_has_configured_stays_a_defect(tmp_path, monkeypatch):
    monkeypatch.setattr("testbed.experiments.single.make_env", lambda config: {}["gone"])
    with pytest.raises(KeyError):
        run(short(tmp_path))


def test_only_scenarios_of_ours_know_when_a_maneuver_ends(tmp_path):
    with pytest.raises(ValueError, match="after: highway-v0 is of highway-env and has no maneuver; give --duration"):
        check(RunConfig("highway-v0", out=str(tmp_path), after=3.0))
    check(RunConfig("cut-in", out=str(tmp_path), after=3.0))


def test_an_environment_without_a_duration_ends_with_that_of_the_run(tmp_path):
    done = run(RunConfig("merge-v0", ("rm-feldmann",), duration=1.0, out=str(tmp_path), log="off"))
    assert done.result["drive"]["elapsed"] == pytest.approx(1.0, abs=0.2)
    assert not done.interrupted

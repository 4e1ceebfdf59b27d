"""One drive of a probe, and whether it was survived."""

from collections.abc import Mapping
from contextlib import closing
from typing import Any, NamedTuple

from scenarios import SCENARIOS, Scenario
from scenarios.probes import PROBES
from sensors import find as find_radar
from testbed.environment.perception import tracker_of
from testbed.environment.registration import make, scenario_of
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.frame import Observer
from testbed.planners import begin, settings
from testbed.planners import find as find_planner
from trackers.lookup import is_own, look_up

FREE = 1.0  # [m/s^2] braking up to this is none, where nothing calls for it


class Setting(NamedTuple):
    """A probe and who drives in it; names as in the catalogues."""

    probe: str
    planner: str = "idm"
    tracker: str = "truth"
    radar: str = "surround"

    def check(self) -> None:
        """Raise LookupError, TypeError or ValueError, in one sentence, for what is not in the catalogues."""
        find_probe(self.probe)
        find_planner(self.planner)
        tracker_of(self.tracker, find_radar(self.radar))


def find_probe(name: str) -> Scenario:
    """A probe of the catalogue, or a scenario of a user that has a parameter.

    Raises:
        LookupError: there is none, and the nearest name is suggested; or it has no parameter.
    """
    if not is_own(name, {**PROBES, **SCENARIOS}):
        return look_up(name, PROBES, "probe")
    found = scenario_of(name)
    if not isinstance(found, Scenario):
        raise LookupError(
            f"{name} is an environment of highway-env, of which nothing says what makes it harder; "
            "probe a scenario with `parameters`, see docs/own-code.md"
        )
    if not found.parameters:
        raise LookupError(f"{name} has no parameter that can be made harder; give its Scenario `parameters`")
    return found


def drive(
    setting: Setting, seed: int, values: Mapping[str, float] | None = None, observer: Observer | None = None
) -> dict[str, float | int]:
    """Metrics of one drive; `values` of the probe's parameters replace their defaults."""
    planner, evaluator = find_planner(setting.planner), DriveEvaluator()
    config = {**settings(planner), **(values or {})}
    with closing(make(setting.probe, config, tracker=setting.tracker, radar=setting.radar)) as env:
        tracked: Any = env
        tracked.attach(lambda frame: evaluator.step(frame.scene))
        if observer is not None:
            tracked.attach(observer)
        env.reset(seed=seed)
        begin(planner, env)
        done = False
        while not done:
            action, tracked.plan = planner.choose(env)
            _, _, terminated, truncated, _ = env.step(action)
            done = terminated or truncated
    return evaluator.summary()


def survived(probe: Scenario, row: Mapping[str, float | int]) -> bool:
    """Whether nothing was hit; in a probe in which nothing calls for braking, also whether the ego did not brake."""
    return not row["collisions"] and (not probe.calm or row["deceleration_max"] < FREE)


def survives(setting: Setting, seed: int, values: Mapping[str, float]) -> bool:
    """Whether a drive with these parameters is survived."""
    return survived(find_probe(setting.probe), drive(setting, seed, values))

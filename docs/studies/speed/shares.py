"""Where the time of a frame goes, and what more vehicles cost."""

from collections.abc import Mapping
from contextlib import closing
from time import perf_counter
from typing import Any, NamedTuple

from testbed.bench import deciding, frames_of, highway, stepping
from testbed.environment.wrapper import TrackedEnv
from testbed.experiments.single import RunConfig, make_env
from testbed.planners import find as find_planner
from trackers import DEFAULT

SCENARIOS = ("cut-in", "dense-traffic")
VEHICLES = (5, 10, 20, 50)


class Costs(NamedTuple):
    """Wall time of a simulated frame with so many vehicles."""

    vehicles: int
    simulation: float  # [ms] of the stock environment
    radar: float  # [ms]
    tracker: float  # [ms]
    tracks: int  # reported at the end


def shares(scenario: str, seconds: int, out: str) -> Mapping[str, float]:
    """Shares of the wall time of so many simulated seconds without a log, the reset left out."""
    planner = find_planner(RunConfig.planner)
    with closing(make_env(RunConfig(scenario, duration=float(seconds + 1), out=out, log="off"))) as env:
        tracked: Any = env
        tracked.reset(seed=0)
        before = _spent(tracked)
        start = perf_counter()
        deciding(tracked, planner, seconds * tracked.unwrapped.config["policy_frequency"])
        wall = perf_counter() - start
        known = {name: (done - before[name]) / wall for name, done in _spent(tracked).items()}
    return {**known, "simulation, planner, observation": 1.0 - sum(known.values())}


def _spent(env: Any) -> dict[str, float]:
    """Wall time [s] so far of what is measured by itself."""
    metrics = env.recorder.seconds["metrics"]
    return {"scene and radar": env.seconds["sense"], "tracker": env.seconds["track"], "metrics": metrics}


def costs(vehicles: int, steps: int) -> Costs:
    """The stock highway, and the radar and the default tracker on it, a frame."""
    with closing(highway(vehicles)) as native, closing(TrackedEnv(highway(vehicles), tracker=DEFAULT)) as tracked:
        native.reset(seed=0)
        tracked.reset(seed=0)
        passed = steps * frames_of(native)
        start = perf_counter()
        stepping(native, steps)
        simulation = perf_counter() - start
        before = dict(tracked.seconds)
        stepping(tracked, steps)
        radar, tracker = ((tracked.seconds[key] - before[key]) / passed * 1e3 for key in ("sense", "track"))
        return Costs(vehicles, simulation / passed * 1e3, radar, tracker, len(tracked.tracks.reported.id))
